"""What a session leaves behind: a report that needs nothing, and files for people and machines."""

import json
import re
from pathlib import Path
from typing import get_args
from xml.etree import ElementTree

import numpy as np
import pytest

from crosscheck.library.case import Transform, Variant
from crosscheck.library.find import load_case, resolve
from crosscheck.report import SessionOutcome, write_all
from crosscheck.report.case_view import transformation
from crosscheck.report.html import code
from crosscheck.running.plan import plan
from flexmb.view.store import SAMPLES, Store
from tests.crosscheck.report.reading import data_of, series_of
from tests.crosscheck.sessions import CASE, PROVIDER, copy_case, sweep_here, versus

MIXED = (
    versus("fine", "stepper", "absent", "diverger", goals='"marker:tip.position" = 1e-6, "load" = 1e-6')
    + """
[[chart]]
observable = "marker:tip.position"
variants = ["rigid"]
reference = "rigid"
"""
)
FOREIGN = re.compile(r"""(?:src|href)\s*=\s*["'](?!#)|@import|url\(""")


def session(folder: Path, case: Path) -> tuple[SessionOutcome, Path]:
    sweep_here([load_case(case)], (), folder / "records.jsonl")
    return write_all(folder / "records.jsonl", folder)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> tuple[SessionOutcome, Path]:
    return session(tmp_path_factory.mktemp("sound"), CASE)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> tuple[SessionOutcome, Path]:
    folder = tmp_path_factory.mktemp("mixed")
    return session(folder, copy_case(folder, MIXED))


def case_page(index: Path) -> str:
    return (index.parent / "pendulum" / "single.html").read_text(encoding="utf-8")


def test_the_single_file_loads_nothing(sound: tuple[SessionOutcome, Path], tmp_path: Path) -> None:
    _, file = write_all(sound[1].parents[1] / "records.jsonl", tmp_path, single_file=True)
    page = file.read_text(encoding="utf-8")
    markup = re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
    assert file.name == "report.html"
    assert not FOREIGN.search(markup)
    assert page.count("plotly.js (basic - minified) v") == page.count("SPDX-License-Identifier: MIT") == 1
    assert len(page) < 3e6
    assert "All 15 verdicts are as expected" in markup


def test_the_report_names_what_did_not_run_and_why(mixed: tuple[SessionOutcome, Path]) -> None:
    index, page = mixed[1].read_text(encoding="utf-8"), case_page(mixed[1])
    for markup in (index, page):
        assert "the library is not installed; install the extra `absent`" in markup
        assert "diverged at t = 0.9 s" in markup
    assert 'class="cell good"' in page
    row = re.search(r"<th scope=\"row\">Marker positions</th>(.*?)</tr>", page, re.DOTALL).group(1)
    looks = re.findall(r'class="cell (\w+)".*?</span>([a-z ]+)<?', row)
    assert looks[0] == ("good", "agree")
    assert {look for look, status in looks if status in ("did not run", "failed")} == {"bad"}


def test_charts_carry_the_recorded_numbers(mixed: tuple[SessionOutcome, Path]) -> None:
    case = data_of(mixed[1].parent / "pendulum" / "single.data.js")
    panel = next(panel for panel in case["panels"] if panel["title"] == "Motion")
    sides = {side["label"]: side for side in panel["channels"][0]["sides"]}
    assert set(sides) == {"fine", "stepper", "diverger"}

    stored = series_of(case["series"])

    def series(number: int) -> np.ndarray:
        return stored[number]

    assert series(sides["fine"]["times"])[-1] == 2.0
    assert series(sides["diverger"]["times"])[-1] == pytest.approx(0.9)
    assert np.linalg.norm(series(sides["fine"]["values"]), axis=1) == pytest.approx(1.0, abs=1e-6)
    (pair,) = panel["channels"][0]["pairs"]
    assert np.all(series(pair["error"]) <= series(pair["doubt"]))
    (work,) = case["work"]
    assert {point["engine"] for point in work["points"] if point["error"] is None} == {"diverger"}
    (animation,) = case["animations"]
    assert {line["kind"] for line in animation["lines"]} == {"solid", "arm"}


def test_peaks_survive_thinning() -> None:
    store = Store()
    values = np.zeros(10 * SAMPLES)
    values[1234] = 7.0
    number = store.peaks(values)
    thinned = series_of(store.packed())[number]
    assert len(thinned) == SAMPLES
    assert thinned.max() == 7.0


def test_verdicts_json(mixed: tuple[SessionOutcome, Path]) -> None:
    verdicts = json.loads((mixed[1].parents[1] / "verdicts.json").read_text(encoding="utf-8"))
    assert len(verdicts) == len(mixed[0].all)
    needed = {"case", "channel", "engine_a", "engine_b", "level", "status", "expected", "E", "U", "goal", "reason"}
    assert needed <= set(verdicts[0])
    assert all(not verdict["ok"] for verdict in verdicts if verdict["status"] != "agree")


def test_junit_counts_nothing_as_passed_that_did_not_run(mixed: tuple[SessionOutcome, Path]) -> None:
    (suite,) = ElementTree.parse(mixed[1].parents[1] / "junit.xml").getroot()
    tests = suite.findall("testcase")
    passed = [test for test in tests if test.find("failure") is None and test.find("skipped") is None]
    assert len(passed) == sum(verdict.ok for verdict in mixed[0].all) > 0
    assert not any("absent" in test.get("name") or "diverger" in test.get("name") for test in passed)
    kinds = [element.tag for test in tests for element in test]
    assert int(suite.get("tests")) == len(tests)
    assert int(suite.get("failures")) == kinds.count("failure")
    assert int(suite.get("skipped")) == kinds.count("skipped") > 0
    assert any(test.get("name") == "rigid by absent ran" for test in tests)


def test_the_summary_says_it_all(mixed: tuple[SessionOutcome, Path], sound: tuple[SessionOutcome, Path]) -> None:
    bad = (mixed[1].parents[1] / "summary.md").read_text(encoding="utf-8")
    assert bad.startswith("# ❌")
    assert "**did not run** pendulum/single, rigid, absent" in bad
    good = (sound[1].parents[1] / "summary.md").read_text(encoding="utf-8")
    assert good.startswith("# ✅ All 15 verdicts are as expected")
    assert "Not as expected" not in good


def test_backticks_become_code_and_nothing_else_becomes_markup() -> None:
    assert code("as `a < b`, <b>not</b> bold") == "as <code>a &lt; b</code>, &lt;b&gt;not&lt;/b&gt; bold"


@pytest.mark.parametrize("transform", get_args(Transform))
def test_every_transformation_has_words(transform: str) -> None:
    words = transformation(Variant(name="a", engines=("native",), transform=transform, segments=7, pieces=7))
    assert bool(words) == (transform != "none") and ("7" in words) == (transform in ("segments", "substructures"))


@pytest.mark.parametrize("variant", ["pieces", "segments"])
def test_beams_taken_to_pieces_are_drawn_whole(variant: str) -> None:
    """Pieces and segments have one marker at most; the line goes through those of the whole beam."""
    (case,) = resolve(("large_deflection/driven_crank",))
    record, _ = plan(case, ("native",), PROVIDER)
    drawing = record.variants[variant].drawing
    assert drawing is not None
    (line,) = [line for line in drawing.lines if line.body == "beam"]
    assert [point.marker for point in line.points] == ["", "middle", "tip"]
