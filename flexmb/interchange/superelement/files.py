"""Matrices and nodes of finite-element codes from files.

Matrices: Matrix Market and Abaqus' *MATRIX OUTPUT (`.mtx`), Harwell-Boeing (`.hb`, `.rb`, `.matrix`, as Ansys writes
from its .full file, with a `.mapping` beside it), CalculiX (`.sti` and `.mas`, with a `.dof` beside), and Nastran's OP4
(`.op4`) and DMIG cards of a punch file (`.pch`, `.bdf`, `.dat`). Nodes: an input file (`.bdf`, `.inp`), or a CSV table
with the columns id, x, y, z (m), and dofs (digits 1 to 6, 123456 if left out), in the order of the matrices' rows.
"""

from __future__ import annotations

import csv
import os
from inspect import signature
from pathlib import Path

import numpy as np

from flexmb.interchange.imported import MAGNITUDE, usable
from flexmb.interchange.superelement.element import SuperElement, SuperElementError, super_element
from flexmb.interchange.superelement.matrices import (
    both_halves,
    dof_rows,
    mapping_rows,
    market_matrix,
    refuse_large,
    triplets,
)
from flexmb.interchange.superelement.nastran import (
    NamedMatrix,
    Nodes,
    Row,
    binary_op4_matrices,
    dmig_matrices,
    grid_nodes,
    inp_nodes,
    is_binary_op4,
    number_of_node,
    op4_matrices,
)
from flexmb.scene.reading import MIB, Unreadable, read_bytes, read_text, regular_size
from flexmb.typing import Real

LIMIT = 512 * MIB
INSTEAD = {
    ".op2": "have Nastran write matrices by OUTPUT4 or as DMIG cards (EXTSEOUT with DMIGPCH)",
    ".f06": "it is a listing; have Nastran write matrices by OUTPUT4 or as DMIG cards (EXTSEOUT with DMIGPCH)",
    ".full": "have Ansys write it by HBMAT, with its mapping file", ".sub": "have Ansys write it by HBMAT",
    ".sim": "have Abaqus write it by *MATRIX OUTPUT, FORMAT=MATRIX INPUT",
}  # fmt: skip
"""What to do with files of finite-element codes that hold matrices in a form of their own."""


def read_super_element(
    K: str | os.PathLike[str], M: str | os.PathLike[str], nodes: str | os.PathLike[str]
) -> SuperElement:
    """A structure from files of its matrices and its nodes; one file may hold both matrices, named K... and M....

    Where a matrix names the node and the displacement of each row, the table only needs to list the nodes. Raises
    SuperElementError with the file, the place and the remedy, or OSError.
    """
    table = _nodes(Path(nodes))
    stiffness, mass = _matrix(Path(K), "K"), _matrix(Path(M), "M")
    if stiffness.rows is not None or mass.rows is not None:
        stiffness, mass, table = _by_labels(stiffness, mass, table)
    rows = max(len(stiffness.matrix), len(mass.matrix))
    stiffness, mass = (_with_rows(matrix, rows) if matrix.open_end else matrix for matrix in (stiffness, mass))
    table = _by_size(rows, table)
    return super_element(stiffness.matrix, mass.matrix, table.position, table.ids, table.dofs)


def _matrix(path: Path, letter: str) -> NamedMatrix:
    """The matrix of a file; if there are several, the one whose name begins with `letter`."""
    ending = path.suffix.lower()
    if ending not in READERS:
        remedy = INSTEAD.get(ending, f"write the matrix as one of {', '.join(READERS)}")
        raise SuperElementError(f'{path}: "{ending}" is not a known format: {remedy}')
    found = READERS[ending](path)
    chosen = found if len(found) == 1 else [matrix for matrix in found if matrix.name.upper().startswith(letter)]
    if len(chosen) != 1:
        names = ", ".join(matrix.name for matrix in found) or "none"
        raise SuperElementError(
            f"{path}: which matrix is {letter}? it has {names}: give a file with one whose name begins so"
        )
    return chosen[0]


def _market(path: Path) -> list[NamedMatrix]:
    """Of Matrix Market, or of *MATRIX OUTPUT, which has the same ending and no banner."""
    text = _text(path)
    if not text.lstrip().lower().startswith("%"):
        return [triplets(str(path), text)]
    return [NamedMatrix("", both_halves(market_matrix(str(path), text)), None)]


def _op4(path: Path) -> list[NamedMatrix]:
    try:
        data = read_bytes(path, LIMIT)
    except Unreadable as error:
        raise SuperElementError(f"{path}: {error}") from None
    return binary_op4_matrices(str(path), data) if is_binary_op4(data) else op4_matrices(str(path), _text(path))


def _dmig(path: Path) -> list[NamedMatrix]:
    return dmig_matrices(str(path), _text(path))


def _calculix(path: Path) -> list[NamedMatrix]:
    """With the rows of the file `.dof` beside it."""
    beside = path.with_suffix(".dof")
    if not beside.exists():
        raise SuperElementError(f"{path}: {beside.name}, which names its rows, is not beside it: ccx writes all three")
    return [_labelled(path, triplets(str(path), _text(path)), dof_rows(str(beside), _text(beside)))]


