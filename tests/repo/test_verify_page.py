"""docs/verify.md leads to a verdict: its code is run, and what it writes agrees with the stored reference."""

import re
from pathlib import Path

import pytest

from crosscheck.library.find import load_case, shipped_folder
from crosscheck.verify.against_case import verify_csv
from tests.repo.project import ROOT


def test_the_code_of_the_page_agrees(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (ROOT / "docs" / "verify.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "docs/verify.md", "exec"), {})
    outcome = verify_csv(load_case(shipped_folder() / "wheel_gyrostat" / "torque_free"), tmp_path / "mine.csv")
    assert {verdict.status for verdict in outcome.all} == {"agree"}, [each.reason for each in outcome.all]
    assert len(outcome.all) == 5
