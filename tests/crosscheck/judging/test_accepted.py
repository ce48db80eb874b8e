"""Accepted figures: a loss of digits is noticed, noise is not; what is wrong is never accepted."""

import math
import re
import tomllib
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Effort
from crosscheck.engines.registry import BUILT_IN, engines
from crosscheck.judging import accept, sizes, uncertainty
from crosscheck.judging import basis as basis_module
from crosscheck.judging import outcome as outcome_module
from crosscheck.judging.basis import written
from crosscheck.judging.figures import FLOOR, figures, recordable, worse
from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.rule import rule
from crosscheck.library.accepted import Accepted, Figure, dumps, key, merged
from crosscheck.library.case import CaseError, Comparison, Conservation
from crosscheck.library.find import Case, load_case
from crosscheck.records.kinds import RunRecord
from crosscheck.report import junit
from crosscheck.report.ci import write_summary
from crosscheck.report.junit import write_junit
from crosscheck.running.plan import prescribed, sample_times, scene_basis, variant_scene
from flexmb.run import rounding
from tests.crosscheck.made_records import ONE_PAIR, TIP, judged, ladder, single, way
from tests.crosscheck.sessions import copy_case, shipped, sweep_here

PLACE = key(TIP, ("one", "rigid"), ("two", "rigid"))
WIDE = {"COLUMNS": "200"}


@pytest.mark.parametrize(
    ("E", "U", "grown"),
    [
        (1e-9, 1e-8, ""),
        (9e-8, 9.9e-8, ""),  # E is noise below U: all of it may be there on another machine
        (0.0, 0.0, ""),
        (1e-9, 1.1e-7, "U is 1.1e-07, accepted were 1.0e-08"),
        (1.1e-7, 1e-8, "E is 1.1e-07, accepted were 1.0e-09"),
        (1e-5, 1e-5, "U is 1.0e-05, accepted were 1.0e-08; E is 1.0e-05, accepted were 1.0e-09"),
        (math.nan, 1e-8, "E is nan, accepted were 1.0e-09"),
        (1e-9, math.nan, "U is nan, accepted were 1.0e-08"),
        (1e-9, math.inf, "U is inf, accepted were 1.0e-08"),
        (None, None, "accepted with E 1.0e-09, and now there is no figure at all"),
    ],
)
def test_growth_by_more_than_ten_is_worse(E: float | None, U: float | None, grown: str) -> None:
    assert worse(Figure(1e-9, 1e-8), E, U) == grown


def test_growth_within_rounding_is_none() -> None:
    assert worse(Figure(0.0, 0.0), 9.9 * FLOOR, 9.9 * FLOOR) == ""
    assert worse(Figure(0.0, 0.0), 1e-17, 10.1 * FLOOR) != ""
    assert worse(Figure(1e-17), 10.1 * FLOOR, None) != ""
    assert pytest.approx(2.2e-13, rel=0.01) == FLOOR


def test_what_has_no_accepted_figure_is_not_worse() -> None:
    assert worse(None, 1.0, math.nan) == ""


def session(accepted: Accepted, spread: float = 1e-6, strict: bool = False) -> SessionOutcome:
    runs = [*ladder("one", {TIP: way()}, spread=spread), *ladder("two", {TIP: way()}, spread=spread)]
    return judged(ONE_PAIR, runs, accepted, strict)


@pytest.fixture
def own(monkeypatch: pytest.MonkeyPatch) -> None:
    """The engines of these tests are the library's own."""
    for module in (outcome_module, junit, accept):
        monkeypatch.setattr(module, "BUILT_IN", ("one", "two", "fine", "stepper"))


def test_a_loss_of_three_digits_is_a_warning_and_an_error_where_that_is_asked_for(own: None, tmp_path: Path) -> None:
    then = figures(session({}, 1e-9).all, ("one", "two"))
    assert list(then) == ["both"] and list(then["both"]) == [PLACE]
    assert session(then, 1e-9, strict=True).ok
    lost = session(then, 1e-6)
    assert (lost.ok, lost.headline) == (True, "All 1 verdicts are as expected, 1 of them worse than recorded")
    strictly = session(then, 1e-6, strict=True)
    assert (strictly.ok, strictly.headline) == (False, "1 of 1 verdicts are worse than recorded")
    assert single(lost).worse.startswith("U is 5.4e-05, accepted were 5.4e-08")
    for outcome, failures in ((lost, "0"), (strictly, "1")):
        write_summary(outcome, tmp_path / "summary.md")
        assert "## Worse than recorded" in (tmp_path / "summary.md").read_text(encoding="utf-8")
        write_junit(outcome, tmp_path / "junit.xml")
        (suite,) = ElementTree.parse(tmp_path / "junit.xml").getroot()
        assert suite.get("failures") == failures
        assert "worse than recorded: U is" in suite[0].find("system-out").text


