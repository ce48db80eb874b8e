"""A wheel is complete: imported from outside the checkout, it finds its own packages, templates and cases."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.repo.project import ROOT, is_cache

FROM_WHEEL = """
import pathlib, sys
wheel = pathlib.Path(sys.argv[1])
sys.path.insert(0, str(wheel))
import crosscheck.cli, flexmb
from crosscheck.library.find import shipped_cases, shipped_folder
assert pathlib.Path(flexmb.__file__).is_relative_to(wheel), flexmb.__file__
assert shipped_folder().is_relative_to(wheel), shipped_folder()
print(*sorted(case.name for case in shipped_cases()))
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An unpacked wheel of this checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (archive,) = folder.glob("*.whl")
    with zipfile.ZipFile(archive) as packed:
        packed.extractall(folder / "unpacked")
    return folder / "unpacked"


def test_ships_the_packages_and_nothing_else(wheel: Path) -> None:
    tops = {path.name for path in wheel.iterdir() if not path.name.endswith(".dist-info")}
    assert tops == {"flexmb", "crosscheck"}


def test_ships_every_case(wheel: Path) -> None:
    outside = wheel.parent
    command = [sys.executable, "-c", FROM_WHEEL, str(wheel)]
    run = subprocess.run(command, cwd=outside, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    expected = sorted(f"{p.parent.parent.name}/{p.parent.name}" for p in (ROOT / "cases").glob("*/*/run.toml"))
    assert expected and run.stdout.split() == expected


def test_ships_every_data_file(wheel: Path) -> None:
    def data(root: Path) -> set[Path]:
        files = (path.relative_to(root) for path in root.rglob("*") if path.is_file())
        return {path for path in files if not is_cache(path)}

    for package in ("flexmb", "crosscheck"):
        assert data(ROOT / package) <= data(wheel / package)
    assert data(wheel / "crosscheck" / "cases") == data(ROOT / "cases")
