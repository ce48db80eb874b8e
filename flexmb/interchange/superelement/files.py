"""Matrices and nodes of finite-element codes from files.

Matrices: Matrix Market (`.mtx`, `.mm`), Harwell-Boeing (`.hb`, `.rb`, as Ansys writes from its .full file), and
Nastran's OP4 in text form (`.op4`) and DMIG cards of a punch file (`.pch`, `.bdf`, `.dat`). Nodes: a CSV table with the
columns id, x, y, z (m), and dofs (digits 1 to 6, 123456 if left out), in the order of the rows of the matrices.
"""

from __future__ import annotations

import csv
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flexmb.interchange.imported import MAGNITUDE, usable
from flexmb.interchange.superelement.element import SuperElement, SuperElementError, super_element
from flexmb.interchange.superelement.matrix_market import market_matrix, refuse_large
from flexmb.interchange.superelement.nastran import NamedMatrix, dmig_matrices, op4_matrices
from flexmb.scene.reading import MIB, Unreadable, read_text, regular_size
from flexmb.typing import Real

LIMIT = 512 * MIB
OP4, DMIG = (".op4",), (".pch", ".bdf", ".dat")
MATRIX_MARKET, HARWELL_BOEING = (".mtx", ".mm"), (".hb", ".rb", ".rua", ".rsa")


class Nodes(NamedTuple):
    """ids, positions (n,3) m, and the digits of each node's displacements."""

    ids: list[int]
    position: list[list[float]]
    dofs: list[str]


def read_super_element(
    K: str | os.PathLike[str], M: str | os.PathLike[str], nodes: str | os.PathLike[str]
) -> SuperElement:
    """A structure from files of its matrices and its nodes; one file may hold both matrices, named K... and M....

    DMIG matrices name the node and the displacement of each row; then the table only needs to list the nodes. Raises
    SuperElementError with the file, the place and the remedy, or OSError.
    """
    table = _nodes(Path(nodes))
    stiffness, mass = _matrix(Path(K), "K"), _matrix(Path(M), "M")
    if stiffness.rows is not None or mass.rows is not None:
        stiffness, mass, table = _by_labels(stiffness, mass, table)
    return super_element(stiffness.matrix, mass.matrix, table.position, table.ids, table.dofs)


def _matrix(path: Path, letter: str) -> NamedMatrix:
    """The matrix of a file; if there are several, the one whose name begins with `letter`."""
    ending = path.suffix.lower()
    if ending in OP4 + DMIG:
        found = (op4_matrices if ending in OP4 else dmig_matrices)(str(path), _text(path))
        chosen = found if len(found) == 1 else [each for each in found if each.name.upper().startswith(letter)]
        if len(chosen) != 1:
            names = ", ".join(each.name for each in found) or "none"
            raise SuperElementError(
                f"{path}: which matrix is {letter}? it has {names}: give a file with one whose name begins so"
            )
        return chosen[0]
    if ending not in MATRIX_MARKET + HARWELL_BOEING:
        known = ", ".join(MATRIX_MARKET + HARWELL_BOEING + OP4 + DMIG)
        raise SuperElementError(f'{path}: "{ending}" is not a known format: write the matrix as one of {known}')
    market = ending in MATRIX_MARKET
    return NamedMatrix(letter, _whole(market_matrix(str(path), _text(path)) if market else _harwell_boeing(path)), None)


def _harwell_boeing(path: Path) -> Real:
    from scipy.io import hb_read

    if regular_size(path) > LIMIT:
        raise SuperElementError(f"{path} has more than {LIMIT // MIB} MiB: reduce the structure in its own program")
    try:
        found = hb_read(path)
    except (ValueError, IndexError, OverflowError, MemoryError, TypeError) as error:
        raise SuperElementError(f"{path} is not a Harwell-Boeing file ({error}): write it again") from None
    refuse_large(str(path), *found.shape)
    dense = np.asarray(found.todense() if hasattr(found, "todense") else found)
    if np.iscomplexobj(dense):
        raise SuperElementError(f"{path} is complex: give real matrices, without structural damping")
    return dense


def _whole(dense: Real) -> Real:
    """A symmetric matrix, one half of which may be missing."""
    lower = np.tril(dense, -1)
    return dense + lower.T if np.any(lower) and not np.any(np.triu(dense, 1)) else dense


def _text(path: Path) -> str:
    try:
        return read_text(path, LIMIT)
    except Unreadable as error:
        raise SuperElementError(f"{path}: {error}; OP4 has to be in text form (FORMATTED)") from None


def _nodes(path: Path) -> Nodes:
    try:
        rows = list(csv.reader(read_text(path).splitlines()))
    except (Unreadable, csv.Error) as error:
        raise SuperElementError(f"{path}: {error}") from None
    header = [word.strip().lower() for word in rows[0]] if rows else []
    if header[:4] != ["id", "x", "y", "z"] or header[4:] not in ([], ["dofs"]):
        raise SuperElementError(f'{path}, line 1: the header has to be "id,x,y,z" or "id,x,y,z,dofs"')
    found = Nodes([], [], [])
    for number, row in enumerate(rows[1:], 2):
        if not any(word.strip() for word in row):
            continue
        try:
            identity, x, y, z, *dofs = (word.strip() for word in row)
            found.ids.append(_number_of_node(identity))
            found.position.append([float(word) for word in (x, y, z)])
            found.dofs.append(dofs[0] if dofs else "123456")
        except ValueError:
            raise SuperElementError(f"{path}, line {number}: give {','.join(header)} as numbers, not {row}") from None
        if not all(map(usable, found.position[-1])):
            raise SuperElementError(f"{path}, line {number}: a coordinate is not finite, or beyond {MAGNITUDE:g}")
    if not found.ids:
        raise SuperElementError(f"{path}: there is no node: add a line for each, under id,x,y,z")
    return found


def _number_of_node(word: str) -> int:
    """A node number; ValueError unless it is an integer of 64 bits."""
    number = int(word)
    if not -(2**63) <= number < 2**63:
        raise ValueError(f"{word:.40} is too large")
    return number


def _by_labels(K: NamedMatrix, M: NamedMatrix, table: Nodes) -> tuple[NamedMatrix, NamedMatrix, Nodes]:
    """Both matrices with the union of their rows, ordered by nodes, and the table of these nodes."""
    if K.rows is None or M.rows is None:
        raise SuperElementError("one matrix names its rows and the other does not: give both from one code and format")
    known = dict(zip(table.ids, table.position, strict=True))
    rows = sorted(set(K.rows) | set(M.rows))
    ids = list(dict.fromkeys(node for node, _ in rows))
    strange = [node for node in ids if node not in known]
    if strange:
        raise SuperElementError(
            f"the matrices have rows of node {strange[0]}, which the table of nodes does not list: add it"
        )
    dofs = ["".join(str(component) for node, component in rows if node == each) for each in ids]
    at = {row: i for i, row in enumerate(rows)}

    def spread(given: NamedMatrix) -> NamedMatrix:
        assert given.rows is not None
        places = [at[row] for row in given.rows]
        full = np.zeros((len(rows), len(rows)))
        full[np.ix_(places, places)] = given.matrix
        return NamedMatrix(given.name, full, rows)

    return spread(K), spread(M), Nodes(ids, [known[node] for node in ids], dofs)
