"""Files of matrices and nodes: the same structure from every format, and what damaged files say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from flexmb.interchange.superelement import SuperElementError, read_super_element
from flexmb.interchange.superelement.nastran import (
    binary_op4_matrices,
    dmig_matrices,
    grid_nodes,
    inp_nodes,
    op4_matrices,
)
from tests.flexmb.interchange import frames, made_matrices

DATA = Path(__file__).parent / "data"
POSITION, MEMBERS = frames.straight(2, 0.7)
K, M = frames.frame(POSITION, MEMBERS), frames.lumped(POSITION, MEMBERS)
NODES = "id,x,y,z\n" + "".join(f"{i + 1},{x},{y},{z}\n" for i, (x, y, z) in enumerate(POSITION.tolist()))


def large_field_dmig(name: str, matrix: np.ndarray) -> str:
    """As a punch file has it: one half, 16 characters a field, Fortran's D."""
    lines = [f"DMIG    {name:<8}{0:8d}{6:8d}{2:8d}{0:8d}{'':8}{'':8}{len(matrix):8d}"]
    for j in range(len(matrix)):
        lines.append(f"DMIG*   {name:<16}{j // 6 + 1:16d}{j % 6 + 1:16d}")
        for i in range(j, len(matrix)):
            if matrix[i, j]:
                number = f"{matrix[i, j]:.9E}".replace("E", "D")
                lines.append(f"*       {i // 6 + 1:16d}{i % 6 + 1:16d}{number:>16}")
    return "\n".join(["$TITLE   = BEAM", *lines]) + "\n"


def written(kind: str, folder: Path) -> tuple[Path, Path]:
    match kind:
        case "mtx" | "sparse.mtx":
            for name, matrix in (("K", K), ("M", M)):
                scipy.io.mmwrite(folder / f"{name}.mtx", matrix if kind == "mtx" else scipy.sparse.coo_matrix(matrix))
            return folder / "K.mtx", folder / "M.mtx"
        case "hb":
            for name, matrix in (("K", K), ("M", M)):
                scipy.io.hb_write(folder / f"{name}.rb", scipy.sparse.csc_matrix(matrix))
            return folder / "K.rb", folder / "M.rb"
        case "pch":
            (folder / "both.pch").write_text(large_field_dmig("KAAX", K) + large_field_dmig("MAAX", M))
            return folder / "both.pch", folder / "both.pch"
        case "coordinate" | "matrix_input":
            for name, matrix in (("K", K), ("M", M)):
                (folder / f"{name}.mtx").write_text(getattr(made_matrices, kind)(matrix))
            return folder / "K.mtx", folder / "M.mtx"
        case "calculix":
            for name, matrix in (("b.sti", K), ("b.mas", M)):
                (folder / name).write_text(made_matrices.calculix(matrix))
            (folder / "b.dof").write_text(made_matrices.dof(len(K)))
            return folder / "b.sti", folder / "b.mas"
        case "ansys":
            for name, matrix in (("K", K), ("M", M)):
                scipy.io.hb_write(folder / f"{name}.matrix", scipy.sparse.csc_matrix(np.tril(matrix)))
                (folder / f"{name}.mapping").write_text(made_matrices.mapping(len(K)))
            return folder / "K.matrix", folder / "M.matrix"
    if kind.startswith("binary"):
        _, form, order, word = kind.split()
        both = made_matrices.binary_op4({"KAAX": K, "MAAX": M}, form, order, int(word))  # type: ignore[arg-type]
        (folder / "both.op4").write_bytes(both)
        return folder / "both.op4", folder / "both.op4"
    return DATA / f"pynastran_{kind}.op4", DATA / f"pynastran_{kind}.op4"


