"""What tests of several families of cases share: their closed forms, and their negative controls in a session."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

from crosscheck.library.find import load_case
from crosscheck.report import write_all
from crosscheck.running.sweep import sweep
from tests.crosscheck.sessions import here
from tests.repo.project import ROOT

CASES = ROOT / "cases"


def closed_form(case: str) -> ModuleType:
    """The module exact.py of a case, "family/name"."""
    spec = spec_from_file_location(case, CASES / case / "exact.py")
    assert spec and spec.loader
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def noticed_controls(case: str, folder: Path) -> set[str]:
    """Names of a case's controls, all of which native code, Pinocchio and MuJoCo notice in a session as expected."""
    for module in ("pinocchio", "mujoco"):
        pytest.importorskip(module)
    records = folder / "records.jsonl"
    sweep([load_case(CASES / case)], ("native", "pinocchio", "mujoco"), records, scheduler=here)
    outcome, _ = write_all(records, folder)
    controls = [verdict for verdict in outcome.all if verdict.kind == "control"]
    assert all(verdict.status == "differ" for verdict in controls)
    assert outcome.ok, outcome.headline
    return {verdict.comparison for verdict in controls}
