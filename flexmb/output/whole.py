"""Files that appear whole or not at all: each is written beside its place and put there at the end.

A process that is killed, and a disk that is full, leave what was there before. So does an error while writing.
"""

from __future__ import annotations

import errno
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PART = ".part-"  # how the names of unfinished files begin
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # the disk, what a user may have of it, what a file may be
REMEDY = "it was not written; free some space, or write elsewhere"


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path beside `path`, of the same ending, to be written by the caller; at the end it takes the place of `path`.

    A link is followed; what is no file, such as a pipe or `/dev/stdout`, is written to as it is. A file that is there
    keeps its permissions. OSError names `path`, whatever failed.
    """
    place = path.resolve() if path.is_symlink() else path
    beside = place.with_name(f"{PART}{secrets.token_hex(6)}{place.suffix}")
    try:
        if _is_stream(path):
            yield path
            return
        mode = _mode(place)
        try:
            yield beside
            _settle(beside, mode)
            os.replace(beside, place)
        finally:
            beside.unlink(missing_ok=True)
    except OSError as error:
        if error.filename not in (None, str(beside), str(path)):  # another file's, which this one waits for
            raise
        why = error.strerror or str(error)
        remedy = f": {REMEDY}" if error.errno in FULL and REMEDY not in why else ""
        raise OSError(error.errno, why + remedy, str(path)) from None


def write_whole(path: Path, content: str | bytes) -> None:
    """Put a text (UTF-8, line ends as they are) or bytes into a file, whole or not at all."""
    with whole_file(path) as beside:
        beside.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


def save_figure(figure: Figure, path: Path, **settings: Any) -> Path:
    """Write a picture, as PNG where `path` has no ending; returns where it is. `settings` are those of `savefig`."""
    path = path if path.suffix else path.with_name(f"{path.name}.png")
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as beside:
        figure.savefig(beside, **settings)
    return path


def take_away(path: Path) -> None:
    """Remove what an earlier command has left, before a new one begins: were it killed, the old would pass for its own.

    What is no file, such as `/dev/stdout`, stays.
    """
    if path.is_file() and not _is_stream(path):
        path.unlink()


def clear_parts(folder: Path) -> None:
    """Remove what processes that were killed while they wrote have left in a folder; nobody may write there now."""
    for part in folder.glob(f"{PART}*"):
        part.unlink(missing_ok=True)


def _is_stream(path: Path) -> bool:
    return path.is_absolute() and path.parts[1:2] in (("dev",), ("proc",)) or (
        path.exists() and not path.is_file() and not path.is_dir()
    )


def _mode(place: Path) -> int | None:
    """Permissions of the file that is there, None where there is none; OSError where it must stay as it is."""
    if place.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not place.exists():
        return None
    if not os.access(place, os.W_OK):  # to take its place would be to ignore that
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    return stat.S_IMODE(place.stat().st_mode)


def _settle(file: Path, mode: int | None) -> None:
    """Have the content on the disk before the name: after a loss of power there would be an empty file."""
    with file.open("rb") as stream:
        os.fsync(stream.fileno())
    if mode is not None:
        file.chmod(mode)