KINDS = (
    "mtx", "sparse.mtx", "hb", "pch", "dense", "sparse", "coordinate", "matrix_input", "calculix", "ansys",
    "binary dense < 4", "binary sparse > 4", "binary big < 4", "binary big < 8", "binary dense > 8",
)  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_structure_from_every_format(kind, tmp_path):
    """OP4 files in text form were written by pyNastran, which reads the binary ones exactly in this way."""
    (tmp_path / "nodes.csv").write_text(NODES)
    element = read_super_element(*written(kind, tmp_path), tmp_path / "nodes.csv")
    digits = 1e-9 if kind == "pch" else 1e-15
    full = np.ix_(*[element.place[element.place >= 0]] * 2)
    assert element.ids.tolist() == [1, 2, 3]
    assert np.max(np.abs(element.K[full] - K)) <= digits * np.max(np.abs(K))
    wanted = M[np.ix_(*[np.flatnonzero(element.place.ravel() >= 0)] * 2)]
    assert np.max(np.abs(element.M[full] - wanted)) <= digits * np.max(M)


def test_what_calculix_writes_is_read_with_its_input_file():
    """A brick: its mass is rho L B H, and six motions need no force."""
    element = read_super_element(*(DATA / f"ccx_brick.{ending}" for ending in ("sti", "mas", "inp")))
    assert element.M.shape == (24, 24) and element.ids.tolist() == [*range(1, 9)]
    along = element.rigid(np.zeros(3))[:, 0]
    assert along @ element.M @ along == pytest.approx(2700.0 * 1.0 * 0.3 * 0.2, rel=1e-12)


GRIDS = {
    "small": "GRID    1               0.      0.      0.\nGRID    2               .35     0.      0.\n"
    "GRID,3,,7.-1,0.,0.\n",
    "large": "".join(
        f"GRID*   {i:16d}{'':16}{x:16.9f}{y:16.9f}\n*       {z:16.9f}\n" for i, (x, y, z) in enumerate(POSITION, 1)
    ),
}


@pytest.mark.parametrize("kind", [*GRIDS, "inp"])
def test_nodes_of_input_files_are_those_of_the_table(kind, tmp_path):
    file = tmp_path / ("mesh.inp" if kind == "inp" else "mesh.bdf")
    lines = "".join(f"{i}, {x!r}, {y!r}\n" for i, (x, y, _) in enumerate(POSITION.tolist(), 1))
    file.write_text(f"*Node, nset=All\n** hi\n{lines}*Node Print\n7,8\n" if kind == "inp" else GRIDS[kind])
    (tmp_path / "nodes.csv").write_text(NODES)
    for matrices in ("mtx", "calculix"):  # without names of rows, and with them
        given = written(matrices, tmp_path)
        found, wanted = (read_super_element(*given, nodes) for nodes in (file, tmp_path / "nodes.csv"))
        assert np.array_equal(found.position, wanted.position) and np.array_equal(found.place, wanted.place)


def test_coordinates_that_are_left_out_are_zero():
    assert inp_nodes("m.inp", "*NODE\n4\n5, 1.0\n").position == [[0.0] * 3, [1.0, 0.0, 0.0]]
    assert grid_nodes("m.bdf", "GRID,4\nGRID,5,,1.0\n").position == [[0.0] * 3, [1.0, 0.0, 0.0]]


