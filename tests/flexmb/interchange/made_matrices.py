"""Files of the matrices of finite-element codes, as those write them."""

from __future__ import annotations

import struct
from typing import Literal

import numpy as np

COMPONENTS = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")


def places(dofs: int, count: int) -> list[tuple[int, int]]:
    return [(node, component) for node in range(1, count // dofs + 1) for component in range(1, dofs + 1)]


def coordinate(matrix: np.ndarray) -> str:
    """Abaqus, FORMAT=COORDINATE: both halves."""
    return "".join(f"{i + 1} {j + 1} {matrix[i, j]:.17e}\n" for i, j in np.argwhere(matrix))


def matrix_input(matrix: np.ndarray) -> str:
    """Abaqus, FORMAT=MATRIX INPUT: one half, by node and displacement, with a comment."""
    row = places(6, len(matrix))
    return "** Assembled nodal matrix\n" + "".join(
        f"{row[i][0]},{row[i][1]}, {row[j][0]},{row[j][1]}, {matrix[i, j]:.17e}\n"
        for i, j in np.argwhere(np.tril(matrix))
    )


def calculix(matrix: np.ndarray) -> str:
    """The upper half by columns, zeros too."""
    return "".join(
        f"{i + 1} {j + 1}  {matrix[i, j]:.17e}\n" for j in range(len(matrix)) for i in range(j + 1)
    )


def dof(count: int) -> str:
    return "".join(f"{node}.{component}\n" for node, component in places(6, count))


def mapping(count: int) -> str:
    """Ansys: the equation, the node, the displacement."""
    lines = (f"{i:11d}{node:10d}     {COMPONENTS[c - 1]}\n" for i, (node, c) in enumerate(places(6, count), 1))
    return " Matrix Eqn      Node    DOF\n" + "".join(lines)


def binary_op4(
    matrices: dict[str, np.ndarray], form: Literal["dense", "sparse", "big"] = "dense", order: str = "<",
    word: int = 4,
) -> bytes:  # fmt: skip
    """Fortran's records: a header, a column each, and one column beyond the last."""
    whole, name_length = ("i", 8) if word == 4 else ("q", 16)

    def record(data: bytes) -> bytes:
        return struct.pack(f"{order}i", len(data)) + data + struct.pack(f"{order}i", len(data))

    def numbers(*values: int) -> bytes:
        return struct.pack(f"{order}{len(values)}{whole}", *values)

    def values(given: np.ndarray) -> bytes:
        return given.astype(f"{order}f8").tobytes()

    found = b""
    for name, matrix in matrices.items():
        n = len(matrix)
        found += record(numbers(n, -n if form == "big" else n, 6, 2) + name.encode().ljust(name_length))
        for j in range(n):
            rows = np.flatnonzero(matrix[:, j])
            if not len(rows):
                continue
            if form == "dense":
                data = values(matrix[rows[0] : rows[-1] + 1, j])
                found += record(numbers(j + 1, int(rows[0]) + 1, len(data) // word) + data)
                continue
            data = b""
            for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
                part, first = values(matrix[run, j]), int(run[0]) + 1
                words = len(part) // word + 1
                data += (numbers(words, first) if form == "big" else numbers(words * 65536 + first)) + part
            found += record(numbers(j + 1, 0, len(data) // word) + data)
        found += record(numbers(n + 1, 1, 8 // word) + values(np.ones(1)))
    return found
