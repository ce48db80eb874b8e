"""What comes with the installation is enough: processes with nothing of their own compile nothing."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import flexmb
from flexmb.jit.installed import is_whole
from flexmb.ready.make import KERNELS
from flexmb.ready.uses import uses
from tests.repo.project import ROOT

at_hand = pytest.mark.skipif(not is_whole(), reason="not all general kernels came with the installation")
USE = """
import flexmb as fm
from tests.benchmarks.rivals import flexible_chain
scene = flexible_chain(3, 2, "full")
assert fm.compile(scene).kernels == "general"
fm.compile(scene).hinge_loads(fm.compile(scene).initial_state)
assert fm.simulate(scene, 0.1, samples=3).finished
assert fm.simulate(scene, 1e-3, "rk4", step=1e-5, samples=3).finished
fm.linearize(scene)
assert fm.simulate_batch([scene] * 3, 0.1, samples=3).finished
"""
# In place of a special kernel, which would take seven seconds.
ANOTHER = "import numpy as np; from tests.flexmb.jit.test_linking import outer; outer(np.array([3.0]))"


def compiled(folder: Path, program: str) -> list[str]:
    """Names of the kernels that a process compiles."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder), "PYTHONPATH": str(ROOT), "FLEXMB_KERNELS": "auto"}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return sorted(file.name for file in folder.rglob(KERNELS))


@at_hand
def test_a_first_use_compiles_nothing(tmp_path: Path) -> None:
    """Loads, runs by both kinds of steps, a linear model, a batch."""
    assert compiled(tmp_path, USE) == []


def test_what_did_not_come_along_is_compiled(tmp_path: Path) -> None:
    """The test above sees what is compiled."""
    assert [name.partition("-")[0] for name in compiled(tmp_path, ANOTHER)] == ["inner", "outer"]


def test_uses_have_names_of_their_own() -> None:
    names = [name for name, _ in uses()]
    assert len(names) == len(set(names)) > 40


@at_hand
@pytest.mark.slow
def test_no_use_is_left_to_compile(tmp_path: Path) -> None:
    program = "from flexmb.ready.uses import uses\nfor name, use in uses():\n    use()"
    assert compiled(tmp_path, program) == []


@at_hand
@pytest.mark.slow
@pytest.mark.parametrize("at_once", [1, 2])
def test_making_them_again_keeps_what_is_right_and_nothing_else(at_once: int, tmp_path: Path) -> None:
    """A kernel that nobody asks for goes, however young it says it is; one that is missing, or damaged, is made."""
    package = tmp_path / "flexmb"
    shutil.copytree(Path(flexmb.__file__).parent, package)
    folder = package / "ready" / "kernels"
    files = sorted(folder.glob(KERNELS), key=lambda file: file.stat().st_size)
    right = {file.name: file.read_bytes() for file in files}
    (folder / "unknown-00.kernel").write_bytes(b"of an older state")
    os.utime(folder / "unknown-00.kernel", (2**32, 2**32))  # by a clock that was set back since
    files[0].unlink()
    files[1].write_bytes(b"damaged")
    command = [sys.executable, "-m", "flexmb.ready.make", str(folder)]
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    made = [subprocess.Popen(command, env=environment, cwd=tmp_path) for _ in range(at_once)]
    assert [each.wait() for each in made] == [0] * at_once
    again = {file.name: file.read_bytes() for file in folder.glob(KERNELS)}
    assert set(again) == set(right)
    assert {name for name in right if again[name] != right[name]} <= {files[0].name, files[1].name}
