"""What a user claims and expects of an engine, within which bounds: which verdicts it changes, and that none becomes
green in silence.
"""

import itertools
import math
from pathlib import Path

import msgspec
import numpy as np
import pytest

from crosscheck.judging.case_verdicts import outside
from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.question import Question
from crosscheck.judging.verdict import Ending, Finding
from crosscheck.library.case import Comparison
from crosscheck.library.claims import ClaimedEfforts, ClaimedFailure, ClaimedGoals, Claims
from crosscheck.records.kinds import RunRecord
from crosscheck.records.packing import pack
from crosscheck.report.ci import write_summary
from tests.crosscheck.made_records import ONE_PAIR, PAIR, TIMES, TIP, ended, judged, ladder, single, way

ROUGH = 1e-2  # U is a few times this part of the range: far above the goal of 1e-3
PLACE = "crosscheck-expect.toml: $.goal[0]"
CONSERVED = """
[[variant]]
name = "rigid"
engines = ["one"]

[[conservation]]
variant = "rigid"
quantity = "linear_momentum"
limit = 1e-3
"""


def runs(spread: float = ROUGH, apart: float = 0.0) -> list[RunRecord]:
    return [*ladder("one", {TIP: way(1.0 + apart)}), *ladder("two", {TIP: way()}, spread=spread)]


def goals(number: float, pattern: str = "*", engine: str = "two", **others: object) -> ClaimedGoals:
    return ClaimedGoals(engine=engine, place=PLACE, goals={pattern: number}, reason="of first order", **others)


def failure(status: str = "differ", channel: str = "*", engine: str = "two", **others: object) -> ClaimedFailure:
    return ClaimedFailure(engine=engine, place="f[0]", channels=(channel,), status=status, reason="issue 1", **others)


def session(records: list[RunRecord], text: str = ONE_PAIR, **claims: object) -> SessionOutcome:
    return judged(text, records, claims=Claims(**claims))


def test_a_looser_goal_is_enough_and_is_told_everywhere(tmp_path: Path) -> None:
    assert single(session(runs())).status == "unresolved"
    outcome = session(runs(), goals=(goals(0.5),))
    verdict = single(outcome)
    assert outcome.ok and verdict.loosened and (verdict.goal, verdict.case_goal) == (0.5, 1e-3)
    assert verdict.goal_reason == "two: of first order"
    assert outcome.headline == "All 1 verdicts are as expected, 1 of them by goals looser than the case's"
    write_summary(outcome, tmp_path / "summary.md")
    assert "goal 0.5 instead of 0.001: two: of first order" in (tmp_path / "summary.md").read_text(encoding="utf-8")


def test_no_goal_makes_results_agree_that_are_further_apart_than_their_uncertainty() -> None:
    assert single(session(runs(spread=1e-6, apart=0.01), goals=(goals(1.0),))).status == "differ"


@pytest.mark.parametrize("number", [math.nan, math.inf, -1.0, 0.0, 2.0])
def test_a_goal_that_is_none_agrees_with_nothing(number: float) -> None:
    """The file is checked before; a record may be damaged."""
    outcome = session(runs(), goals=(goals(number),))
    assert not outcome.ok and single(outcome).status == "unresolved"


def test_a_tighter_goal_is_judged_and_is_no_loosening() -> None:
    verdict = single(session(runs(), goals=(goals(1e-5),)))
    assert (verdict.status, verdict.goal, verdict.loosened) == ("unresolved", 1e-5, False)


def test_the_most_specific_pattern_counts_of_equal_ones_the_last_and_of_two_engines_the_larger() -> None:
    def goal(*given: ClaimedGoals) -> float:
        return single(session(runs(), goals=given)).goal

    assert goal(goals(0.1, TIP), goals(0.2, "marker"), goals(0.3)) == 0.1
    assert goal(goals(0.1), goals(0.2)) == 0.2
    assert goal(goals(0.1), goals(0.2, engine="one")) == goal(goals(0.2), goals(0.1, engine="one")) == 0.2
    assert goal(goals(0.1, "load")) == goal(goals(0.1, engine="three")) == 1e-3


