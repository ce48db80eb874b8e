"""Readers of matrices: Matrix Market, and rows, columns and values of their elements of CalculiX and of Abaqus' *MATRIX
OUTPUT.

SciPy's reader of Matrix Market files crashes, or never returns, for some damaged ones. CalculiX writes one half to
`.sti` and `.mas`, and the node and displacement of each row to `.dof`. Abaqus' form COORDINATE has rows in the order of
the numbers of nodes; its form MATRIX INPUT names node and displacement of both, and writes one half.
"""

from __future__ import annotations

import warnings

import numpy as np

from flexmb.interchange.imported import usable
from flexmb.interchange.superelement.element import SuperElementError
from flexmb.interchange.superelement.nastran import NamedMatrix, Row, assembled
from flexmb.typing import Index, Real

BANNER = "%%matrixmarket"
FORMATS, FIELDS, SYMMETRIES = ("array", "coordinate"), ("real", "double", "integer"), ("general", "symmetric")
LARGEST = 8_000  # rows: a dense matrix of this size has half a GiB and takes minutes to factorise


def market_matrix(file: str, text: str) -> Real:
    """The matrix (rows, columns) of a file; SuperElementError with file, defect and remedy."""
    head, _, rest = text.partition("\n")
    words = head.lower().split()
    if words[:2] != [BANNER, "matrix"] or len(words) != 5:
        raise _error(file, 'line 1 is not "%%MatrixMarket matrix ..."')
    form, field, symmetry = words[2:]
    if field == "complex":
        raise SuperElementError(f"{file} is complex: give real matrices, without structural damping")
    if form not in FORMATS or field not in FIELDS or symmetry not in SYMMETRIES:
        known = f"{' or '.join(FORMATS)}, {', '.join(FIELDS)}, {' or '.join(SYMMETRIES)}"
        raise _error(file, f"it is {form}, {field}, {symmetry}, and known are {known}")
    while rest.startswith(("%", "\n")):
        rest = rest.partition("\n")[2]
    line, _, body = rest.partition("\n")
    counts = _counts(file, line, 2 if form == "array" else 3)
    rows, columns = counts[:2]
    refuse_large(file, rows, columns)
    if symmetry == "symmetric" and rows != columns:
        raise _error(file, f"a symmetric matrix cannot be {rows} x {columns}")
    numbers = _numbers(file, body)
    if form == "array":
        return _array(file, numbers, rows, columns, symmetry == "symmetric")
    return _coordinates(file, numbers, rows, columns, counts[2], symmetry == "symmetric")


def refuse_large(file: str, rows: int, columns: int) -> None:
    """SuperElementError for a matrix that is too large for dense computations."""
    if max(rows, columns) > LARGEST:
        raise SuperElementError(
            f"{file}: {rows} x {columns} is too large for dense matrices ({LARGEST} rows): reduce it statically in its "
            "own program, or condense rotations and inner nodes"
        )


def both_halves(matrix: Real) -> Real:
    """A symmetric matrix, one half of which may be missing."""
    lower, upper = np.tril(matrix, -1), np.triu(matrix, 1)
    if np.any(lower) and np.any(upper):
        return matrix
    return matrix + lower.T + upper.T


def _counts(file: str, line: str, many: int) -> list[int]:
    words = line.split()
    if len(words) != many or not all(word.isascii() and word.isdigit() and len(word) < 19 for word in words):
        raise _error(file, f'"{line:.60}" is in the place of {many} sizes')
    return [int(word) for word in words]


def _numbers(file: str, body: str) -> Real:
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # that of text which cannot be parsed as numbers
        try:
            return np.fromstring(body, sep=" ") if body.strip() else np.zeros(0)
        except (DeprecationWarning, ValueError):
            raise _error(file, "the lines below the sizes contain more than numbers") from None


def _array(file: str, numbers: Real, rows: int, columns: int, symmetric: bool) -> Real:
    """A matrix given by columns; of a symmetric one only the lower half."""
    wanted = rows * (rows + 1) // 2 if symmetric else rows * columns
    if len(numbers) != wanted:
        raise _error(file, f"it holds {len(numbers)} numbers, and {rows} x {columns} needs {wanted}")
    if not symmetric:
        return numbers.reshape(columns, rows).T.copy()
    matrix = np.zeros((rows, rows))
    matrix.T[np.triu_indices(rows)] = numbers
    return matrix + np.tril(matrix, -1).T


def _coordinates(file: str, numbers: Real, rows: int, columns: int, count: int, symmetric: bool) -> Real:
    """A matrix given by row, column and value of each element; repeated elements are added."""
    if len(numbers) != 3 * count:
        raise _error(file, f"it holds {len(numbers)} numbers, and {count} elements need {3 * count}")
    i, j, values = numbers.reshape(-1, 3).T
    inside = (i >= 1) & (i <= rows) & (i == np.floor(i)) & (j >= 1) & (j <= columns) & (j == np.floor(j))
    if not np.all(inside):
        raise _error(file, f"element {int(np.argmin(inside)) + 1} lies outside of {rows} x {columns}")
    matrix = np.zeros((rows, columns))
    np.add.at(matrix, (i.astype(np.int64) - 1, j.astype(np.int64) - 1), values)
    return matrix + matrix.T - np.diag(np.diag(matrix)) if symmetric else matrix


def _error(file: str, what: str) -> SuperElementError:
    return SuperElementError(f"{file} is not a Matrix Market file of a real matrix ({what}): write it again")


