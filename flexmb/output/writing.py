"""Writing results: folders are checked before anything is computed, and errors of the disk name the file."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def check_folder(path: Path) -> None:
    """OSError, with the remedy, unless `path` is a writable folder or can be created; it is not created here."""
    above = next(folder for folder in (path, *path.absolute().parents) if os.path.lexists(folder))
    if not above.is_dir():
        raise OSError(errno.ENOTDIR, "this is not a folder, so no folder can be made in it: name another", str(above))
    if not os.access(above, os.W_OK | os.X_OK):
        raise OSError(errno.EACCES, "this folder cannot be written to: name another", str(above))


def folder(path: Path) -> Path:
    """`path` as a writable folder, created if necessary. An OSError says what prevents it, and the remedy."""
    check_folder(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OSError(error.errno, f"this folder cannot be made ({error.strerror}): name another", str(path)) from None
    return path


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Let an OSError of writing a file name it; that of a full disk by itself does not."""
    try:
        yield
    except OSError as error:
        what = f"{error.strerror}: the file is incomplete; free some space, or write elsewhere"
        raise OSError(error.errno, what if error.errno == errno.ENOSPC else error.strerror, str(path)) from None


def in_words(error: OSError) -> str:
    """An OSError as one line without its number: the file, and what is wrong."""
    return f"{error.filename}: {error.strerror}" if error.filename is not None else error.strerror or str(error)
