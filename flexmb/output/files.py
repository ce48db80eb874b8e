"""Writing files: folders are checked before anything is computed, and errors of the disk name the file.

Each file is written under a temporary name beside its place and renamed at the end: if the process is killed, the disk
is full or writing fails, the previous file remains.

A cell of a CSV file that begins with =, +, - or @ is calculated when a table is opened, quoted or not, and can start
programs. An apostrophe before it makes it a text: writers add one, readers take one away, so that every name is read as
it was.
"""

from __future__ import annotations

import csv
import errno
import os
import re
import secrets
import stat
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_FORMULA = re.compile(r"'*[=+\-@]")


def as_text(name: str) -> str:
    """The cell for a name."""
    return f"'{name}" if _FORMULA.match(name) else name


def from_text(cell: str) -> str:
    """The name in a cell."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


def plain_number(cell: str) -> float:
    """The number in a cell, NaN too; ValueError for what only Python takes for one, such as 1_0 or other digits."""
    word = cell.strip()
    if not NUMBER.fullmatch(word) and word.lower() != "nan":
        raise ValueError(word)
    return float(word)


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
