"""Distributions are complete: a wheel finds its own packages, templates and cases, installed or imported as it is.

An sdist makes the same wheel. The fresh environment borrows the dependencies of this one, so that nothing is fetched.
"""

import json
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from tests.repo.installations import built, said
from tests.repo.project import PYPROJECT, ROOT, is_cache

FROM_WHEEL = """
import pathlib, sys
wheel = pathlib.Path(sys.argv[1])
sys.path.insert(0, str(wheel))
import crosscheck.cli, crosscheck.report, crosscheck.running.sweep, crosscheck.mutation.campaign, flexmb.run.simulate
from crosscheck.library.find import shipped_cases, shipped_folder
assert pathlib.Path(flexmb.__file__).is_relative_to(wheel), flexmb.__file__
assert shipped_folder().is_relative_to(wheel), shipped_folder()
print(*sorted(case.name for case in shipped_cases()))
"""


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


def test_says_that_it_is_typed(wheel: Path) -> None:
    for package in ("flexmb", "crosscheck"):
        assert (wheel / package / "py.typed").exists()


def test_an_sdist_makes_the_same_wheel(wheel: Path, tmp_path: Path) -> None:
    sdist = built("sdist", ROOT, tmp_path / "sdist")
    with tarfile.open(sdist) as packed:
        safely = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}  # Python 3.11.4 and later
        packed.extractall(tmp_path / "unpacked", **safely)
    (source,) = (tmp_path / "unpacked").iterdir()
    pages = "docs/ci.md", "action.yml", "CHANGELOG.md", "CITATION.cff", "LICENSE"
    for name in ("tests/repo/test_wheel.py", ".ci/run", *pages):
        assert (source / name).exists(), name
    again = built("wheel", source, tmp_path / "wheel")
    with zipfile.ZipFile(again) as packed:
        names = {name for name in packed.namelist() if "dist-info" not in name}
    there = {path.relative_to(wheel).as_posix() for path in wheel.rglob("*") if path.is_file()}
    there = {name for name in there if "__pycache__" not in name}  # what ran from it since
    assert names == {name for name in there if "dist-info" not in name}


def test_an_installed_wheel_lists_its_cases(installed: Path, tmp_path: Path) -> None:
    cases = json.loads(said(installed, tmp_path, "crosscheck", "list", "--json"))
    assert {case["name"] for case in cases} >= {"closed_chains/four_bar", "wheel_gyrostat/torque_free"}
    assert not any(Path(case["folder"]).is_relative_to(ROOT) for case in cases)


def test_an_installed_wheel_runs_a_case(installed: Path, tmp_path: Path) -> None:
    """Against its stored reference; what is compiled for it is what the tests have compiled already."""
    run = ("run", "wheel_gyrostat/torque_free", "--engine", "native", "--alone", "--out", "out", "--json")
    results = json.loads(said(installed, tmp_path, "crosscheck", *run))
    assert (results["exit_code"], list(results["cases"])) == (0, ["wheel_gyrostat/torque_free"])


@pytest.mark.parametrize("command", ["crosscheck", "flexmb"])
def test_installed_commands_say_their_version(installed: Path, tmp_path: Path, command: str) -> None:
    assert said(installed, tmp_path, command, "--version").startswith(f"{command} {PYPROJECT['project']['version']}")


def test_the_plug_in_of_pytest_is_found(installed: Path, tmp_path: Path) -> None:
    assert "--crosscheck-engine" in said(installed, tmp_path, "python", "-m", "pytest", "--help")