BESIDE = {  # by the matrices' kind: a file beside them with another text, or gone
    "another system": ("mtx", "m.bdf", "GRID,1,4,0.,0.,0.\n", "line 1: node 1 is in another coordinate system"),
    "no coordinate": ("mtx", "m.bdf", "GRID,1,,x,0.,0.\n", "line 1: GRID needs a number"),
    "no grid": ("mtx", "m.bdf", "CBAR,1,2\n", "there is no node in it"),
    "instances": ("mtx", "m.inp", "*INSTANCE, NAME=a\n", "line 1: .*write a flat input file"),
    "cylindrical": ("mtx", "m.inp", "*NODE, SYSTEM=C\n1, 0, 0, 0\n", "line 1: .*moves nodes"),
    "no number": ("mtx", "m.inp", "*NODE\n1, a, 0, 0\n", "line 2: a node is number, x, y, z"),
    "too far": ("mtx", "m.inp", "*NODE\n1, 1e300, 0, 0\n", "line 2: a node is number"),
    "few": ("mtx", "m.inp", "*NODE\n1, 0, 0, 0\n", "neither 3 nor 6 for each of 1 nodes"),
    "no dof": ("calculix", "b.dof", None, "b.dof, which names its rows, is not beside it: ccx writes all three"),
    "few rows": ("calculix", "b.dof", "1.1\n", "it has 18 rows, and the file beside it names 1"),
    "temperature": ("calculix", "b.dof", "1.11\n", "line 1: 1 11 is not a node and one of its displacements"),
    "a displacement twice": ("calculix", "b.dof", "1.1\n1.1\n", "line 2: node 1 has displacement 1 twice"),
    "mapping": ("ansys", "K.mapping", " Matrix Eqn Node DOF\n 2 1 UX\n", "line 2: this is not row 1"),
    "header": ("mtx", "nodes.csv", "x,y,z\n1,2,3\n", "line 1: the header"),
    "empty": ("mtx", "nodes.csv", "id,x,y,z\n", "there is no node"),
    "words": ("mtx", "nodes.csv", "id,x,y,z\n1,a,0,0\n", "line 2: give id,x,y,z as numbers"),
    "nan": ("mtx", "nodes.csv", "id,x,y,z\n1,nan,0,0\n", "line 2: a coordinate"),
    "dofs": ("mtx", "nodes.csv", "id,x,y,z,dofs\n1,0,0,0,127\n", 'node 1 has the dofs "127"'),
    "few in a table": ("mtx", "nodes.csv", "id,x,y,z\n1,0,0,0\n", "K has 18 rows"),
    "beyond all numbers": ("mtx", "nodes.csv", f"id,x,y,z\n{'9' * 30},0,0,0\n", "line 2: give id,x,y,z as numbers"),
    "endless cell": ("mtx", "nodes.csv", f"id,x,y,z\n{'2' * 200_000},0,0,0\n", "field larger than"),
    "a node twice": ("mtx", "nodes.csv", "id,x,y,z\n1,0,0,0\n1,1,0,0\n", "a node number is repeated"),
    "a node of the matrices": (
        "pch", "nodes.csv", "id,x,y,z\n1,0,0,0\n2,0.35,0,0\n", "rows of node 3, which the table of nodes does not list"
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", BESIDE)
def test_damaged_files_beside_matrices_are_refused_with_line_and_remedy(fault, tmp_path):
    kind, name, text, words = BESIDE[fault]
    given = written(kind, tmp_path)
    (tmp_path / "nodes.csv").write_text(NODES)
    (tmp_path / name).unlink() if text is None else (tmp_path / name).write_text(text)
    with pytest.raises(SuperElementError, match=words):
        read_super_element(*given, tmp_path / (name if name.startswith("m.") else "nodes.csv"))


def test_damaged_binary_op4_is_refused_wherever_it_is_cut():
    whole = made_matrices.binary_op4({"K": K[:3, :3]}, "sparse")
    for length in range(5, len(whole)):
        with pytest.raises(SuperElementError, match="byte|has no end"):
            binary_op4_matrices("f", whole[:length])
    nan = made_matrices.binary_op4({"K": np.array([[np.nan]])})
    with pytest.raises(SuperElementError, match="byte 32: .* finite numbers"):
        binary_op4_matrices("f", nan)


def test_dmig_in_small_fields_and_with_commas():
    """Two elements a card behind a short one, numbers without E."""
    cards = [
        ("DMIG", "KAAX", 0, 6, 1, 0, "", "", 2),
        ("DMIG", "KAAX", 1, 1, "", 1, 1, 1.5, ""),
        ("+", 1, 2, "2.+3", "", 2, 3, "-4.-1", ""),
    ]
    small = "\n".join("".join(f"{field:<8}" for field in card) for card in cards)
    comma = "\n".join(",".join(map(str, card)) for card in cards)
    for text in (small, comma):
        (found,) = dmig_matrices("f", text)
        assert found.rows == [(1, 1), (1, 2), (2, 3)]
        assert np.array_equal(found.matrix, [[1.5, 2000.0, -0.4], [2000.0, 0.0, 0.0], [-0.4, 0.0, 0.0]])


def test_op4_with_long_string_headers():
    """BIGMAT: two whole numbers in front of a string; rows are negative in the header."""
    text = (
        "       2      -2       2       2KAAX    1P,3E23.16\n"
        "       1       0       4\n       5       1\n 2.0000000000000000E+00-1.0000000000000000E+00\n"
        "       2       0       3\n       3       2\n 3.0000000000000000E+00\n"
        "       3       1       1\n 1.0000000000000000E+00\n"
    )
    (found,) = op4_matrices("f", text)
    assert np.array_equal(found.matrix, [[2.0, 0.0], [-1.0, 3.0]])


SPARSE = (DATA / "pynastran_sparse.op4").read_text()
BAD = {
    "cut OP4": ("K.op4", SPARSE[:600], "has no end"),
    "no OP4": ("K.op4", "hello\n", "line 1: this is not the header"),
    "outside": ("K.op4", SPARSE.replace("  327687", "  327700", 1), "an element outside of the matrix"),
    "not finite": ("K.op4", SPARSE.replace(" 2.0000000000000000E+07", " 2.0000000000000E+7777", 1), "not finite"),
    "complex OP4": ("K.op4", SPARSE.replace("       6       2K", "       6       4K"), "real square matrices"),
    "binary": ("K.op4", "\x00\x00", "not the header"),
    "which": ("K.op4", SPARSE.replace("KAAX", "XAAX"), "which matrix is K"),
    "no DMIG": ("K.pch", "$ nothing\n", "it has none"),
    "no header": ("K.pch", "DMIG*   KAAX                           1               1\n", "line 1"),
    "no matrix market": ("K.mtx", "1 2 3 4", "line 1: 4 numbers are neither .* MATRIX INPUT, or as %%MatrixMarket"),
    "no matrix": ("K.mtx", "** hello\n", "there is no element"),
    "an internal node": ("K.mtx", "-3,1, 1,1, 2.0\n", "line 1: .* internal nodes"),
    "temperature": ("K.mtx", "3,11, 1,1, 2.0\n", "line 1: a displacement is beyond 6"),
    "an element twice": ("K.mtx", "1 1 2.0\n1 2 1.0\n1 1 3.0\n", "line 3: its element is there before"),
    "twice by node": ("K.mtx", "1,1, 1,1, 2.0\n1,1, 1,1, 2.0\n", "line 2: its element is there before"),
    "no number": ("K.mtx", "1 1 2.0\n1 1 x\n", "line 2: 1 1 x is not 2 numbers from 1 and a value"),
    "half a number": ("K.mtx", "1 1.5 2.0\n", "line 1: 1 1.5 2.0 is not"),
    "many rows": ("K.mtx", "99999 1 2.0\n", "too large for dense"),
    "a listing": ("K.f06", "x", "not a known format: it is a listing; have Nastran write matrices by OUTPUT4"),
    "NUL in a number": ("K.mtx", "%%MatrixMarket matrix array real general\n1 1\n1\x000\n", "more than numbers"),
    "too few": ("K.mtx", "%%MatrixMarket matrix array real symmetric\n2 2\n1 2\n", "2 numbers, and 2 x 2 needs 3"),
    "outside of it": ("K.mtx", "%%MatrixMarket matrix coordinate real general\n2 2 1\n3 1 1.0\n", "element 1 lies"),
    "sizes": ("K.mtx", "%%MatrixMarket matrix array real general\n2 -2\n", '"2 -2" is in the place of 2 sizes'),
    "pattern": ("K.mtx", "%%MatrixMarket matrix coordinate pattern general\n1 1 1\n1 1\n", "known are array or coord"),
    "complex": ("K.mtx", "%%MatrixMarket matrix array complex general\n1 1\n1 1\n", "is complex"),
    "no HB": ("K.rb", "x", "not a Harwell-Boeing file"),
    "large": (
        "K.mtx",
        "%%MatrixMarket matrix coordinate real general\n90000 90000 1\n1 1 1.0\n",
        "too large for dense",
    ),
    "unknown": ("K.xyz", "x", "not a known format: write the matrix as one of .mtx"),
}


@pytest.mark.parametrize("fault", BAD)
def test_damaged_matrices_are_refused_with_file_and_remedy(fault, tmp_path):
    name, text, words = BAD[fault]
    (tmp_path / name).write_text(text)
    (tmp_path / "nodes.csv").write_text(NODES)
    with pytest.raises(SuperElementError, match=words) as error:
        read_super_element(tmp_path / name, tmp_path / name, tmp_path / "nodes.csv")
    assert name in str(error.value)
