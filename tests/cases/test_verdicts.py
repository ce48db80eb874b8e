"""Every case of the library, run by every engine that takes it: each verdict is the one that its file expects, within
its bounds, and no figure is worse than the accepted one."""

from pathlib import Path

import pytest

from crosscheck.library.find import Case
from crosscheck.report import write_all
from crosscheck.running.sweep import sweep
from tests.crosscheck.sessions import shipped


@pytest.mark.slow
@pytest.mark.parametrize("case", shipped(), ids=lambda case: case.name)
def test_every_verdict_is_as_expected(case: Case, tmp_path: Path) -> None:
    for library in ("pinocchio", "mujoco", "exudyn"):
        pytest.importorskip(library)
    records = tmp_path / "records.jsonl"
    sweep([case], (), records)
    outcome, _ = write_all(records, tmp_path, strict=True)
    assert outcome.ok, (outcome.headline, outcome.unexpected or outcome.worse or outcome.unrecorded)
