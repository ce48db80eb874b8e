"""The suite tries the packages that lie beside it, in a checkout, or else those that are installed: never a third."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.repo.project import ROOT

PLACE = "import {package}, sys; sys.stdout.write({package}.__file__)"


@pytest.mark.parametrize("package", ["flexmb", "crosscheck"])
def test_packages_are_those_beside_the_suite_or_else_installed(package: str) -> None:
    """In this process and in those that tests start."""
    beside = ROOT / package / "__init__.py"
    expected = beside if beside.exists() else Path(sysconfig.get_path("purelib"), package, "__init__.py")
    spec = find_spec(package)
    assert spec is not None and spec.origin is not None and Path(spec.origin).samefile(expected)
    started = subprocess.run(
        [sys.executable, "-c", PLACE.format(package=package)], capture_output=True, text=True, check=True, cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert Path(started.stdout).samefile(expected)
