"""Style, types and import contracts hold."""

from __future__ import annotations

import ast
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


def test_what_is_compiled_asserts_nothing() -> None:
    """Python leaves assertions out with -O, and pytest rewrites them: kernels would be others there.

    A module that compiles imports one of the room jit's marks; what else is in it asserts nothing either.
    """
    marks = {"helper", "kernel", "sweep", "written_out"}
    compiling = 0
    for file in sorted((ROOT / "flexmb").rglob("*.py")):
        nodes = list(ast.walk(ast.parse(file.read_bytes())))
        named = {name.name for node in nodes if isinstance(node, ast.ImportFrom) for name in node.names}
        if marks & named or file.parent.name == "jit":
            compiling += 1
            assert not any(isinstance(node, ast.Assert) for node in nodes), file
    assert compiling > 100
