"""The folder of compiled kernels: where it is, and how long files stay there.

Every edit of the sources leaves kernels behind that nobody asks for any more, but no file tells whether an older state
of the sources will come back. So a file is as young as its last use, and what was not used for two months is deleted.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
import warnings
from contextlib import suppress
from functools import cache
from pathlib import Path

from numba import config

_UNUSED = 60 * 24 * 3600.0  # s since a file was last used


@cache
def cache_directory() -> Path | None:
    """Where kernels are kept; None where nothing can be written.

    Below the directory that NUMBA_CACHE_DIR names, or else below numba's own cache directory of the user. Its name is
    one that nothing else has: a checkout or a program called flexmb may be there, too.
    """
    root = Path(config.CACHE_DIR or _of_the_user())
    directory = root / "flexmb-kernels"
    try:
        if directory.is_file():
            directory.unlink()
        directory.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=directory).close()
    except OSError as problem:
        warn_once(
            f"compiled kernels cannot be kept in {root} ({problem.strerror}), and every process compiles them again: "
            "permit writing there, or set NUMBA_CACHE_DIR to a folder where it is"
        )
        return None
    return directory


def _of_the_user() -> Path:
    """Numba's folder, where each system keeps what can be made again."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"), "numba", "Cache")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "numba"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "numba")


def mark_used(file: Path) -> None:
    """Make a file as young as one that was just written."""
    with suppress(OSError):
        os.utime(file)


@cache
def delete_unused(directory: Path) -> None:
    """Delete, once in a process, kernels that nobody has used for two months, and what their writers left behind."""
    oldest = time.time() - _UNUSED
    with suppress(OSError):
        for file in directory.glob("*.kernel*"):
            with suppress(OSError):
                if file.stat().st_mtime < oldest:
                    file.unlink()


@cache
def warn_once(text: str) -> None:
    """In this process: numba resets what Python knows of warnings that were shown."""
    warnings.warn(text, RuntimeWarning, stacklevel=2)