def test_a_channel_without_accepted_figures_says_so_where_that_is_asked_for(own: None, tmp_path: Path) -> None:
    assert session({}).ok
    strictly = session({}, strict=True)
    assert (strictly.ok, strictly.headline) == (False, "1 of 1 verdicts have no accepted figures")
    write_summary(strictly, tmp_path / "summary.md")
    assert "## No accepted figures" in (tmp_path / "summary.md").read_text(encoding="utf-8")
    write_junit(strictly, tmp_path / "junit.xml")
    assert "no accepted figures" in (tmp_path / "junit.xml").read_text(encoding="utf-8")


def test_foreign_engines_have_no_accepted_figures() -> None:
    outcome = session({}, strict=True)
    assert outcome.ok
    assert figures(outcome.all, ("one",)) == {}
    assert not recordable(single(outcome), ("two",))


def test_what_is_not_as_expected_is_not_called_worse(own: None) -> None:
    runs = [*ladder("one", {TIP: way()}), *ladder("two", {TIP: way(2.0)})]
    outcome = judged(ONE_PAIR, runs, {"both": {PLACE: Figure(1e-9, 1e-9)}}, strict=True)
    assert (outcome.worse, outcome.headline) == ([], "1 of 1 verdicts are not as expected")


# What a figure stands on: what is another than it was accepted with, and how that is told.
OTHER = {
    "the same": ({}, ""), "efforts": ({"effort_value": 1e-9}, "other efforts"),
    "version": ({"version": "2"}, "another version of an engine"), "scene": ({}, "another scene, times or scale"),
    "scale": ({}, "another scene, times or scale"), "rule": ({}, "another rule for E and U"),
    "our own code": ({"made_by": "edited"}, ""),
}  # fmt: skip


@pytest.mark.parametrize("what", OTHER)
def test_a_figure_of_another_basis_is_stale_and_not_worse(
    own: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, what: str
) -> None:
    """Three digits are lost. That is the engine's fault only where all that the figure stands on is as it was."""

    def runs(spread: float, **changes: object) -> list[RunRecord]:
        found = [*ladder("one", {TIP: way()}, spread=spread), *ladder("two", {TIP: way()}, spread=spread)]
        finest_only = "effort_value" in changes
        return [msgspec.structs.replace(run, **changes) if run.rung == 2 or not finest_only else run for run in found]

    then = figures(judged(ONE_PAIR, runs(1e-9), basis="as written").all, ("one", "two"))
    assert then["both"][PLACE].of.count(".") == 3 and "-" not in then["both"][PLACE].of
    changes, told = OTHER[what]
    if what == "rule":
        monkeypatch.setattr(basis_module, "rule", lambda: "000000")
    text = ONE_PAIR + 'scales = { "marker:tip.position" = 1.0 }\n' if what == "scale" else ONE_PAIR
    scene = "edited" if what == "scene" else "as written"
    lost = judged(text, runs(1e-6, **changes), then, basis=scene)
    strictly = judged(text, runs(1e-6, **changes), then, strict=True, basis=scene)
    assert lost.ok and not strictly.ok, "beyond an accepted figure a strict session is never green"
    verdict = single(strictly)
    assert verdict.stale == told
    if not told:
        assert (len(lost.worse), lost.stale) == (1, []) and strictly.headline.endswith("worse than recorded")
        return
    assert (lost.worse, len(lost.stale)) == ([], 1)
    assert strictly.headline == "1 of 1 verdicts are beyond stale figures: accept them anew"
    assert verdict.grown.startswith(f"stale figure ({told}; accept anew by crosscheck run made/made --accept): U is")
    write_summary(strictly, tmp_path / "summary.md")
    write_junit(strictly, tmp_path / "junit.xml")
    for name in ("summary.md", "junit.xml"):
        said = (tmp_path / name).read_text(encoding="utf-8").replace("\\", "")
        assert f"stale figure ({told}" in said and "worse than recorded" not in said
    held = judged(text, runs(1e-9, **changes), then, strict=True, basis=scene)
    assert held.ok and len(held.stale) == 1, "a stale figure that is not exceeded is told, and no error"


