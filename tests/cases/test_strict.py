"""All cases, strictly, from a fresh clone: what is called resolved holds for whoever gets it, at its last commit."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.repo.project import ROOT


@pytest.mark.slow
def test_every_case_is_green_strictly_in_a_fresh_clone(tmp_path: Path) -> None:
    """Nine minutes on two cores. What is not committed is not in it."""
    for peer in ("pinocchio", "mujoco", "exudyn"):
        pytest.importorskip(peer)
    if not (ROOT / ".git").exists():
        pytest.skip("this is no clone")
    clone = tmp_path / "clone"
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
    words = ["run", "all", "--strict", "--fresh", "--out", str(tmp_path / "out")]
    done = subprocess.run(
        [sys.executable, "-m", "crosscheck", *words], cwd=clone, env=os.environ | {"PYTHONPATH": str(clone)},
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
