"""Reader of Matrix Market files; SciPy's crashes, or never returns, for some damaged files."""

from __future__ import annotations

import warnings

import numpy as np

from flexmb.interchange.superelement.element import SuperElementError
from flexmb.typing import Real

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
