"""Files of matrices and nodes: the same structure from every format, and what damaged files say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from flexmb.interchange.superelement import SuperElementError, read_super_element
from flexmb.interchange.superelement.nastran import dmig_matrices, op4_matrices
from tests.flexmb.interchange import frames

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
    return DATA / f"pynastran_{kind}.op4", DATA / f"pynastran_{kind}.op4"


@pytest.mark.parametrize("kind", ["mtx", "sparse.mtx", "hb", "pch", "dense", "sparse"])
def test_the_same_structure_from_every_format(kind, tmp_path):
    """OP4 files were written by pyNastran."""
    (tmp_path / "nodes.csv").write_text(NODES)
    element = read_super_element(*written(kind, tmp_path), tmp_path / "nodes.csv")
    digits = 1e-9 if kind == "pch" else 1e-15
    full = np.ix_(*[element.place[element.place >= 0]] * 2)
    assert element.ids.tolist() == [1, 2, 3]
    assert np.max(np.abs(element.K[full] - K)) <= digits * np.max(np.abs(K))
    wanted = M[np.ix_(*[np.flatnonzero(element.place.ravel() >= 0)] * 2)]
    assert np.max(np.abs(element.M[full] - wanted)) <= digits * np.max(M)


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
    "no matrix market": ("K.mtx", "1 2 3", "not a Matrix Market file"),
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
    "unknown": ("K.full", "x", "not a known format: write the matrix as one of .mtx"),
}


@pytest.mark.parametrize("fault", BAD)
def test_damaged_matrices_are_refused_with_file_and_remedy(fault, tmp_path):
    name, text, words = BAD[fault]
    (tmp_path / name).write_text(text)
    (tmp_path / "nodes.csv").write_text(NODES)
    with pytest.raises(SuperElementError, match=words) as error:
        read_super_element(tmp_path / name, tmp_path / name, tmp_path / "nodes.csv")
    assert name in str(error.value)


TABLES = {
    "header": ("x,y,z\n1,2,3\n", "line 1: the header"),
    "empty": ("id,x,y,z\n", "there is no node"),
    "words": ("id,x,y,z\n1,a,0,0\n", "line 2: give id,x,y,z as numbers"),
    "nan": ("id,x,y,z\n1,nan,0,0\n", "line 2: a coordinate"),
    "dofs": ("id,x,y,z,dofs\n1,0,0,0,127\n", 'node 1 has the dofs "127"'),
    "few": ("id,x,y,z\n1,0,0,0\n", "K has 18 rows"),
    "beyond all numbers": (f"id,x,y,z\n{'9' * 30},0,0,0\n", "line 2: give id,x,y,z as numbers"),
    "endless cell": (f"id,x,y,z\n{'2' * 200_000},0,0,0\n", "field larger than"),
    "twice": ("id,x,y,z\n1,0,0,0\n1,1,0,0\n", "a node number is repeated"),
}


@pytest.mark.parametrize("fault", TABLES)
def test_damaged_tables_are_refused_with_line_and_remedy(fault, tmp_path):
    text, words = TABLES[fault]
    (tmp_path / "nodes.csv").write_text(text)
    with pytest.raises(SuperElementError, match=words):
        read_super_element(*written("mtx", tmp_path), tmp_path / "nodes.csv")


def test_nodes_of_a_punch_file_have_to_be_in_the_table(tmp_path):
    (tmp_path / "nodes.csv").write_text("id,x,y,z\n1,0,0,0\n2,0.35,0,0\n")
    with pytest.raises(SuperElementError, match="rows of node 3, which the table of nodes does not list"):
        read_super_element(*written("pch", tmp_path), tmp_path / "nodes.csv")
