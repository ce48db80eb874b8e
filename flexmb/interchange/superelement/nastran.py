"""Readers of Nastran's OP4 files in text and in binary form, of DMIG cards of punch files, and of nodes from input
files: GRID cards of Nastran, *NODE of Abaqus and CalculiX.

pyNastran reads binary OP4 files too, but 1.4 requires NumPy 1, and 1.3 cannot be imported with NumPy 2.4.
"""

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


class Nodes(NamedTuple):
    """ids, positions (n,3) m, and the digits of each node's displacements: "" if the file does not say them."""

    ids: list[int]
    position: list[list[float]]
    dofs: list[str]


def grid_nodes(file: str, text: str) -> Nodes:
    """Nodes of the GRID cards, in the basic system. SuperElementError with file, line and remedy."""
    nodes = Nodes([], [], [])
    for number, fields in cards(text, "GRID"):
        fields = [*fields, *[""] * 7][:7]
        if any(word not in ("", "0", "-1") for word in (fields[2], fields[6])):
            raise SuperElementError(
                f"{file}, line {number}: node {fields[1]} is in another coordinate system: write nodes and their "
                "displacements in the basic one (fields 3 and 7 of GRID)"
            )
        try:
            _add(nodes, number_of_node(fields[1]), [real(word) if word else 0.0 for word in fields[3:6]])
        except ValueError:
            raise SuperElementError(f"{file}, line {number}: GRID needs a number and three coordinates") from None
    return nodes


def inp_nodes(file: str, text: str) -> Nodes:
    """Nodes of *NODE in a flat input file. SuperElementError with file, line and remedy."""
    found, inside = Nodes([], [], []), False
    for number, line in enumerate(text.split("\n"), 1):
        if line.startswith("**") or not line.strip():
            continue
        if line.startswith("*"):
            keyword, *options = (word.strip().upper() for word in line.split(","))
            inside = keyword == "*NODE"
            if keyword in ("*INSTANCE", "*SYSTEM") or (inside and any(word.startswith("SYSTEM") for word in options)):
                raise SuperElementError(
                    f"{file}, line {number}: {keyword} moves nodes: write a flat input file, without parts and "
                    "instances, with nodes in the global system"
                )
        elif inside:
            words = [word.strip() for word in line.split(",")]
            try:
                place = [real(word) if word else 0.0 for word in (*words[1:4], "", "", "")][:3]
                _add(found, number_of_node(words[0]), place)
            except ValueError:
                raise SuperElementError(f"{file}, line {number}: a node is number, x, y, z: correct it") from None
    return found


def number_of_node(word: str) -> int:
    """A node number; ValueError unless it is an integer of 64 bits."""
    number = int(word)
    if not -(2**63) <= number < 2**63:
        raise ValueError(f"{word:.40} is too large")
    return number


def _add(found: Nodes, number: int, position: list[float]) -> None:
    if not all(map(usable, position)):
        raise ValueError(f"a coordinate is beyond {MAGNITUDE:g}")
    found.ids.append(number)
    found.position.append(position)
    found.dofs.append("")
