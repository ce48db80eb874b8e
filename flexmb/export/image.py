"""The tables of a system as one block of memory, which every instance of an exported model has a copy of.

A bundle is a table of addresses and shapes (`flexmb.jit.bundle`). In the block, addresses are offsets from its
beginning, to which an instance adds where its copy lies. Arrays that are zero come last and are not stored.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexmb.typing import Index, Real

APART = 64  # bytes: rows of strips are read in wholes of so many
ROW = 8  # bytes of a word


@dataclass(frozen=True)
class Image:
    """A block of memory.

    words (B,): its contents as numbers of 64 bits, read as floats; stored: how many of them are not known to be zero.
    addresses (A,2): words that hold addresses, and the offsets (bytes) that these have. bundles: offset of each
    bundle's table. arrays: offset and size (bytes) of each array, by bundle and name. Bundles are those that are given,
    then those that are members of others, in the order of `flattened`.
    """

    words: Real
    stored: int
    addresses: Index
    bundles: tuple[int, ...]
    arrays: dict[tuple[int, str], tuple[int, int]]

    def word(self, bundle: int, name: str) -> int:
        """The first word of an array."""
        return self.arrays[bundle, name][0] // ROW


class _Piece:
    """Memory that arrays share, from the first to the last byte that one of them uses."""

    def __init__(self, start: int, stop: int) -> None:
        self.start, self.stop = start, stop
        self.content: NDArray[np.uint8] = np.zeros(0, np.uint8)
        self.place = 0


def image(bundles: Sequence[Any], like: Image | None = None) -> Image:
    """The block of these bundles and their members; with the arrangement of another one if it is given."""
    bundles = flattened(bundles)
    owners = dict[int, _Piece]()
    for _, _, array in _arrays(bundles):
        key, start = id(_owner(array)), array.ctypes.data
        piece = owners.setdefault(key, _Piece(start, start))
        piece.start, piece.stop = min(piece.start, start), max(piece.stop, start + array.nbytes)
    for _, _, array in _arrays(bundles):
        piece = owners[id(_owner(array))]
        if not len(piece.content):
            piece.content = np.zeros(piece.stop - piece.start, np.uint8)
        at = array.ctypes.data - piece.start
        piece.content[at : at + array.nbytes] = np.frombuffer(array.tobytes(), np.uint8)
    tables, end = list[int](), 0
    for bundle in bundles:
        tables.append(end)
        end += _rounded(bundle.kernel_table.nbytes)
    pieces = list(owners.values())
    if like is None:
        full = [piece for piece in pieces if np.any(piece.content)]
        for piece in full:
            piece.place, end = end, end + _rounded(len(piece.content))
        stored = end
        for piece in pieces:
            if piece not in full:
                piece.place, end = end, end + _rounded(len(piece.content))
    else:
        places = {name: where for name, (where, _) in like.arrays.items()}
        for number, name, array in _arrays(bundles):
            piece = owners[id(_owner(array))]
            piece.place = places[number, name] - (array.ctypes.data - piece.start)
        end, stored = ROW * len(like.words), ROW * like.stored
    block, addresses, arrays = (
        np.zeros(end, np.uint8),
        list[tuple[int, int]](),
        dict[tuple[int, str], tuple[int, int]](),
    )
    for piece in pieces:
        block[piece.place : piece.place + len(piece.content)] = piece.content
    words = block.view(np.int64)
    for bundle, table in zip(bundles, tables, strict=True):
        rows = bundle.kernel_table.copy()
        rows[..., :1] = 0
        words[table // ROW : table // ROW + rows.size] = rows.ravel()
    for number, name, array in _arrays(bundles):
        piece = owners[id(_owner(array))]
        at = piece.place + array.ctypes.data - piece.start
        addresses.append((tables[number] // ROW + _address_of(bundles[number], name), at))
        arrays[number, name] = at, array.nbytes
    for bundle, table in zip(bundles, tables, strict=True):
        for name, member in _members(bundle):
            addresses.append((table // ROW + _address_of(bundle, name), tables[number_of(bundles, member)]))
    return Image(block.view(np.float64), stored // ROW, np.array(addresses), tuple(tables), arrays)


def flattened(bundles: Sequence[Any]) -> list[Any]:
    """These bundles, then their members that are bundles, and the members of those; each once."""
    found = list(bundles)
    for bundle in found:
        known = {each.kernel_address for each in found}
        found += [member for _, member in _members(bundle) if member.kernel_address not in known]
    return found


def number_of(bundles: Sequence[Any], bundle: Any) -> int:
    """The number of a bundle among those of an image."""
    return [each.kernel_address for each in flattened(bundles)].index(bundle.kernel_address)


def _members(bundle: Any) -> Iterator[tuple[str, Any]]:
    """The members of a bundle that are bundles, by name."""
    for field in fields(bundle):
        member = getattr(bundle, field.name)
        if not isinstance(member, np.ndarray):
            yield field.name, member


def _address_of(bundle: Any, name: str) -> int:
    """The word in a bundle's table that holds the address of a member."""
    row = [field.name for field in fields(bundle)].index(name)
    return int(row * bundle.kernel_table.shape[1])


def _arrays(bundles: Sequence[Any]) -> Iterator[tuple[int, str, Any]]:
    """(number of the bundle, name, array) of every array that is not empty."""
    for number, bundle in enumerate(bundles):
        for field in fields(bundle):
            array = getattr(bundle, field.name)
            if isinstance(array, np.ndarray) and array.size:
                yield number, field.name, array


def _owner(array: Any) -> Any:
    while isinstance(array.base, np.ndarray):
        array = array.base
    return array


def _rounded(size: int) -> int:
    return -(-size // APART) * APART