def _ansys(path: Path) -> list[NamedMatrix]:
    """With the rows of the mapping file beside it, if there is one."""
    matrix = NamedMatrix("", both_halves(_harwell_boeing(path)), None)
    for beside in (path.with_suffix(".mapping"), path.with_suffix(".MAPPING")):
        if beside.exists():
            return [_labelled(path, matrix, mapping_rows(str(beside), _text(beside)))]
    return [matrix]


def _labelled(path: Path, found: NamedMatrix, rows: list[Row]) -> NamedMatrix:
    if len(found.matrix) > len(rows) or (len(found.matrix) < len(rows) and not found.open_end):
        raise SuperElementError(f"{path}: it has {len(found.matrix)} rows, and the file beside it names {len(rows)}")
    return _with_rows(found, len(rows))._replace(rows=rows)


def _with_rows(found: NamedMatrix, count: int) -> NamedMatrix:
    """With the last rows, which have no element."""
    missing = count - len(found.matrix)
    return NamedMatrix(found.name, np.pad(found.matrix, ((0, missing), (0, missing))), found.rows)


def _harwell_boeing(path: Path) -> Real:
    from scipy.io import hb_read

    if regular_size(path) > LIMIT:
        raise SuperElementError(f"{path} has more than {LIMIT // MIB} MiB: reduce the structure in its own program")
    kind = {"spmatrix": False} if "spmatrix" in signature(hb_read).parameters else {}  # SciPy changes what it gives
    try:
        matrix = hb_read(path, **kind)
    except (ValueError, IndexError, OverflowError, MemoryError, TypeError) as error:
        raise SuperElementError(f"{path} is not a Harwell-Boeing file ({error}): write it again") from None
    refuse_large(str(path), *matrix.shape)
    dense = np.asarray(matrix.todense() if hasattr(matrix, "todense") else matrix)
    if np.iscomplexobj(dense):
        raise SuperElementError(f"{path} is complex: give real matrices, without structural damping")
    return dense


def _text(path: Path) -> str:
    try:
        return read_text(path, LIMIT)
    except Unreadable as error:
        raise SuperElementError(f"{path}: {error}") from None


def _nodes(path: Path) -> Nodes:
    ending = path.suffix.lower()
    if ending in MESHES:
        nodes = MESHES[ending](str(path), _text(path))
        if not nodes.ids:
            raise SuperElementError(f"{path}: there is no node in it: give the input file that lists them")
        return nodes
    return _table(path)


def _table(path: Path) -> Nodes:
    try:
        rows = list(csv.reader(read_text(path).splitlines()))
    except (Unreadable, csv.Error) as error:
        raise SuperElementError(f"{path}: {error}") from None
    header = [word.strip().lower() for word in rows[0]] if rows else []
    if header[:4] != ["id", "x", "y", "z"] or header[4:] not in ([], ["dofs"]):
        raise SuperElementError(f'{path}, line 1: the header has to be "id,x,y,z" or "id,x,y,z,dofs"')
    nodes = Nodes([], [], [])
    for number, row in enumerate(rows[1:], 2):
        if not any(word.strip() for word in row):
            continue
        try:
            identity, x, y, z, *dofs = (word.strip() for word in row)
            nodes.ids.append(number_of_node(identity))
            nodes.position.append([float(word) for word in (x, y, z)])
            nodes.dofs.append(dofs[0] if dofs else "123456")
        except ValueError:
            raise SuperElementError(f"{path}, line {number}: give {','.join(header)} as numbers, not {row}") from None
        if not all(map(usable, nodes.position[-1])):
            raise SuperElementError(f"{path}, line {number}: a coordinate is not finite, or beyond {MAGNITUDE:g}")
    if not nodes.ids:
        raise SuperElementError(f"{path}: there is no node: add a line for each, under id,x,y,z")
    return nodes


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
    dofs = ["".join(str(component) for node, component in rows if node == number) for number in ids]
    at = {row: i for i, row in enumerate(rows)}

    def spread(given: NamedMatrix) -> NamedMatrix:
        assert given.rows is not None
        places = [at[row] for row in given.rows]
        full = np.zeros((len(rows), len(rows)))
        full[np.ix_(places, places)] = given.matrix
        return NamedMatrix(given.name, full, rows)

    return spread(K), spread(M), Nodes(ids, [known[node] for node in ids], dofs)


def _by_size(rows: int, table: Nodes) -> Nodes:
    """Nodes of an input file, which does not say their displacements: all have three, or all six."""
    if "" not in table.dofs:
        return table
    for digits in ("123", "123456"):
        if rows == len(digits) * len(table.ids):
            return table._replace(dofs=[digits] * len(table.ids))
    raise SuperElementError(
        f"K has {rows} rows, which is neither 3 nor 6 for each of {len(table.ids)} nodes: give matrices that name "
        "their rows, or a table id,x,y,z,dofs"
    )


READERS = {
    **dict.fromkeys((".mtx", ".mm"), _market), **dict.fromkeys((".hb", ".rb", ".rua", ".rsa", ".matrix"), _ansys),
    ".op4": _op4, **dict.fromkeys((".pch", ".bdf", ".dat"), _dmig), **dict.fromkeys((".sti", ".mas"), _calculix),
}  # fmt: skip
"""By the ending of a file of matrices."""
MESHES = {**dict.fromkeys((".bdf", ".dat", ".nas", ".pch"), grid_nodes), ".inp": inp_nodes}
"""By the ending of a file that lists nodes; others are tables."""
