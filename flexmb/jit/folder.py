"""The folder of compiled kernels: its place, its permissions, and how long files are kept.

A kernel is unpickled and run as code. Its digest is not signed, so it reveals damage, but not who wrote the file.
Therefore all files must belong to the user or the administrator, and nobody else may write to the folder.

Every edit of the sources leaves unused kernels behind, but an older state of the sources may come back. Therefore every
use updates the time of a file, and files that were not used for two months are deleted.
"""

from __future__ import annotations

import os
import stat
import sys
import tempfile
import time
import warnings
from contextlib import suppress
from functools import cache
from pathlib import Path

from numba import config

_MINE_ALONE = 0o700
_WRITABLE, _ENTERED = stat.S_IWGRP | stat.S_IWOTH, stat.S_IXGRP | stat.S_IXOTH
_UNUSED = 60 * 24 * 3600.0  # s since a file was last used


@cache
def cache_directory() -> Path | None:
    """The folder for kernels; None if it cannot be written to, and, with a warning, if others may have written to it.

    It is below the directory that NUMBA_CACHE_DIR names, or else below numba's own cache directory of the user. Its
    name is not "flexmb", because a checkout or program of that name may be there.
    """
    root = Path(config.CACHE_DIR or _of_the_user())
    directory = root / "flexmb-kernels"
    try:
        if directory.is_file():
            directory.unlink()
        directory.mkdir(mode=_MINE_ALONE, parents=True, exist_ok=True)
        if stranger := _stranger(directory.resolve()):
            warn_once(
                f"compiled kernels in {directory} are not used, and every process compiles them again, because "
                f"{stranger}, and kernels are run as code: remove the folder, which is then made anew, or set "
                "NUMBA_CACHE_DIR to a folder where nobody else may write"
            )
            return None
        tempfile.TemporaryFile(dir=directory).close()
    except OSError as problem:
        warn_once(
            f"compiled kernels cannot be kept in {root} ({problem.strerror}), and every process compiles them again: "
            "permit writing there, or set NUMBA_CACHE_DIR to a folder that is writable"
        )
        return None
    return directory


def _stranger(directory: Path) -> str | None:
    """Why somebody else than the user and the administrator may have put files into the folder; None if nobody may."""
    if sys.platform == "win32":  # there the folders of a user are private, and file modes have no meaning
        return None
    own = directory.stat()
    if not _owned(own):
        return f"it belongs to user {own.st_uid}"
    if own.st_mode & _WRITABLE:
        return "others may write to it"
    for above in directory.parents:
        mode = above.stat().st_mode
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            return f"everybody may rename what is in {above}"
    entered = own.st_mode & _ENTERED
    with os.scandir(directory) as entries:
        for entry in entries:
            try:
                file = entry.stat(follow_symlinks=False)
            except FileNotFoundError:  # a temporary file that another process has just renamed
                continue
            if not _owned(file):
                return f"{entry.name} in it belongs to user {file.st_uid}"
            if entered and file.st_mode & _WRITABLE and not entry.is_symlink():
                return f"others may write to {entry.name} in it"
    return None


def _owned(file: os.stat_result) -> bool:
    return file.st_uid in (os.geteuid(), 0)


def _of_the_user() -> Path:
    """Numba's folder in the cache directory of the operating system."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"), "numba", "Cache")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "numba"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "numba")


def mark_used(file: Path) -> None:
    """Set the time of a file to now."""
    with suppress(OSError):
        os.utime(file)


@cache
def delete_unused(directory: Path) -> None:
    """Delete, once in a process, kernels that were not used for two months, and temporary files of their writers."""
    oldest = time.time() - _UNUSED
    with suppress(OSError):
        for file in (*directory.glob("*.kernel*"), *directory.glob("*.special")):
            with suppress(OSError):
                if file.stat().st_mtime < oldest:
                    file.unlink()


@cache
def warn_once(text: str) -> None:
    """Warn once in this process; Python's own record of warnings that were shown is reset by numba."""
    warnings.warn(text, RuntimeWarning, stacklevel=2)
