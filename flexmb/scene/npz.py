"""Named arrays from an `.npz` of unknown origin: only real numbers, sizes bounded before anything is unpacked."""

from __future__ import annotations

import math
import zipfile
import zlib
from collections.abc import Collection
from typing import IO

import numpy as np

from flexmb.scene.reading import MIB, Unreadable, allowance, regular_size
from flexmb.typing import Real

REAL = "fiu"
HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
ENCRYPTED = 0x1
ONE_ARRAY = np.lib.format.MAGIC_PREFIX
DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, OverflowError, ValueError)
PACKINGS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def read_arrays(file: str, known: Collection[str]) -> dict[str, Real]:
    """Arrays by name as float64. OSError, or ValueError naming the file, the array, and the remedy.

    Names not `known`, doubled names, objects, text, complex numbers, and sizes that no such file can hold are refused
    from the headers, before anything is unpacked.
    """
    try:
        left = allowance(regular_size(file))
        with open(file, "rb") as stream:
            if stream.read(len(ONE_ARRAY)) == ONE_ARRAY:
                raise Unreadable("it holds one array", "save the arrays by name with numpy.savez")
        found: dict[str, Real] = {}
        with zipfile.ZipFile(file) as archive:
            for member in archive.infolist():
                name = _name(member, known, found)
                with archive.open(member) as stream:
                    found[name] = _read(stream, name, left)
                left -= found[name].nbytes
        return found
    except Unreadable as error:
        raise ValueError(f'"{file}": {error}') from None
    except DAMAGED as error:
        what = f'"{file}" is not an .npz archive of plain arrays ({error})'
        raise ValueError(f"{what}: write it with numpy.savez") from None


def _name(member: zipfile.ZipInfo, known: Collection[str], found: Collection[str]) -> str:
    name = member.filename.removesuffix(".npy")
    if name == member.filename or name not in known:
        raise Unreadable(f'"{name}" is not one of {", ".join(known)}', "rename it or leave it out")
    if name in found:
        raise Unreadable(f'"{name}" is there twice', "keep one of them")
    if member.flag_bits & ENCRYPTED or member.compress_type not in PACKINGS:
        raise Unreadable(f'"{name}" is packed in a way that numpy.savez does not use', "write it with numpy.savez")
    return name


def _read(stream: IO[bytes], name: str, limit: int) -> Real:
    """One array; Unreadable where its header asks for more than `limit` bytes or is not that of real numbers."""
    version = np.lib.format.read_magic(stream)
    if version not in HEADERS:
        raise Unreadable(f'"{name}" has a header of version {version}', "write it with numpy.savez")
    shape, columns_first, dtype = HEADERS[version](stream)
    if dtype.kind not in REAL or dtype.itemsize > 8:
        raise Unreadable(f'"{name}" holds numbers of type {dtype}', "give real numbers in double precision")
    if any(length < 0 for length in shape):
        raise Unreadable(f'"{name}" has the shape {shape}', "write it with numpy.savez")
    count = math.prod(shape)
    if 8 * count > limit:
        needed = f"would take {8 * count / MIB:.0f} MiB of memory" if count < 2**50 else "has an impossible size"
        raise Unreadable(f'"{name}" {needed}, more than a file of this size can hold', f"check its shape {shape}")
    data = stream.read(count * dtype.itemsize + 1)
    if len(data) != count * dtype.itemsize:
        raise Unreadable(f'"{name}" does not hold the numbers that its shape {shape} asks for', "write it anew")
    values = np.frombuffer(data, dtype).reshape(shape, order="F" if columns_first else "C")
    return values.astype(np.float64, order="C")
