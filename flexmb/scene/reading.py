"""Reading files that somebody else wrote: only regular files, of a sensible size, in UTF-8, not nested too deeply."""

from __future__ import annotations

import errno
import io
import os
import re
import stat
import tomllib
from itertools import islice
from pathlib import Path
from typing import Any

MIB = 2**20
TEXT_LIMIT = 16 * MIB  # of a file that people write; tomllib takes some 10 s for it
# An archive may unpack to this many bytes at most, and to this many times its own size. Zeros shrink a thousandfold,
# but a file of nothing but zeros holds no data.
FREE, RATIO = 64 * MIB, 40
DEEPEST = 64  # parts of a dotted key: no scene and no run file has more than three
# Comments and texts, whose dots are none of keys.
PROSE = re.compile(
    r"""#[^\n]*+|\"{3}(?:[^"\\]|\\.|"{1,2}(?!"))*+\"{3}|'{3}.*?'{3}|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+'""", re.DOTALL
)
MOST_DOTS = 100_000  # in keys: tomllib makes a table for each, which takes 10 us and half a kilobyte
# The search starts only where a word begins and never backtracks (possessive quantifiers): a search from every letter
# of a long word would take a time that grows with the square of its length.
DOTTED = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{DEEPEST}}}")
DOT = re.compile(r"""\.(?=[ \t]*+(?:[A-Za-z_"'-]|[\w-]++[ \t]*+[.=\]]))""")


class Unreadable(ValueError):
    """A file whose content is not what it has to be: `what`, with the line if there is one, and the `remedy`."""

    def __init__(self, what: str, remedy: str) -> None:
        self.what, self.remedy = what, remedy
        super().__init__(f"{what}: {remedy}")


def regular_size(path: str | os.PathLike[str]) -> int:
    """Size of a regular file in bytes. OSError for anything else: reading a pipe or a device might never end."""
    try:
        found = os.stat(path)
    except ValueError:  # a NUL in the name
        raise OSError(errno.EINVAL, "this cannot be the name of a file", str(path)) from None
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "this is no regular file but a folder, a pipe or a device: name a file", str(path))
    return found.st_size


def read_bytes(path: str | os.PathLike[str], limit: int = TEXT_LIMIT) -> bytes:
    """A regular file as it stands, of at most `limit` bytes. OSError, or Unreadable."""
    size = regular_size(path)
    if size > limit:
        raise Unreadable(f"{size / MIB:.0f} MiB are more than such a file may have, {limit // MIB} MiB", "divide it")
    return Path(path).read_bytes()


def read_text(path: str | os.PathLike[str], limit: int = TEXT_LIMIT) -> str:
    """Text of a regular file, with any line ends and with or without a byte order mark. OSError, or Unreadable."""
    data = read_bytes(path, limit)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        what = f"line {line} is not UTF-8 (byte 0x{data[error.start]:02x})"
        raise Unreadable(what, "save the file as UTF-8") from None
    return io.StringIO(text, newline=None).read()


def parse_toml(text: str) -> dict[str, Any]:
    """TOML as a dict. Unreadable names line and column."""
    if _many_dots(text) and _many_dots(PROSE.sub('""', text)):
        raise Unreadable(f"there are more than {MOST_DOTS} dots in keys", "write arrays of tables, [[name]]")
    if DOTTED.search(text):
        raise Unreadable(f"a key has more than {DEEPEST} parts", "correct it")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise Unreadable(f"not TOML: {error}", "correct the syntax there") from None
    except RecursionError:
        raise Unreadable("arrays or tables are nested too deeply", "correct the brackets") from None
    except ValueError as error:  # an integer of thousands of digits, a date that does not exist
        raise Unreadable(f"not TOML: {error}", "correct that value") from None


def _many_dots(text: str) -> bool:
    return next(islice(DOT.finditer(text), MOST_DOTS, None), None) is not None


def allowance(size: int) -> int:
    """How many bytes a file of `size` bytes may unpack to."""
    return FREE + RATIO * size
