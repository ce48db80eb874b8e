"""The template of an engine is a distribution that installs, is found, and keeps the contract."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.repo.installations import installed_apart
from tests.repo.project import ROOT

TEMPLATE = ROOT / "docs" / "engine-template"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the template is installed."""
    return installed_apart(TEMPLATE, tmp_path_factory.mktemp("template"))


def test_it_is_found_and_keeps_the_contract(installed: Path, tmp_path: Path) -> None:
    path = os.pathsep.join([str(installed), str(ROOT)])
    words = [sys.executable, "-c", "from crosscheck.cli import main; main()", "contract", "pendulum", "--json"]
    run = subprocess.run(
        words, cwd=tmp_path, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stdout + run.stderr
    tried = json.loads(run.stdout)["pendulum"]
    statuses = {each["clause"]: each["status"] for each in tried["clauses"]}
    assert tried["kept"] and "broken" not in statuses.values()
    for clause in ("a-pendulum-swings", "a-hanging-mass-is-held-up", "a-run-begins-at-the-initial-state"):
        assert statuses[clause] == "holds"
    refused = [each["message"] for each in tried["clauses"] if each["status"] == "not offered"]
    assert refused and all(refused)
