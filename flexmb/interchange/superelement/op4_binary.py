"""Reader of Nastran's OP4 files in binary form.

pyNastran reads them too, but 1.4 requires NumPy 1, and 1.3 cannot be imported with NumPy 2.4.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flexmb.interchange.imported import MAGNITUDE
from flexmb.interchange.superelement.element import SuperElementError
from flexmb.interchange.superelement.nastran import LARGEST, REAL_TYPES, STRING, NamedMatrix
from flexmb.typing import Real

HEADERS = {24: 4, 48: 8}  # length of a header: bytes of a word


class Form(NamedTuple):
    """Byte order, "<" or ">", and bytes of a word."""

    order: str
    word: int

    def whole(self, data: bytes) -> list[int]:
        return [int(number) for number in np.frombuffer(data, f"{self.order}i{self.word}")]


def is_binary_op4(data: bytes) -> bool:
    """Whether the file begins with the length of a header."""
    return _form(data) is not None


def binary_op4_matrices(file: str, data: bytes) -> list[NamedMatrix]:
    """All matrices of a file, dense or sparse. SuperElementError with file, place and remedy."""
    form = _form(data)
    if form is None:
        raise SuperElementError(f"{file}: this is not an OP4 file: write it again")
    records, found = _records(file, data, form), []
    for at, header in records:
        if len(header) not in HEADERS:
            raise _damaged(file, at)
        columns, rows, _, kind = form.whole(header[: 4 * form.word])
        name = header[4 * form.word :].decode("latin-1").strip()
        if kind not in REAL_TYPES or columns != abs(rows) or not 0 < columns <= LARGEST:
            what = f"matrix {name} is {abs(rows)} x {columns} of type {kind}"
            raise SuperElementError(f"{file}: {what}: give real square matrices of at most {LARGEST} rows")
        found.append(NamedMatrix(name, _matrix(file, records, form, columns, kind, big=rows < 0), None))
    return found


def _form(data: bytes) -> Form | None:
    for order in "<>":
        length = int(np.frombuffer(data[:4].ljust(4, b"\0"), f"{order}i4")[0])
        if length in HEADERS:
            return Form(order, HEADERS[length])
    return None


def _records(file: str, data: bytes, form: Form) -> Iterator[tuple[int, bytes]]:
    """Fortran's records with their places: each stands between its length and its length again."""
    at = 0
    while at < len(data):
        length = int(np.frombuffer(data[at : at + 4].ljust(4, b"\xff"), f"{form.order}i4")[0])
        end = at + 4 + length
        if length < 0 or data[at : at + 4] != data[end : end + 4]:
            raise _damaged(file, at)
        yield at, data[at + 4 : end]
        at = end + 4


def _matrix(file: str, records: Iterator[tuple[int, bytes]], form: Form, size: int, kind: int, *, big: bool) -> Real:
    """The columns that follow a header, up to the one after the last."""
    matrix = np.zeros((size, size))
    for at, record in records:
        head, rest = record[: 3 * form.word], record[3 * form.word :]
        if len(head) < 3 * form.word:
            raise _damaged(file, at)
        column, row, _ = form.whole(head)
        if column == size + 1:
            return matrix
        if not 1 <= column <= size:
            raise _damaged(file, at)
        for first, values in [(row, rest)] if row else _strings(file, at, rest, form, big):
            _put(file, at, matrix[:, column - 1], first, values, f"{form.order}f{max(form.word, 4 * kind)}")
    raise SuperElementError(f"{file}: a matrix has no end (column {size + 1}): the file is cut off")


def _strings(file: str, at: int, data: bytes, form: Form, big: bool) -> Iterator[tuple[int, bytes]]:
    """First row and values of each string of a sparse column."""
    heads = 2 if big else 1
    while data:
        head = form.whole(data[: heads * form.word]) if len(data) >= heads * form.word else [0, 0]
        words, row = (head[0] - 1, head[1]) if big else (head[0] // STRING - 1, head[0] % STRING)
        end = (heads + words) * form.word
        if words < 1 or end > len(data):
            raise _damaged(file, at)
        yield row, data[heads * form.word : end]
        data = data[end:]


def _put(file: str, at: int, column: Real, first: int, data: bytes, dtype: str) -> None:
    if len(data) % np.dtype(dtype).itemsize or first < 1:
        raise _damaged(file, at)
    values = np.frombuffer(data, dtype).astype(float)
    if first - 1 + len(values) > len(column) or not np.all(np.abs(values) <= MAGNITUDE):
        raise _damaged(file, at)
    column[first - 1 : first - 1 + len(values)] = values


def _damaged(file: str, at: int) -> SuperElementError:
    return SuperElementError(
        f"{file}, byte {at}: this is not the record of a matrix of finite numbers that belongs here: the file is "
        "damaged, write it again"
    )
