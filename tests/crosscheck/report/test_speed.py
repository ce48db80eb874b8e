"""Speed against accuracy of a whole session: units of time, standings of engines, and what the script is given."""

from __future__ import annotations

import re
from pathlib import Path

import msgspec
import pytest

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.report.speed import REACHED, fastest, standing, unit_of_time
from crosscheck.report.workprecision import Point, WorkPrecision
from tests.crosscheck.report.sessions import MANY, session


def point(engine: str, wall_s: float, error: float | None) -> Point:
    return Point(engine, "rigid", "rtol=1", "dop853", wall_s, 0.0, 1, error, "")


def chart(*points: Point) -> WorkPrecision:
    return WorkPrecision("chart", "marker:tip.position", "the stored reference", 1e-12, 1.0, points)


def test_the_unit_of_time_is_the_fastest_run_that_is_accurate_enough() -> None:
    rough, good, fine = point("a", 0.1, 1e-3), point("b", 2.0, 1e-6), point("a", 5.0, 1e-9)
    assert unit_of_time(chart(rough, good, fine)) == 2.0
    assert unit_of_time(chart(rough)) == 0.1, "where none is, the most accurate one"
    assert unit_of_time(chart(point("a", 3.0, None), point("a", 0.0, 1e-9))) is None
    assert unit_of_time(chart()) is None


def test_an_engine_stands_by_its_fastest_run_in_every_chart() -> None:
    one = chart(point("a", 1.0, 1e-7), point("a", 0.5, 1e-8), point("b", 2.0, 1e-7), point("c", 0.1, 1e-2))
    other = chart(point("a", 3.0, 1e-7), point("b", 1.0, 1e-7), point("b", 9.0, None))
    assert fastest(one, REACHED) == {"a": 0.5, "b": 2.0}
    found = standing([one, other], "a", REACHED)
    assert (found.ratio, found.reached, found.first) == (2.0, 2, 1)
    assert standing([one, other], "b", REACHED).ratio == 2.5
    never = standing([one, other], "c", REACHED)
    assert (never.ratio, never.reached, never.first) == (None, 0, 0)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[SessionOutcome, Path]:
    return session(tmp_path_factory.mktemp("speed"), MANY)


def test_the_index_has_every_run_with_an_error_and_a_way_to_its_chart(written: tuple[SessionOutcome, Path]) -> None:
    text = written[1].read_text(encoding="utf-8")
    assert text.index("Speed against accuracy</h2>") < text.index("Cases and engines</h2>")
    (data,) = re.findall(r'<script type="application/json" id="speed-data">(.*?)</script>', text, flags=re.DOTALL)
    found = msgspec.json.decode(data)
    (drawn,) = found["charts"]
    assert drawn["link"] == "pendulum/single.html#case-0-speed" and drawn["unit_s"] > 0.0
    assert {each["engine"] for each in drawn["points"]} == {"fine", "stepper"}, "what diverged has no error"
    assert all(each["error"] >= drawn["doubt"] > 0.0 for each in drawn["points"])
    assert set(found["engines"]) == {"fine", "stepper", "diverger"} and found["engines"][-1] == "diverger"
    assert "not reached" in text.partition("Charts by case")[2]


def test_a_session_without_a_chart_has_no_such_section(tmp_path: Path) -> None:
    _, index = session(tmp_path, re.sub(r"\[\[chart\]\]\n(.+\n)+", "", MANY))
    assert "Speed against accuracy</h2>" not in index.read_text(encoding="utf-8")
