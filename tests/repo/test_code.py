"""Style, types and import contracts hold."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.repo.project import PYPROJECT, ROOT

CHECKS = {
    "ruff": ["-m", "ruff", "check", "--no-cache", "."],
    "mypy": ["-m", "mypy"],  # what it keeps in .mypy_cache saves a minute
    "import-linter": ["-c", "from importlinter.cli import lint_imports_command as main; main(['--no-cache'])"],
}


@pytest.mark.parametrize("check", CHECKS)
def test_passes(check: str) -> None:
    run = subprocess.run([sys.executable, *CHECKS[check]], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, f"{run.stdout}\n{run.stderr}"


CIRCLES = {
    "types": ("from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from flexmb.room import other\n", False),
    "function": ("def ask():\n    from flexmb.room import other\n", False),
    "none": ("", True),
}


@pytest.mark.parametrize("source, kept", CIRCLES.values(), ids=CIRCLES)
def test_a_circle_inside_a_room_breaks_the_contract(tmp_path: Path, source: str, kept: bool) -> None:
    [contract] = [each for each in PYPROJECT["tool"]["importlinter"]["contracts"] if each["type"] == "acyclic_siblings"]
    files = {"flexmb/__init__.py": "", "crosscheck/__init__.py": "", "flexmb/room/__init__.py": ""}
    files |= {"flexmb/room/one.py": source, "flexmb/room/other.py": "from flexmb.room import one\n"}
    lines = [f"{key} = {json.dumps(value)}" for key, value in contract.items()]
    files["pyproject.toml"] = "\n".join(
        ["[tool.importlinter]", 'root_packages = ["flexmb", "crosscheck"]', "[[tool.importlinter.contracts]]", *lines]
    )
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    run = subprocess.run(
        [sys.executable, *CHECKS["import-linter"]], cwd=tmp_path, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
    )  # fmt: skip
    assert (run.returncode == 0) == kept, run.stdout
    assert kept or "No cycles are allowed in flexmb.room" in run.stdout


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


def test_kept_values_take_no_lock() -> None:
    """Only kernels' keys do in Python 3.11, and forks wait for these (`flexmb.jit.once`)."""
    files = [file for name in ("flexmb", "crosscheck") for file in (ROOT / name).rglob("*.py")]
    found = {file.relative_to(ROOT).as_posix() for file in files if "import cached_property" in file.read_text("utf-8")}
    assert len(files) > 100 and found == {"flexmb/jit/cache.py"}
