"""Style, types and import contracts hold."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.repo.project import ROOT

CHECKS = {
    "ruff": ["-m", "ruff", "check", "--no-cache", "."],
    "mypy": ["-m", "mypy", "--no-incremental"],
    "import-linter": ["-c", "from importlinter.cli import lint_imports_command as main; main(['--no-cache'])"],
}


@pytest.mark.parametrize("check", CHECKS)
def test_passes(check: str) -> None:
    run = subprocess.run([sys.executable, *CHECKS[check]], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, f"{run.stdout}\n{run.stderr}"
