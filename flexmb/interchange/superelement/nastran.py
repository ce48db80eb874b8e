"""Readers of Nastran's OP4 files in text form and of DMIG cards of punch files."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flexmb.interchange.imported import MAGNITUDE, usable
from flexmb.interchange.superelement.element import SuperElementError
from flexmb.typing import Real

LARGEST = 8_000  # rows
REAL_TYPES = (1, 2)  # single and double precision
INTEGER = 8  # characters of an integer in OP4
STRING = 65536  # of a short string header: (words + 1) * STRING + first row
SYMMETRIC = 6
FIELDS = {False: (8, 8), True: (8, 16)}  # of a card: characters of the first field, and of the others


Row = tuple[int, int]
"""Node and displacement, 1 to 6."""


class NamedMatrix(NamedTuple):
    """A matrix (N,N), and what its rows are, if the file says it; `open_end`: last rows without elements may lack."""

    name: str
    matrix: Real
    rows: list[Row] | None
    open_end: bool = False


def op4_matrices(file: str, text: str) -> list[NamedMatrix]:
    """All matrices of an OP4 file, dense or sparse. SuperElementError names the line."""
    lines, found = text.split("\n"), []
    at = 0
    while at < len(lines):
        if not lines[at].strip():
            at += 1
            continue
        matrix, at = _op4(file, lines, at)
        found.append(matrix)
    return found


def _op4(file: str, lines: list[str], at: int) -> tuple[NamedMatrix, int]:
    """The matrix whose header is line `at`, and the number of the line after it.

    Lines without a decimal point contain integers: three begin a column (number, first row or 0, words), one or two
    begin a string of a sparse column.
    """
    header = lines[at]
    try:
        columns, rows, _, kind = (int(header[INTEGER * i : INTEGER * (i + 1)]) for i in range(4))
        name = header[4 * INTEGER : 5 * INTEGER].strip()
        width = int(re.search(r"\d[EeDd](\d+)\.", header[5 * INTEGER :])[1])  # type: ignore[index]
    except (ValueError, TypeError):
        raise SuperElementError(f"{file}, line {at + 1}: this is not the header of an OP4 text matrix") from None
    rows = abs(rows)
    if kind not in REAL_TYPES or columns != rows or not 0 < rows <= LARGEST:
        what = f"matrix {name} is {rows} x {columns} of type {kind}"
        raise SuperElementError(f"{file}, line {at + 1}: {what}: give real square matrices of at most {LARGEST} rows")
    matrix = np.zeros((rows, columns))
    column = row = 0
    for number in range(at + 1, len(lines)):
        line = lines[number]
        try:
            if "." in line:
                values = [real(line[i : i + width]) for i in range(0, len(line.rstrip()), width)]
                if not (0 <= column < columns and row >= 0 and row + len(values) <= rows):
                    raise ValueError("an element outside of the matrix")
                matrix[row : row + len(values), column] = values
                row += len(values)
                continue
            whole = [int(line[i : i + INTEGER]) for i in range(0, len(line.rstrip()), INTEGER)]
        except ValueError as error:
            raise SuperElementError(f"{file}, line {number + 1}: {error}: a damaged file, write it again") from None
        if len(whole) == 3:
            column, row = whole[0] - 1, whole[1] - 1
            if column == columns:
                return NamedMatrix(name, matrix, None), number + (
                    2 if "." in "".join(lines[number + 1 : number + 2]) else 1
                )
        elif len(whole) == 2:
            row = whole[1] - 1
        elif len(whole) == 1:
            row = whole[0] % STRING - 1
    raise SuperElementError(f"{file}: matrix {name} has no end (column {columns + 1}): the file is cut off")


def dmig_matrices(file: str, text: str) -> list[NamedMatrix]:
    """All real square matrices of the DMIG cards of a file, with fields of 8 or 16 characters, or with commas."""
    forms: dict[str, int] = {}
    elements: dict[str, dict[tuple[Row, Row], float]] = {}
    for number, fields in cards(text, "DMIG"):
        try:
            name = fields[1]
            if fields[2] == "0":
                if int(fields[4]) not in REAL_TYPES:
                    raise ValueError(f"matrix {name} is complex")
                forms[name], elements[name] = int(fields[3]), {}
                continue
            column = (int(fields[2]), int(fields[3]))
            for i in range(5, len(fields) - 2, 4):
                if fields[i]:
                    row = (int(fields[i]), int(fields[i + 1] or 0))
                    elements[name][row, column] = real(fields[i + 2])
            if any(not 1 <= component <= 6 for row, _ in elements[name] for component in (row[1], column[1])):
                raise ValueError(f"matrix {name} has rows of scalar points")
        except (ValueError, IndexError, KeyError) as error:
            what = error if isinstance(error, ValueError) else "the card is not complete, or its header is missing"
            raise SuperElementError(f"{file}, line {number}: {what}: give real matrices of grid points") from None
    return [assembled(file, name, found, forms[name] == SYMMETRIC) for name, found in elements.items()]


def assembled(file: str, name: str, elements: dict[tuple[Row, Row], float], symmetric: bool) -> NamedMatrix:
    """The matrix of elements by rows and columns; of a `symmetric` one, one half may be given."""
    rows = sorted({place for pair in elements for place in pair})
    if len(rows) > LARGEST:
        raise SuperElementError(f"{file}: matrix {name} has {len(rows)} rows, more than {LARGEST}: reduce it before")
    at = {row: i for i, row in enumerate(rows)}
    matrix = np.zeros((len(rows), len(rows)))
    for (row, column), value in elements.items():
        matrix[at[row], at[column]] = value
        if symmetric:
            matrix[at[column], at[row]] = value
    return NamedMatrix(name, matrix, rows)


def cards(text: str, name: str) -> Iterator[tuple[int, list[str]]]:
    """Cards of this name: the number of the first line, and the fields including those of continuation lines.

    Field 0 is the name. From field 5 of a DMIG on, each element has four: node, displacement, real, imaginary.
    """
    begun = 0
    card: list[str] = []
    for number, raw in enumerate(text.split("\n"), 1):
        line = raw.split("$")[0].rstrip()
        if not line:
            continue
        fields = _fields(line)
        if fields[0].upper().rstrip("*") == name:
            if card:
                yield begun, card
            begun, card = number, fields
        elif card and line[0] in "*+ ,":
            card += fields[1:]
        elif card:
            yield begun, card
            card = []
    if card:
        yield begun, card


def _fields(line: str) -> list[str]:
    """The fields of a line: after the first, four of 16 or eight of 8 characters; or separated by commas."""
    if "," in line:
        return [word.strip() for word in line.split(",")]
    first, width = FIELDS["*" in line[:8]]
    count = 4 if width == 16 else 8
    return [line[:first].strip(), *(line[first + i * width : first + (i + 1) * width].strip() for i in range(count))]


def real(word: str) -> float:
    """A Fortran number: 1.5, 1.5D+3, 1.5+3. ValueError if it is not one, or not finite."""
    text = re.sub(r"(?<=[\d.])([+-]\d+)$", r"E\1", word.strip().upper().replace("D", "E"))
    value = float(text)
    if not usable(value):
        raise ValueError(f"{word.strip()} is not finite, or beyond {MAGNITUDE:g}")
    return value
