"""Matrices that CalculiX writes while the test runs: a plate of solids from its input file to a body of a scene."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh
from typer.testing import CliRunner

import flexmb as fm
from flexmb.cli import app
from flexmb.modal.flexible import flexible_model
from flexmb.modal.integrals import modal_integrals
from tests.bounds import relative
from tests.flexmb.interchange import solids

CCX = shutil.which("ccx")
CELLS, SIZE = (6, 3, 1), (1.0, 0.5, 0.02)
X, Y, Z = (np.linspace(0.0, length, count + 1) for length, count in zip(SIZE, CELLS, strict=True))
POSITION = np.array([[a, b, c] for c in Z for b in Y for a in X])
ROOT, TIP = (np.flatnonzero(POSITION[:, 0] == x) for x in (0.0, SIZE[0]))
PRINTED = 1e-6  # seven digits of a frequency
MODES = 6

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CCX is None, reason="CalculiX is not installed: apt-get install calculix-ccx"),
]


def deck(holding: bool) -> str:
    """An input file of the plate, of eight-node solids: held at x = 0 for its modes, else free for its matrices."""
    number = 1 + np.arange(len(POSITION)).reshape(CELLS[2] + 1, CELLS[1] + 1, CELLS[0] + 1)
    lines = ["*NODE, NSET=NALL", *(f"{i}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in enumerate(POSITION.tolist(), 1))]
    lines.append("*ELEMENT, TYPE=C3D8, ELSET=EALL")
    for element, (c, b, a) in enumerate(np.ndindex(CELLS[::-1]), 1):
        corners = [number[c + k, b + j, a + i] for k in (0, 1) for j, i in ((0, 0), (0, 1), (1, 1), (1, 0))]
        lines.append(", ".join(map(str, [element, *corners])))
    lines += ["*MATERIAL, NAME=AL", "*ELASTIC", f"{solids.E!r}, {solids.NU!r}", "*DENSITY", f"{solids.RHO!r}"]
    lines.append("*SOLID SECTION, ELSET=EALL, MATERIAL=AL")
    if holding:
        lines += ["*BOUNDARY", *(f"{1 + node}, 1, 3" for node in ROOT)]
    lines += ["*STEP", "*FREQUENCY" if holding else "*FREQUENCY, SOLVER=MATRIXSTORAGE", f"{MODES}", "*END STEP"]
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="module")
def plate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what ccx wrote about the plate."""
    folder = tmp_path_factory.mktemp("calculix")
    for name in ("free", "held"):
        (folder / f"{name}.inp").write_text(deck(name == "held"))
        assert CCX is not None
        done = subprocess.run([CCX, name], cwd=folder, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stdout[-2000:]
    return folder


def matrix(file: Path) -> np.ndarray:
    """The rows i, j, value of a lower triangle as ccx writes them, read without flexmb."""
    rows = np.loadtxt(file)
    i, j = (rows[:, k].astype(int) - 1 for k in (0, 1))
    full = np.zeros((3 * len(POSITION), 3 * len(POSITION)))
    full[i, j] = full[j, i] = rows[:, 2]
    return full


def reduced(plate: Path, *surfaces: np.ndarray) -> np.ndarray:
    """Frequencies (Hz) of the body that `flexmb reduce` writes, with surfaces tied rigidly to nodes, the first held."""
    files = [str(plate / f"free.{ending}") for ending in ("sti", "mas", "inp")]
    for node, surface in enumerate(surfaces, 900):
        files += ["--rigid", f"{node}={','.join(str(1 + of) for of in surface)}"]
    chosen = ["--interface", ",".join(map(str, range(900, 900 + len(surfaces)))), "--modes", str(MODES)]
    done = CliRunner().invoke(app, ["reduce", *files, *chosen, "--out", str(plate / "plate.toml")])
    assert done.exit_code == 0, done.output
    (body,) = fm.load_scene(plate / "plate.toml").bodies
    assert isinstance(body, fm.ModalBody)
    model = flexible_model(body)
    mass = modal_integrals(model).spatial_mass[: len(model.stiffness), : len(model.stiffness)]
    return np.sqrt(eigh(model.stiffness, mass, eigvals_only=True)) / (2.0 * np.pi)


def craig_bampton(K: np.ndarray, M: np.ndarray) -> np.ndarray:
    """Frequencies (Hz), the first face held, of the motions of Craig and Bampton, in plain NumPy."""
    k, m, _, _ = solids.tied(K, M, POSITION, [ROOT, TIP])
    fixed = eigh(k[12:, 12:], m[12:, 12:])[1][:, :MODES]
    static = -np.linalg.solve(k[12:, 12:], k[12:, 6:12])
    T = np.vstack([np.zeros((6, 6 + MODES)), np.eye(6, 6 + MODES), np.hstack([static, fixed])])
    return np.sqrt(eigh(T.T @ k @ T, T.T @ m @ T, eigvals_only=True)) / (2.0 * np.pi)


def test_the_body_has_the_frequencies_of_craig_and_bampton(plate: Path) -> None:
    K, M = matrix(plate / "free.sti"), matrix(plate / "free.mas")
    found = reduced(plate, ROOT, TIP)
    assert relative(found / craig_bampton(K, M), np.ones(6 + MODES)) < 1e-9
    assert relative(found / craig_bampton(1.0001 * K, M), np.ones(6 + MODES)) > 1e-5  # what would be noticed


def test_the_held_plate_has_the_frequencies_that_ccx_prints(plate: Path) -> None:
    """The root alone is the interface: the modes with it held are those of the plate itself."""
    lines = re.findall(r"^ +\d+ +\S+ +\S+ +(\S+) +0\.0+E\+00$", (plate / "held.dat").read_text(), re.MULTILINE)
    printed = np.array(lines[:MODES], dtype=float)
    assert len(printed) == MODES
    assert relative(reduced(plate, ROOT) / printed, np.ones(MODES)) < PRINTED
