"""Writing results: a folder is checked before anything is computed, and an error of the disk names the file."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def check_folder(path: Path) -> None:
    """OSError, with the remedy, unless `path` is a folder that can be written to or can be made; it is not made."""
    above = next(each for each in (path, *path.absolute().parents) if os.path.lexists(each))
    if not above.is_dir():
        raise OSError(errno.ENOTDIR, "this is no folder but is in the way of one: name another", str(above))
    if not os.access(above, os.W_OK | os.X_OK):
        raise OSError(errno.EACCES, "this folder cannot be written to: name another", str(above))


def folder(path: Path) -> Path:
    """`path` as a folder that can be written to, made if need be. OSError says what is in the way, and the remedy."""
    check_folder(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OSError(error.errno, f"this folder cannot be made ({error.strerror}): name another", str(path)) from None
    return path


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Errors of writing a file name it: those of a full disk do not by themselves."""
    try:
        yield
    except OSError as error:
        what = f"{error.strerror}: what is there is incomplete; free some space, or write elsewhere"
        raise OSError(error.errno, what if error.errno == errno.ENOSPC else error.strerror, str(path)) from None


def in_words(error: OSError) -> str:
    """An OSError as one line without numbers: the file, and what is wrong."""
    return f"{error.filename}: {error.strerror}" if error.filename is not None else error.strerror or str(error)
