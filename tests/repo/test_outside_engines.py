"""The adapters of PyBullet and adam-robotics that the pages show: whole, installed, and held to what the pages say.

Their packages are no part of any extra; where one is missing, its tests are skipped.
"""

import json
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.repo.installations import installed_apart
from tests.repo.project import ROOT
from tests.repo.snippets import snippets

SOURCES = ROOT / "docs" / "outside-engines"
PAGES = {"bullet": ROOT / "docs" / "howto" / "pybullet.md", "adam": ROOT / "docs" / "howto" / "adam.md"}
LIBRARIES = {"bullet": "pybullet", "adam": "adam"}
CASE = "pendulums/compound"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the distribution of both adapters is installed."""
    return installed_apart(SOURCES, tmp_path_factory.mktemp("outside"))


def crosscheck(installed: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(installed), str(ROOT), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-c", "from crosscheck.cli import main; main()", *words]
    environment = os.environ | {"PYTHONPATH": path}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def needs(name: str) -> None:
    if find_spec(LIBRARIES[name]) is None:
        pytest.skip(f"{LIBRARIES[name]} is not installed: see {PAGES[name].relative_to(ROOT)}")


@pytest.mark.parametrize("name", PAGES)
def test_a_page_shows_the_whole_adapter(name: str) -> None:
    shown = re.findall(r"```\{literalinclude\} (\S+)", PAGES[name].read_text(encoding="utf-8"))
    files = {(PAGES[name].parent / each).resolve() for each in shown}
    own = {"bullet": "bullet.py", "adam": "adam_robotics.py"}[name]
    assert files == {SOURCES / "outside_engines" / each for each in ("robot.py", own)}


def test_without_its_library_an_engine_says_how_to_install_it(installed: Path, tmp_path: Path) -> None:
    missing = [name for name in PAGES if find_spec(LIBRARIES[name]) is None]
    if not missing:
        pytest.skip("both libraries are installed")
    for name in missing:
        run = crosscheck(installed, tmp_path, "contract", name)
        assert run.returncode == 2 and "is not installed: pip install" in run.stderr, run.stdout + run.stderr


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_it_keeps_the_contract_as_the_page_says(name: str, installed: Path, tmp_path: Path) -> None:
    needs(name)
    run = crosscheck(installed, tmp_path, "contract", name, "--json")
    tried = json.loads(run.stdout)[name]
    broken = {each["clause"]: each["message"] for each in tried["clauses"] if each["status"] == "broken"}
    assert (run.returncode, tried["kept"], broken) == (0, True, {})
    assert tried["headline"] in " ".join(PAGES[name].read_text(encoding="utf-8").split())


@pytest.mark.slow
@pytest.mark.parametrize("name, words", [
    ("adam", "All 11 verdicts are as expected"), ("bullet", "Richardson, observed order 1.00"),
])  # fmt: skip
def test_a_case_ends_as_the_page_says(name: str, words: str, installed: Path, tmp_path: Path) -> None:
    needs(name)
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    run = crosscheck(installed, tmp_path, "run", CASE, "--engine", name, "--alone")
    assert run.returncode == (0 if name == "adam" else 1), run.stdout + run.stderr
    assert words in " ".join(run.stdout.split()) and words in " ".join(PAGES[name].read_text(encoding="utf-8").split())


@pytest.mark.slow
def test_bullet_is_green_by_the_goal_of_its_page(installed: Path, tmp_path: Path) -> None:
    needs("bullet")
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    (goal,) = (snippet.code for snippet in snippets(PAGES["bullet"]) if snippet.language == "toml")
    (tmp_path / "crosscheck-expect.toml").write_text(goal, encoding="utf-8")
    run = crosscheck(installed, tmp_path, "run", CASE, "--engine", "bullet", "--alone")
    assert run.returncode == 0, run.stdout + run.stderr
    (told,) = re.findall(r'"(All 11 verdicts [^"]+)"', " ".join(PAGES["bullet"].read_text(encoding="utf-8").split()))
    assert told in " ".join(run.stdout.split())