COMMENT = "*"
BY_PLACE, BY_NODE = 3, 5  # numbers in a line
DISPLACEMENTS = {
    "UX": 1, "UY": 2, "UZ": 3, "ROTX": 4, "ROTY": 5, "ROTZ": 6,
    **{str(component): component for component in range(1, 7)},
}  # fmt: skip
"""Of a row, as Ansys and others name them."""


def triplets(file: str, text: str) -> NamedMatrix:
    """The matrix of a file. SuperElementError with file, line and remedy."""
    lines = [(number, words) for number, words in _lines(text) if words]
    if not lines:
        raise SuperElementError(f"{file}: there is no element: write the matrix again")
    width = len(lines[0][1])
    if width not in (BY_PLACE, BY_NODE):
        raise SuperElementError(
            f"{file}, line {lines[0][0]}: {width} numbers are neither row, column and value, nor two nodes with their "
            "displacements and a value: write the matrix by *MATRIX OUTPUT, FORMAT=COORDINATE or MATRIX INPUT, or as "
            "%%MatrixMarket"
        )
    values = np.array([_element(file, number, words, width) for number, words in lines])
    return _by_place(file, lines, values) if width == BY_PLACE else _by_node(file, lines, values)


def _lines(text: str) -> list[tuple[int, list[str]]]:
    return [
        (number, [] if line.lstrip().startswith(COMMENT) else line.replace(",", " ").split())
        for number, line in enumerate(text.split("\n"), 1)
    ]


def _element(file: str, number: int, words: list[str], width: int) -> list[float]:
    try:
        numbers = [float(word.upper().replace("D", "E")) for word in words]
        whole = [int(word) for word in words[:-1]]
    except ValueError:
        numbers, whole = [], []
    if len(numbers) != width or not usable(numbers[-1]) or not all(0 < number < 2**53 for number in whole):
        raise SuperElementError(
            f"{file}, line {number}: {' '.join(words):.60} is not {width - 1} numbers from 1 and a value: internal "
            "nodes and other lines cannot be read, write the matrix again"
        )
    return numbers


def _by_place(file: str, lines: list[tuple[int, list[str]]], values: Real) -> NamedMatrix:
    i, j = values[:, :2].astype(np.int64).T
    size = int(max(i.max(), j.max()))
    refuse_large(file, size, size)
    _refuse_repeated(file, lines, (i - 1) * size + j)
    matrix = np.zeros((size, size))
    matrix[i - 1, j - 1] = values[:, 2]
    return NamedMatrix("", both_halves(matrix), None, open_end=True)


def _by_node(file: str, lines: list[tuple[int, list[str]]], values: Real) -> NamedMatrix:
    places = values[:, :4].astype(np.int64)
    bad = np.flatnonzero((places[:, 1] > 6) | (places[:, 3] > 6))
    if len(bad):
        raise SuperElementError(
            f"{file}, line {lines[bad[0]][0]}: a displacement is beyond 6: give matrices of displacements and rotations"
        )
    elements: dict[tuple[Row, Row], float] = {}
    for (number, _), (a, b, c, d), value in zip(lines, places.tolist(), values[:, 4].tolist(), strict=True):
        if ((a, b), (c, d)) in elements:
            raise SuperElementError(f"{file}, line {number}: its element is there before: keep one of them")
        elements[(a, b), (c, d)] = value
    one_half = all((column, row) not in elements or row == column for row, column in elements)
    return assembled(file, "", elements, one_half)


def _refuse_repeated(file: str, lines: list[tuple[int, list[str]]], keys: Index) -> None:
    _, first = np.unique(keys, return_index=True)
    if len(first) < len(keys):
        number = lines[int(np.setdiff1d(np.arange(len(keys)), first)[0])][0]
        raise SuperElementError(f"{file}, line {number}: its element is there before: keep one of them")


def dof_rows(file: str, text: str) -> list[Row]:
    """Node and displacement of each row, as CalculiX writes them: 17.3 in a line."""
    return _rows(file, [(number, line.strip().split(".")) for number, line in enumerate(text.split("\n"), 1)])


def mapping_rows(file: str, text: str) -> list[Row]:
    """Node and displacement of each row from the mapping file of Ansys: number, node and UX to ROTZ in a line.

    The rows are in the order of their numbers, from 1; lines that do not begin with a number are headings.
    """
    lines = [(number, line.split()) for number, line in enumerate(text.split("\n"), 1)]
    lines = [(number, words) for number, words in lines if words and words[0].isdigit()]
    for count, (number, words) in enumerate(lines, 1):
        if words[0] != str(count):
            raise SuperElementError(f"{file}, line {number}: this is not row {count}: write the mapping file again")
    return _rows(file, [(number, words[1:]) for number, words in lines])


def _rows(file: str, lines: list[tuple[int, list[str]]]) -> list[Row]:
    rows: dict[Row, None] = {}
    for number, words in lines:
        if words in ([], [""]):
            continue
        component = DISPLACEMENTS.get(words[1].upper()) if len(words) == 2 else None
        if component is None or not (words[0].isascii() and words[0].isdigit() and len(words[0]) < 16):
            what = f"{' '.join(words):.40} is not a node and one of its displacements"
            raise SuperElementError(f"{file}, line {number}: {what}: give matrices of displacements and rotations")
        row = (int(words[0]), component)
        if row in rows:
            raise SuperElementError(f"{file}, line {number}: node {row[0]} has displacement {component} twice")
        rows[row] = None
        if len(rows) > LARGEST:
            refuse_large(file, len(rows), len(rows))
    return list(rows)
