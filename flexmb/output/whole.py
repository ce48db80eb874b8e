"""Atomic writing of files: each is written under a temporary name beside its place and renamed at the end.

If the process is killed, the disk is full or writing fails, the previous file remains.
"""

from __future__ import annotations

import csv
import errno
import os
import secrets
import stat
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexmb.output.csv_cells import as_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PART = ".part-"  # prefix of temporary names
_NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # disk full, quota exceeded, file too large
REMEDY = "it was not written; free some space, or write elsewhere"


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path beside `path`, with the same suffix, for the caller to write; at the end it is renamed to `path`.

    Links are followed. Anything but a regular file, such as a pipe or `/dev/stdout`, is written directly. An existing
    file keeps its permissions. An OSError names `path`, whatever failed.
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
        if error.filename not in (None, str(beside), str(path)):  # the caller's error, about another file
            raise
        why = error.strerror or str(error)
        remedy = f": {REMEDY}" if error.errno in _NO_SPACE and REMEDY not in why else ""
        raise OSError(error.errno, why + remedy, str(path)) from None


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a text (UTF-8, line ends unchanged) or bytes to a file atomically."""
    with whole_file(path) as beside:
        beside.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Iterable[float | str]]) -> None:
    """Write a table of numbers, or names, as CSV; numbers with 17 digits, which are read back exactly; names are no
    formulas."""
    with whole_file(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(map(as_text, header))
        writer.writerows([as_text(cell) if isinstance(cell, str) else f"{cell:.17g}" for cell in row] for row in rows)


def save_figure(figure: Figure, path: Path, **settings: Any) -> Path:
    """Write a picture, as PNG if `path` has no suffix; returns its path. `settings` are those of `savefig`."""
    path = path if path.suffix else path.with_name(f"{path.name}.png")
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as beside:
        figure.savefig(beside, **settings)
    return path


def take_away(path: Path) -> None:
    """Remove the result of an earlier command before a new one begins: if that is killed, no old result remains.

    Anything but a regular file, such as `/dev/stdout`, is left alone.
    """
    if path.is_file() and not _is_stream(path):
        path.unlink()


def clear_parts(folder: Path) -> None:
    """Remove the temporary files of killed processes from a folder, to which no process may be writing."""
    for part in folder.glob(f"{PART}*"):
        part.unlink(missing_ok=True)


def _is_stream(path: Path) -> bool:
    return path.is_absolute() and path.parts[1:2] in (("dev",), ("proc",)) or (
        path.exists() and not path.is_file() and not path.is_dir()
    )


def _mode(place: Path) -> int | None:
    """Permissions of an existing file, None if there is none; OSError for a folder or a file that is read-only."""
    if place.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not place.exists():
        return None
    if not os.access(place, os.W_OK):  # renaming would replace it all the same
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    return stat.S_IMODE(place.stat().st_mode)


def _settle(file: Path, mode: int | None) -> None:
    """Flush the content to the disk before renaming: otherwise a power failure could leave an empty file."""
    with file.open("rb") as stream:
        os.fsync(stream.fileno())
    if mode is not None:
        file.chmod(mode)