def test_a_figure_is_of_its_two_sides_whichever_other_engines_run(own: None) -> None:
    text = ONE_PAIR.replace('["one", "two"]', '["one", "two", "fine"]')
    runs = [run for name in ("one", "two", "fine") for run in ladder(name, {TIP: way()}, spread=1e-7)]
    some = figures(judged(text, runs, asked=("one", "two"), basis="as written").all, ("one", "two", "fine"))
    every = figures(judged(text, runs, basis="as written").all, ("one", "two", "fine"))
    assert len(every["both"]) == 3 and some["both"] == {PLACE: every["both"][PLACE]}


def test_a_figure_without_a_basis_is_held_against_as_it_always_was(own: None) -> None:
    then = {"both": {PLACE: Figure(1e-9, 1e-8)}}
    assert session(then).worse and not session(then).stale


@pytest.mark.parametrize(
    ("module", "name"),
    [
        *((uncertainty, name) for name in (
            "SAFETY", "UNPROVEN_SAFETY", "ORDER_BAND", "SCATTER", "UNCONTROLLED_SAFETY", "SAME_ORDER",
            "LARGEST_ORDER_IN_WORK", "NO_GROWTH", "EXCESS_GROWTH", "ORDER_CREDIT",
        )),
        (sizes, "LEAST_OF_SCENE"), (sizes, "LEAST_OF_FAMILY"), (rounding, "LEAST_OF_SCENE"), (rounding, "ROUNDINGS"),
        (rounding, "LIKELY"),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:overflow encountered:RuntimeWarning")  # of exponents a million times larger
def test_another_rule_for_uncertainties_is_recognised(
    monkeypatch: pytest.MonkeyPatch, module: ModuleType, name: str
) -> None:
    """Each number that decides on U and on sizes shows in what the rule is recognised by."""
    before = rule.__wrapped__()
    assert before == rule()
    found = set()
    for factor in (0.25, 0.9, 1.1, 4.0, 2.0**20):
        monkeypatch.setattr(module, name, factor * getattr(module, name))
        found.add(rule.__wrapped__())
        monkeypatch.undo()
    assert found != {before}


def test_the_figures_of_the_library_are_none_of_another_rule_and_of_no_other_scene() -> None:
    """Where one is, take all of its case anew, `crosscheck run CASE --accept`; look at what becomes worse, and why."""
    stale = []
    for case in shipped():
        ladder, scene = cache(partial(ladder_of, case)), cache(partial(scene_of, case))
        for item in (*case.run.comparisons, *case.run.conservations):
            for place, figure in case.accepted.get(name_of(item), {}).items():
                sides = [side for side in SIDE.findall(place) if side[0] in BUILT_IN]
                efforts = [ladder(engine, variant) for engine, variant in sides]
                now = written([scene(variant) for _, variant in sides], efforts, "", scales_of(item))
                if figure.of.split(".")[:3] != now.split(".")[:3]:
                    stale.append((case.name, place, figure.of, now))
    assert not stale, stale[:5]


SIDE = re.compile(r" \| ([\w-]+) \((.*?)\)(?= \||$)")


def name_of(item: Comparison | Conservation) -> str:
    return f"{item.quantity.replace('_', ' ')} conserved" if isinstance(item, Conservation) else item.name


def scales_of(item: Comparison | Conservation) -> object:
    return item.scale if isinstance(item, Conservation) else item.scales


def scene_of(case: Case, variant: str) -> str:
    return scene_basis(case, case.run.variant(variant))


def ladder_of(case: Case, engine: str, name: str) -> list[tuple[str, str, str]]:
    """The efforts that an engine will climb: those of the case, or its own."""
    variant = case.run.variant(name)
    efforts: Sequence[Effort] = prescribed(variant, engine)
    if not efforts:
        scene = variant_scene(case.scene(variant), variant)
        duration_s = float(np.ptp(sample_times(case.run, variant)))
        efforts = CheckedEngine(engines()[engine], duration_s=duration_s).efforts(scene)
    return [(effort.kind, effort.method, f"{effort.value:.6g}") for effort in efforts]


def test_a_partial_run_keeps_the_figures_of_others() -> None:
    before = {"a": {"x": Figure(1.0), "y": Figure(1.0)}, "b": {"x": Figure(1.0)}}
    now = {"a": {"x": Figure(2.0)}, "c": {"x": Figure(2.0)}}
    assert merged(before, now) == {
        "a": {"x": Figure(2.0), "y": Figure(1.0)}, "b": {"x": Figure(1.0)}, "c": {"x": Figure(2.0)},
    }  # fmt: skip


def test_the_file_is_stable_sorted_and_read_back() -> None:
    accepted = {
        'two "quoted"\x7f': {"b | one (v) | two (v)": Figure(1.24e-9, 2e-8)},
        "a": {"z": Figure(1e-3), "y": Figure(0.0)},
    }
    text = dumps(accepted)
    found = msgspec.convert(tomllib.loads(text), Accepted)
    assert found == {**accepted, 'two "quoted"\x7f': {"b | one (v) | two (v)": Figure(1.2e-9, 2e-8)}}
    assert dumps(found) == text
    assert text.index('"y"') < text.index('"z"') < text.index("quoted")


def test_accepting_and_being_strict_on_the_command_line(
    own: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Accept, pass strictly; loosen an effort by three digits, warn, fail strictly; break a thing, accept nothing."""
    monkeypatch.setattr("crosscheck.running.sweep.sweep", sweep_here)
    monkeypatch.setattr(cli.common.console, "_width", 200)
    folder = copy_case(tmp_path)
    file, run = folder / "accepted.toml", folder / "run.toml"

    def crosscheck(*words: str) -> tuple[int, str]:
        out = ["--out", str(tmp_path / "out"), "--jobs", "2"]
        result = CliRunner().invoke(cli.common.app, ["run", str(folder), *words, *out], env=WIDE)
        return result.exit_code, result.output

    code, output = crosscheck("--strict")
    assert (code, "13 of 15 verdicts have no accepted figures" in output) == (1, True), output
    code, output = crosscheck("--accept", "--strict")
    assert (code, "13 figures accepted: review" in output) == (0, True), output
    assert len(load_case(folder).accepted["rigid, all engines"]) == 11
    assert crosscheck("--strict")[0] == 0
    page = next((tmp_path / "out" / "report").glob("*/*.html")).read_text(encoding="utf-8")
    assert "(accepted: E" in page

    text = run.read_text(encoding="utf-8")
    loose = 'efforts = [{ engine = "fine", kind = "tolerance", method = "dop853", values = [1e-5, 1e-6, 1e-7] }]\nnote'
    wide = text.replace("= 1e-6,", "= 1e-2,").replace("= 1e-6 }", "= 1e-2 }").replace("limit = 1e-8", "limit = 1e-3")
    run.write_text(wide.replace("note", loose, 1), encoding="utf-8")
    code, output = crosscheck()
    assert code == 0 and "stale figure (other efforts; accept anew" in output, output
    assert "worse than recorded" not in output, "the loss is of the efforts, which are others than were accepted"
    assert crosscheck("--strict")[0] == 1

    before = file.read_text(encoding="utf-8")
    run.write_text(text.replace('"energy" = 1e-6', '"energy" = 1e-16'), encoding="utf-8")
    code, output = crosscheck("--accept")
    assert (code, "Nothing is accepted" in output) == (1, True), output
    assert file.read_text(encoding="utf-8") == before

    file.write_text(before.replace("rigid, all", "rigid, some"), encoding="utf-8")
    with pytest.raises(CaseError, match="accepted.toml: .*no such comparison"):
        load_case(folder)
    file.write_text(before.replace("E = ", "e = ", 1), encoding="utf-8")
    with pytest.raises(CaseError, match="accepted.toml"):
        load_case(folder)


COARSE = 49
"""Figures of agreements that are uncertain by a hundredth to a fifth: velocities, orientations and loads of beams in
pieces or segments, of redundant coordinates, and beside events, which have goals as coarse and were judged by nothing
before. This number may only fall."""


def test_few_agreements_of_the_library_are_uncertain_by_more_than_a_hundredth() -> None:
    coarse = 0
    for case in shipped():
        for item in case.run.comparisons:
            for which, figure in case.accepted[item.name].items() if item.expect == "agree" else ():
                assert figure.U <= 0.2, (case.name, item.name, which)
                coarse += figure.U > 1e-2
    assert coarse <= COARSE


def test_every_case_of_the_library_has_accepted_figures() -> None:
    assert all(case.accepted for case in shipped())


def test_ten_times_the_figure_is_not_yet_worse() -> None:
    assert worse(Figure(0.0, 0.5), 5.0, 5.0) == ""
    assert worse(Figure(0.5, 0.25), 5.0, 2.5) == ""
    assert (
        worse(Figure(0.5, 0.25), 5.1, 2.6) == "U is 2.6e+00, accepted were 2.5e-01; E is 5.1e+00, accepted were 5.0e-01"
    )
