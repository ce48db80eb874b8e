"""Safe reading of files of unknown origin: regular files only, of limited size, in UTF-8, not nested too deeply."""

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
TEXT_LIMIT = 16 * MIB  # for text files; tomllib takes some 10 s for this size
# An archive may unpack to FREE bytes plus RATIO times its own size. Only zeros shrink by more (a thousandfold).
FREE, RATIO = 64 * MIB, 40
DEEPEST = 64  # parts of a dotted key; no scene and no run file has more than three
# Comments and strings, whose dots do not belong to keys.
PROSE = re.compile(
    r"""#[^\n]*+|\"{3}(?:[^"\\]|\\.|"{1,2}(?!"))*+\"{3}|'{3}.*?'{3}|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+'""", re.DOTALL
)
MOST_DOTS = 100_000  # in keys: tomllib creates a table for each, which takes 10 us and half a kilobyte
# Matches start at word boundaries only and never backtrack (possessive quantifiers): otherwise the time would grow with
# the square of the length of a word.
DOTTED = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{DEEPEST}}}")
DOT = re.compile(r"""\.(?=[ \t]*+(?:[A-Za-z_"'-]|[\w-]++[ \t]*+[.=\]]))""")


class Unreadable(ValueError):
    """A file with invalid content: `what` is wrong, with the line if it is known, and the `remedy`."""

    def __init__(self, what: str, remedy: str) -> None:
        self.what, self.remedy = what, remedy
        super().__init__(f"{what}: {remedy}")


def regular_size(path: str | os.PathLike[str]) -> int:
    """Size of a regular file in bytes. OSError for anything else: reading a pipe or a device might never end."""
    try:
        status = os.stat(path)
    except ValueError:  # a NUL in the name
        raise OSError(errno.EINVAL, "this cannot be the name of a file", str(path)) from None
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "this is a folder, a pipe or a device: name a regular file", str(path))
    return status.st_size


def read_bytes(path: str | os.PathLike[str], limit: int = TEXT_LIMIT) -> bytes:
    """The content of a regular file of at most `limit` bytes. OSError, or Unreadable."""
    size = regular_size(path)
    if size > limit:
        raise Unreadable(f"its size is {size / MIB:.0f} MiB, and the limit is {limit // MIB} MiB", "divide it")
    return Path(path).read_bytes()


def read_text(path: str | os.PathLike[str], limit: int = TEXT_LIMIT) -> str:
    """Text of a regular file, with any kind of line ends, with or without byte order mark. OSError, or Unreadable."""
    data = read_bytes(path, limit)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        what = f"line {line} is not UTF-8 (byte 0x{data[error.start]:02x})"
        raise Unreadable(what, "save the file as UTF-8") from None
    return io.StringIO(text, newline=None).read()


def parse_toml(text: str) -> dict[str, Any]:
    """TOML as a dict. Raises Unreadable with line and column."""
    if _many_dots(text) and _many_dots(PROSE.sub('""', text)):
        raise Unreadable(f"there are more than {MOST_DOTS} dots in keys", "write arrays of tables, [[name]]")
    if DOTTED.search(text):
        raise Unreadable(f"a key has more than {DEEPEST} parts", "correct it")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        if text.lstrip().startswith("<"):
            remedy = "a robot (URDF, MJCF) becomes a scene by `flexmb import`"
            raise Unreadable("XML, and a scene is TOML", remedy) from None
        raise Unreadable(f"not TOML: {error}", "correct the syntax there") from None
    except RecursionError:
        raise Unreadable("arrays or tables are nested too deeply", "correct the brackets") from None
    except ValueError as error:  # an integer of thousands of digits, a date that does not exist
        raise Unreadable(f"not TOML: {error}", "correct that value") from None


def _many_dots(text: str) -> bool:
    return next(islice(DOT.finditer(text), MOST_DOTS, None), None) is not None


def allowance(size: int) -> int:
    """The number of bytes to which a file of `size` bytes may unpack."""
    return FREE + RATIO * size