def test_a_claimed_goal_is_the_limit_of_a_drift_too() -> None:
    momentum = np.ones((11, 3))
    momentum[5] = 0.99
    records = ladder("one", {"momentum.linear": momentum})
    assert single(judged(CONSERVED, records)).status == "differ"
    kept = session(records, CONSERVED, goals=(goals(0.05, "momentum", "one"),))
    assert kept.ok and single(kept).loosened
    assert not session(records, CONSERVED, goals=(goals(0.005, "momentum", "one"),)).ok


def test_controls_keep_the_goals_and_expectations_of_the_case() -> None:
    text = ONE_PAIR + """
[[control]]
name = "fault"
mutation = "mass"
target = "rod"
a = { variant = "rigid", engine = "one" }
b = { variant = "rigid", engine = "two" }
goals = { "marker:tip.position" = 1e-3 }
"""
    records = [*runs(1e-6), *ladder("one", {TIP: way(1.5)}, role="control:fault")[-1:]]
    outcome = session(records, text, goals=(goals(0.9),), failures=(failure(channel="load"),))
    (control,) = [verdict for verdict in outcome.all if verdict.kind == "control"]
    assert (control.goal, control.case_goal, control.expected, control.ok) == (1e-3, None, "differ", True)


def test_an_expected_failure_is_strict() -> None:
    wrong, right = runs(spread=1e-6, apart=0.01), runs(spread=1e-6)
    expected = session(wrong, failures=(failure(),))
    assert expected.ok and single(expected).own_failure == "f[0]"
    assert expected.headline.endswith(", 1 of them failures that you expect")
    mended = session(right, failures=(failure(),))
    assert not mended.ok and single(mended).status == "agree" and single(mended).expected == "differ"
    other = session(wrong, failures=(failure("unresolved"),))
    assert not other.ok
    assert session(wrong, failures=(failure("unresolved"), failure())).ok, "the last counts"


@pytest.mark.parametrize("status", ["crashed", "did not finish", "did not run"])
def test_what_died_is_never_an_expected_failure(status: str) -> None:
    records = [*ladder("one", {TIP: way()}), ended(ladder("two", {TIP: way()})[-1], status)]
    assert not session(records, failures=(failure("failed"), failure("differ"))).ok


@pytest.mark.parametrize("status", ["refused", "diverged", "failed"])
def test_an_ending_may_be_expected(status: str) -> None:
    records = [*ladder("one", {TIP: way()}), ended(ladder("two", {TIP: way()})[-1], status)]
    assert single(session(records, failures=(failure(status),))).ok
    assert not single(session(records)).ok


def test_what_the_case_itself_expects_stays() -> None:
    text = ONE_PAIR + 'expect = "differ"\nband = { "marker:tip.position" = [1e-3, 1e-1] }\nreason = "a bend"\n'
    verdict = single(session(runs(1e-6, 0.01), text, failures=(failure("unresolved"),)))
    assert verdict.ok and (verdict.expected, verdict.own_failure) == ("differ", "")


def test_a_pattern_that_names_nothing_is_an_error_if_all_its_cases_were_run() -> None:
    idle = session(runs(1e-6), goals=(goals(0.1, "wheel_load", whole=True),))
    assert not idle.ok and idle.idle_claims == (
        f'{PLACE}: "wheel_load" names no channel of two that is judged: correct it',
    )
    assert "1 of your own expectations name nothing" in idle.headline
    assert not session(runs(1e-6), failures=(failure(channel="load:elbow", whole=True),)).ok
    assert session(runs(1e-6), goals=(goals(0.1, "wheel_load"),)).ok, "another case may have it"
    assert session(runs(1e-6), goals=(goals(0.1, "marker", whole=True),)).ok
    lost = [*ladder("one", {TIP: way()}), ended(ladder("two", {TIP: way()})[-1], "diverged")]
    assert session(lost, goals=(goals(0.1, "load", whole=True),)).idle_claims == (), "what it would offer is not known"


def test_a_finer_effort_is_advised_that_will_do() -> None:
    """U of tolerances a decade apart falls by a decade for each effort more, until the goal is out of reach."""
    command = "add finer efforts: crosscheck run made/made --engine two --efforts two="
    verdict = single(session(runs(1e-3)))
    assert verdict.advice == command + "1e-09,1e-10" and verdict.U is not None and 1e-2 < verdict.U < 1e-1
    already = Claims(efforts=(ClaimedEfforts(engine="two", place="p", values=(1e-7, 1e-8)),))
    assert single(judged(ONE_PAIR, runs(1e-3), claims=already)).advice == command + "1e-07,1e-08,1e-09,1e-10"
    beyond = single(session(runs(1e-3), goals=(goals(1e-12),)))
    assert "claim what it reaches, such as --goal two=0." in beyond.advice
    nothing_resolved = single(session(runs(1e-1), goals=(goals(1e-12),)))
    assert nothing_resolved.advice == command + "1e-09,1e-10,1e-11"
    assert single(session(runs(1e-6))).advice == single(session(runs(1e-6, 0.01))).advice == ""


