"""The estimate of the remaining time: from recorded runs, corrected by the clock."""

from __future__ import annotations

import msgspec
import pytest

from crosscheck.records.kinds import RunRecord
from crosscheck.running.expected import BESIDES_S, Remaining, expected_seconds
from crosscheck.running.rung import repeats_of

RECORD = RunRecord(
    case="case", variant="rigid", role="main", engine="native", version="1", scene="", status="finished",
    effort="coarse", compile_s=2.0, wall_s=1.0,
)  # fmt: skip


def test_a_job_takes_its_compilation_and_the_latest_run_of_every_effort() -> None:
    older = msgspec.structs.replace(RECORD, wall_s=50.0)
    short = msgspec.structs.replace(RECORD, effort="fine", wall_s=0.01)
    found = expected_seconds([older, "no run", RECORD, short])
    seconds = 2.0 + 1.0 + repeats_of(0.01) * 0.01 + BESIDES_S
    assert found == {("case", "rigid", "main", "native"): pytest.approx(seconds)}


def test_the_clock_corrects_what_was_expected() -> None:
    """Two at a time: 30 s of work were done within 15 s, so that the other 60 s take 30 s."""
    left = Remaining()
    left.expect([(0, 30.0), (1, 45.0), (2, 15.0)])
    assert left.seconds(1.0) is None
    left.ended(0)
    assert left.seconds(15.0) == pytest.approx(30.0)
    left.ended(1)
    left.ended(2)
    assert left.seconds(40.0) == 0.0


def test_a_job_that_nobody_knows_is_an_average_one() -> None:
    left = Remaining()
    left.expect([(0, 10.0), (1, 30.0), (2, None)])
    left.ended(0)
    assert left.seconds(1.0) == pytest.approx(30 / 10 + 20 / 10)
    nothing_known = Remaining()
    nothing_known.expect([(0, None), (1, None)])
    nothing_known.ended(1)
    assert nothing_known.seconds(7.0) == pytest.approx(7.0)
