"""Safe reading of files of unknown origin: regular files only, of limited size, in UTF-8, not nested too deeply; of an
`.npz` file only known arrays, whose sizes are checked before unpacking.
"""

from __future__ import annotations

import errno
import io
import math
import os
import re
import stat
import tomllib
import zipfile
import zlib
from collections.abc import Collection, Mapping
from itertools import islice
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from flexmb.typing import Real

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


REAL, BOOLEAN, TEXT = "fiu", "b", "U"  # kinds of NumPy's types
WORD = 256  # largest size of a text in bytes
HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
ENCRYPTED = 0x1
ONE_ARRAY, ARCHIVE = np.lib.format.MAGIC_PREFIX, b"PK"  # first bytes of an .npy file and of a zip archive
DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, OverflowError, ValueError)
NO_TABLE = "it is not a whole .npz archive of plain arrays: its table of contents is damaged or cut off"
PACKINGS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def read_arrays(file: str, known: Collection[str]) -> dict[str, Real]:
    """Arrays by name as float64. Raises OSError, or ValueError with the file, the array and the remedy.

    Unknown and repeated names, objects, text, complex numbers, and sizes that a file of this size cannot contain are
    refused on the basis of the headers, before anything is unpacked.
    """
    try:
        arrays = unpacked(file, dict.fromkeys(known, REAL))
    except Unreadable as error:
        raise ValueError(f'"{file}": {error}') from None
    return {name: values.astype(np.float64, order="C") for name, values in arrays.items()}


def unpacked(file: str | os.PathLike[str], kinds: Mapping[str, str]) -> dict[str, NDArray[Any]]:
    """Arrays by name, each of the given kinds of types. Raises OSError, or Unreadable as in `read_arrays`."""
    try:
        left = allowance(regular_size(file))
        with open(file, "rb") as stream:
            begin = stream.read(len(ONE_ARRAY))
        if begin == ONE_ARRAY:
            raise Unreadable("it holds one array", "save the arrays by name with numpy.savez")
        if not begin.startswith(ARCHIVE):  # zip readers start from the end of a file and accept any prefix
            raise Unreadable("it does not begin as an .npz archive", "write it with numpy.savez")
        arrays: dict[str, NDArray[Any]] = {}
        with zipfile.ZipFile(file) as archive:
            for member in archive.infolist():
                name = _name(member, kinds, arrays)
                arrays[name] = _member(archive, member, name, left, kinds[name])
                left -= max(8, arrays[name].itemsize) * arrays[name].size
        return arrays
    except Unreadable:
        raise
    except OSError as error:
        if error.filename is not None:
            raise
        # A damaged table of contents can refer to a position before the start of the file.
        raise Unreadable(NO_TABLE, "write the file again with numpy.savez") from None
    except DAMAGED:
        raise Unreadable(NO_TABLE, "write the file again with numpy.savez") from None


def _member(archive: zipfile.ZipFile, member: zipfile.ZipInfo, name: str, limit: int, kinds: str) -> NDArray[Any]:
    """One array of an archive; Unreadable tells which one is damaged, and not what the unpacking library says."""
    try:
        with archive.open(member) as stream:
            return _read(stream, name, limit, kinds)
    except Unreadable:
        raise
    except (*DAMAGED, OSError):
        raise Unreadable(f'"{name}" is damaged: its bytes were changed or cut off', "write the file again") from None


def _name(member: zipfile.ZipInfo, known: Collection[str], found: Collection[str]) -> str:
    name = member.filename.removesuffix(".npy")
    if name == member.filename or name not in known:
        raise Unreadable(f'"{name}" is not one of {", ".join(known)}', "rename it or leave it out")
    if name in found:
        raise Unreadable(f'"{name}" is there twice', "keep one of them")
    if member.flag_bits & ENCRYPTED or member.compress_type not in PACKINGS:
        raise Unreadable(f'"{name}" is packed in a way that numpy.savez does not use', "write it with numpy.savez")
    return name


def _read(stream: IO[bytes], name: str, limit: int, kinds: str) -> NDArray[Any]:
    """One array; Unreadable if its header specifies more than `limit` bytes or another kind of type."""
    version = np.lib.format.read_magic(stream)
    if version not in HEADERS:
        raise Unreadable(f'"{name}" has a header of version {version}', "write it with numpy.savez")
    shape, columns_first, dtype = HEADERS[version](stream)
    if dtype.kind not in kinds or dtype.itemsize > (WORD if dtype.kind == TEXT else 8):
        wanted = "a short text" if kinds == TEXT else "real numbers in double precision"
        raise Unreadable(f'"{name}" holds numbers of type {dtype}', f"give {wanted}")
    if any(length < 0 for length in shape):
        raise Unreadable(f'"{name}" has the shape {shape}', "write it with numpy.savez")
    count, size = math.prod(shape), max(8, dtype.itemsize)
    if size * count > limit:
        needed = f"would take {size * count / MIB:.0f} MiB of memory" if count < 2**50 else "has an impossible size"
        raise Unreadable(f'"{name}" {needed}, more than a file of this size can hold', f"check its shape {shape}")
    data = stream.read(count * dtype.itemsize + 1)
    if len(data) != count * dtype.itemsize:
        raise Unreadable(f'"{name}" does not have the numbers that its shape {shape} needs', "write it again")
    return np.frombuffer(data, dtype).reshape(shape, order="F" if columns_first else "C")