def test_a_broken_question_of_claims_would_be_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The planted fault: claims of the other engine are taken for its own."""
    monkeypatch.setattr(Question, "goal", lambda self, channel, goal: goal)
    assert single(session(runs(), goals=(goals(0.5),))).status == "unresolved"


ODD = (None, -math.inf, -1.0, 0.0, 5e-324, 1e308, math.inf, math.nan)


def expecting(expect: str, **bounds: object) -> Comparison:
    return Comparison(name="c", goals={TIP: 1e-3}, expect=expect, reason="so", **bounds)


def differing(by: float, band: str) -> SessionOutcome:
    """Two engines, the second off by that part of the range, and an expected difference."""
    text = ONE_PAIR + f'expect = "differ"\nband = {{ {band} }}\nreason = "so"\n'
    return judged(text, [*ladder("one", {TIP: way()}), *ladder("two", {TIP: way(1.0 + by)})])


@pytest.mark.parametrize(("by", "ok"), [(0.1, True), (0.2, True), (0.02, False), (0.6, False), (10.0, False)])
def test_a_difference_beyond_its_band_is_not_as_expected(by: float, ok: bool) -> None:
    verdict = single(differing(by, f'"{TIP}" = [0.05, 0.3]'))
    assert (verdict.status, verdict.ok, bool(verdict.outside)) == ("differ", ok, not ok)
    assert ok or "is outside the expected 0.05 to 0.3" in verdict.reason


def test_the_most_specific_band_counts() -> None:
    assert single(differing(0.1, f'"marker" = [1e-6, 1e-5], "{TIP}" = [0.05, 0.3]')).ok
    assert not single(differing(0.1, f'"marker" = [0.05, 0.3], "{TIP}" = [1e-6, 1e-5]')).ok


@pytest.mark.parametrize(("reached", "ok"), [(6, True), (3, False), (9, False)])
def test_a_divergence_at_another_time_is_not_as_expected(reached: int, ok: bool) -> None:
    text = ONE_PAIR + 'expect = "diverged"\ndiverged_s = [0.35, 0.55]\nreason = "so"\n'
    two = ladder("two", {TIP: way()})
    cut = {"times": pack(TIMES[:reached]), "channels": {TIP: pack(way()[:reached])}}
    two[-1] = ended(two[-1], "diverged", **cut)
    verdict = single(judged(text, [*ladder("one", {TIP: way()}), *two]))
    assert (verdict.status, verdict.ok) == ("diverged", ok)
    assert f"diverged at t = {TIMES[reached - 1]:.4g} s" in verdict.reason


def test_of_two_that_diverge_both_must_do_so_in_time() -> None:
    text = ONE_PAIR + 'expect = "diverged"\ndiverged_s = [0.35, 0.55]\nreason = "so"\n'
    runs = {}
    for engine, reached in (("one", 6), ("two", 6), ("early", 3)):
        cut = {"times": pack(TIMES[:reached]), "channels": {TIP: pack(way()[:reached])}}
        runs[engine] = [ended(run, "diverged", **cut) for run in ladder(engine, {TIP: way()})]
    assert single(judged(text, runs["one"] + runs["two"])).ok
    early = [msgspec.structs.replace(run, engine="two") for run in runs["early"]]
    assert not single(judged(text, runs["one"] + early)).ok


@pytest.mark.parametrize("status", ["failed", "refused"])
@pytest.mark.parametrize(("message", "ok"), [("revolute hinges are beyond it", True), ("no license", False)])
def test_another_reason_is_not_as_expected(status: str, message: str, ok: bool) -> None:
    text = ONE_PAIR + f'expect = "{status}"\nbecause = "beyond it"\nreason = "so"\n'
    blank = ended(ladder("two", {TIP: way()})[-1], status, message, effort="", times=None, channels={})
    verdict = single(judged(text, [*ladder("one", {TIP: way()}), blank]))
    assert (verdict.status, verdict.ok) == (status, ok)


@pytest.mark.parametrize("status", ["crashed", "did not finish", "diverged"])
def test_a_crash_is_no_expected_failure(status: str) -> None:
    text = ONE_PAIR + 'expect = "failed"\nbecause = "for a reason"\nreason = "so"\n'
    blank = ended(ladder("two", {TIP: way()})[-1], status, effort="", times=None, channels={})
    verdict = single(judged(text, [*ladder("one", {TIP: way()}), blank]))
    assert (verdict.status, verdict.ok) == (status, False)


def test_an_expected_lack_of_resolution_is_bounded_too() -> None:
    text = ONE_PAIR.replace("1e-3", "1e-6") + f'expect = "unresolved"\nband = {{ "{TIP}" = [BAND] }}\nreason = "so"\n'
    for band, ok in (("1e-5, 1e-4", True), ("1e-7, 1e-6", False), ("1e-3, 1e-2", False)):
        verdict = single(judged(text.replace("BAND", band), PAIR))
        assert (verdict.status, verdict.ok) == ("unresolved", ok)


def test_bounds_are_total() -> None:
    """No figure that is no number is within any bounds, and no bounds that are no numbers hold any figure."""
    for low, high, figure in itertools.product(ODD[1:], ODD[1:], ODD):
        finite = figure is not None and math.isfinite(figure) and low <= figure <= high
        for expect, found in (
            ("differ", Finding("differ", "", figure, 1.0)),
            ("unresolved", Finding("unresolved", "", 1.0, figure)),
        ):
            within = outside(expecting(expect, band={TIP: (low, high)}), TIP, found) == ""
            assert within == (figure is not None and low <= figure <= high)
            assert within <= (finite or figure in (math.inf, -math.inf))
        ending = Finding("diverged", "", endings=(Ending("diverged", "", figure),))
        assert (outside(expecting("diverged", diverged_s=(low, high)), TIP, ending) == "") == within
    for expect in ("differ", "unresolved", "diverged", "failed", "refused"):
        assert "sets no bounds" in outside(expecting(expect), TIP, Finding(expect, "so", 1.0, 1.0))
    assert outside(expecting("agree"), TIP, Finding("agree", "so", 1.0, 1.0)) == ""


def test_a_reason_without_endings_is_the_findings_own() -> None:
    refused = Finding("refused", "two does not offer energy.total")
    assert outside(expecting("refused", because="does not offer"), TIP, refused) == ""
    assert outside(expecting("refused", because="cannot"), TIP, refused) == 'the expected reason is "cannot"'


def test_what_is_outside_is_named_with_its_figures() -> None:
    """What was measured, what was expected of it, and which bound the case lacks."""
    late = Finding("diverged", "so", endings=(Ending("diverged", "so", 7.0),))
    untimed = Finding("diverged", "so", endings=(Ending("diverged", "so"),))
    failed = Finding("failed", "no luck")
    vague = Finding("unresolved", "so", 1e-9, 0.5, 1.0)
    for item, finding, said in (
        (
            expecting("differ", band={TIP: (1.0, 2.0)}),
            Finding("differ", "so", 3.0),
            "E = 3 is outside the expected 1 to 2",
        ),
        (expecting("differ"), Finding("differ", "so", 3.0), "the case sets no bounds to E"),
        (expecting("unresolved", band={TIP: (1.0, 2.0)}), vague, "U = 0.5 is outside the expected 1 to 2"),
        (expecting("unresolved"), vague, "the case sets no bounds to U"),
        (
            expecting("unresolved", band={TIP: (1.0, 2.0)}),
            Finding("unresolved", "so"),
            "there is no figure for U, expected is 1 to 2",
        ),
        (expecting("diverged", diverged_s=(1.0, 2.0)), late, "the time reached (s) = 7 is outside the expected 1 to 2"),
        (
            expecting("diverged", diverged_s=(1.0, 2.0)),
            untimed,
            "there is no figure for the time reached (s), expected is 1 to 2",
        ),
        (expecting("failed"), failed, "the case sets no bounds to the reason"),
        (expecting("failed", because="license"), failed, 'the expected reason is "license"'),
        (expecting("failed", because="luck"), failed, ""),
        (expecting("agree"), Finding("agree", "so", 0.0, 0.0), ""),
    ):
        assert outside(item, TIP, finding) == said
