"""Judging down to its words and edges: what mutants of it survived until they were looked at."""

import msgspec
import numpy as np
import pytest

from crosscheck.judging.case_verdicts import judge
from crosscheck.judging.figures import figures, recordable
from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.results import CaseResults, Result, collect
from crosscheck.judging.sizes import size_of
from crosscheck.judging.uncertainty import Uncertainty, spatial
from crosscheck.judging.verdict import Finding, Signal, Verdict, compare, conserve
from crosscheck.library.accepted import Figure, dumps
from crosscheck.records.kinds import CaseRecord, VariantInfo
from flexmb.run.rounding import Sizes
from tests.crosscheck.made_records import ONE_PAIR, PAIR, TIMES, TIP, ended, judged, ladder, run_file, single, way

FORCE = "load:pivot.force"
CONTROL = """
[[variant]]
name = "rigid"
engines = ["one", "two"]

[[control]]
name = "fault"
mutation = "mass"
target = "rod"
a = { variant = "rigid", engine = "one" }
b = { variant = "rigid", engine = "two" }
goals = { "marker:tip.position" = 1e-3 }
scales = { "marker:tip.position" = 4.0 }

[[conservation]]
variant = "rigid"
quantity = "linear_momentum"
limit = 1e-3
engines = ["two"]
expect = "differ"
band = [0.1, 1.0]
reason = "a thruster"
"""
PLAIN = {
    "case": "made/made", "variant_a": "rigid", "engine_a": "one", "variant_b": "rigid", "engine_b": "two",
    "level": "rigid", "goal": 1e-3, "outside": "", "accepted": None, "worse": "", "stale": "", "expected_reason": "",
    "case_goal": None, "goal_reason": "", "own_failure": "", "advice": "",
}  # fmt: skip
"""What verdicts say here where a test names nothing else."""


def signal(level: float, doubt: float, sizes: tuple[float, ...] = (1.0,)) -> Signal:
    return Signal(np.full((3, 1), level), Uncertainty(np.full(3, doubt), doubt, "given"), sizes)


def everything() -> SessionOutcome:
    """A control that is noticed, and a momentum that changes by a half as expected."""
    momentum = np.ones((len(TIMES), 3))
    momentum[4] = 0.5
    two = {TIP: way(), "momentum.linear": momentum}
    runs = [*ladder("one", {TIP: way()}), *ladder("two", two)]
    runs += ladder("one", {TIP: way(1.5)}, role="control:fault")[-1:]
    return judged(CONTROL, runs)


def plain(verdict: Verdict) -> dict:
    """A verdict without its figures and what they stand on, which have tests of their own."""
    apart = ("E", "U", "scale", "reason", "basis")
    return {k: v for k, v in msgspec.to_builtins(verdict).items() if k not in apart}


def test_a_control_says_all_of_itself() -> None:
    control, _ = everything().all
    assert plain(control) == PLAIN | {
        "comparison": "fault", "kind": "control", "channel": TIP, "status": "differ", "expected": "differ",
        "expected_reason": "negative control (mass of rod): the fault must be noticed",
    }  # fmt: skip
    assert (control.ok, control.scale) == (True, 4.0)
    assert np.isclose(control.E, 0.5 / 4.0, rtol=1e-4)
    assert np.isclose(control.U, 3 * 2 * 9e-6 / 4.0, rtol=1e-3)


def test_a_control_of_the_whole_scene_says_so_and_needs_its_runs() -> None:
    text = CONTROL.split("[[conservation]]")[0].replace('target = "rod"\n', "")
    verdict = single(judged(text, PAIR))
    assert (verdict.status, verdict.expected_reason[:35]) == ("did not run", "negative control (mass of the scene")
    faulty = ladder("one", {TIP: way(1.5)}, role="control:fault")[-1:]
    assert single(judged(text, [*ladder("two", {TIP: way()}), *faulty])).status == "did not run"


def test_a_conserved_quantity_says_all_of_itself() -> None:
    _, conserved = everything().all
    assert plain(conserved) == PLAIN | {
        "comparison": "linear momentum conserved", "kind": "conservation", "channel": "momentum.linear",
        "engine_a": "two", "engine_b": "conservation law", "status": "differ", "expected": "differ",
        "expected_reason": "a thruster",
    }  # fmt: skip
    assert (conserved.U, conserved.ok) == (None, True)
    assert np.isclose(conserved.E, 0.5) and np.isclose(conserved.scale, np.sqrt(3.0))
    assert conserved.reason == "drifts by 0.5, more than the limit 0.001"


def test_a_comparison_says_all_of_itself() -> None:
    place = f"{TIP} | one (rigid) | two (rigid)"
    verdict = single(judged(ONE_PAIR, PAIR, {"both": {place: Figure(0.0, 1.8e-5)}}))
    assert plain(verdict) == PLAIN | {
        "comparison": "both", "kind": "comparison", "channel": TIP, "status": "agree", "expected": "agree",
        "accepted": {"E": 0.0, "U": 1.8e-5, "of": ""},
    }  # fmt: skip
    assert verdict.reason == "0 of the range apart, within the uncertainty 5.4e-05"
    other = single(judged(ONE_PAIR + 'reason = "why"\n', [*PAIR[:3], *ladder("two", {TIP: way(2.0)})]))
    assert (other.status, other.outside, other.expected_reason) == ("differ", "", "why")


def test_edges_belong_to_agreement() -> None:
    assert compare(FORCE, signal(1.0, 0.25), signal(1.5, 0.25), 0.5, 1.0).status == "agree"
    assert compare(FORCE, signal(1.0, 0.5), signal(1.0, 0.5), 1.0, 1.0).status == "agree"
    assert compare(FORCE, signal(1.0, 0.5), signal(1.0, 0.5), 1.0, 0.5).status == "unresolved"
    assert conserve(np.array([0.0, 0.5]), 1.0, 0.5).status == "agree"
    assert conserve(np.array([0.0, 1.0]), 1.0, 1.0).status == "agree"
    assert conserve(np.zeros(2), 1.0, 1.5).status == "unresolved"


def test_the_words_of_a_finding() -> None:
    assert conserve(np.array([0.0, -0.5]), 2.0, 0.5) == Finding(
        "agree", "drifts by 0.25, within the limit 0.5", 0.25, scale=2.0
    )
    text = "the quantity's size is 0: the case must state a scale to measure drift by"
    assert conserve(np.zeros(2), 0.0, 0.5) == Finding("unresolved", text)
    text = "the quantity holds values that are not numbers, or none at all"
    assert conserve(np.zeros(0), 1.0, 0.5) == Finding("failed", text)
    assert conserve(np.ones(1), 1.0, 2.0) == Finding(
        "unresolved", "a limit of 2 is no limit: it must lie between 0 and 1"
    )
    text = "the drift is beyond measure in units of the scale 1e-300"
    assert conserve(np.full(1, 1e300), 1e-300, 0.5) == Finding("unresolved", text)
    text = "the results are 2 of the range apart, 10 x their uncertainty"
    assert compare(FORCE, signal(1.0, 0.1), signal(2.0, 0.0), 0.3, 0.5) == Finding("differ", text, 2.0, 0.2, 0.5)
    text = "the results are 1 of the range apart, with no uncertainty to excuse it"
    assert compare(FORCE, signal(1.0, 0.0), signal(2.0, 0.0), 0.3, 1.0) == Finding("differ", text, 1.0, 0.0, 1.0)
    text = "uncertainty 0.5 exceeds the goal 0.1; largest part: given"
    assert compare(FORCE, signal(1.0, 0.5), signal(1.0, 0.0), 0.1, 1.0) == Finding("unresolved", text, 0.0, 0.5, 1.0)
    assert compare(FORCE, signal(1.0, 0.0), signal(1.0, 0.0), 0.1, 3.0) == Finding(
        "agree", "the results are equal to the last digit", 0.0, 0.0, 3.0
    )


UNSIZED = ": the case must state a scale for this channel"
SHAPES = "the results are of different shapes, (3, 1) and (2, 1): samples by components"


def values(*given: float, doubt: float = 0.0, sizes: tuple[float, ...] = ()) -> Signal:
    return Signal(np.array(given)[:, None], Uncertainty(np.full(len(given), doubt), doubt, "given"), sizes)


@pytest.mark.parametrize(
    ("a", "b", "scale", "status", "reason"),
    [
        (values(1.0, 2.0, 3.0), values(1.0, 2.0), None, "failed", SHAPES),
        (values(), values(), None, "failed", "the results hold no values at all"),
        (values(np.nan), values(1.0), None, "failed", "a result holds values that are not numbers"),
        (values(1.0), values(np.inf), None, "failed", "a result holds values that are not numbers"),
        (values(1e308), values(-1e308), None, "failed", "the results are so large that their distance is not finite"),
        (values(0.0, doubt=1e-9), values(0.0), None, "unresolved", f"the signal's size is 0{UNSIZED}"),
        (
            values(1e308, -1e308, doubt=1.0), values(1e308, -1e308), None, "unresolved",
            f"the signal's size is inf{UNSIZED}",
        ),
        (
            values(1e300), values(0.0), 1e-300, "unresolved",
            "the distance 1e+300 is beyond measure in units of the scale 1e-300",
        ),
    ],
)
@pytest.mark.filterwarnings("error")
def test_why_there_is_nothing_to_compare(a: Signal, b: Signal, scale: float | None, status: str, reason: str) -> None:
    found = compare(TIP, a, b, 0.5, scale)
    assert (found.status, found.reason, found.E, found.U, found.scale) == (status, reason, None, None, None)


@pytest.mark.parametrize(
    ("a", "b", "size"),
    [
        (values(0.0, 2.0), values(0.0, 3.0), 3.0),
        (values(0.0, 0.0), values(0.0, 0.0, sizes=(5.0,)), 5.0),
        (values(0.0, 0.0, sizes=(0.0, 0.25)), values(0.0, 0.0, sizes=(0.0,)), 0.25),
        (values(0.0, 0.5, doubt=0.5), values(0.0, 0.5, sizes=(4.0,)), 4.0),
        (values(0.0, 0.5, doubt=0.5), values(0.0, 0.25, sizes=(0.125,)), 0.5),
        (values(0.0, 0.5), values(0.0, 0.0, sizes=(2.0**24,)), 0.5),
        (values(0.0, 0.5), values(0.0, 0.0, sizes=(2.0**25,)), 2.0**25),  # 2^-26 of its family: it is rounding
        (values(0.0, 0.5), values(0.0, 0.0, sizes=(0.5, 2.0**49)), 0.5),
        (values(0.0, 0.5), values(0.0, 0.0, sizes=(0.5, 2.0**50)), 2.0**50),  # the family is rounding
    ],
)
def test_a_signal_that_is_zero_within_its_doubt_is_measured_by_its_family(a: Signal, b: Signal, size: float) -> None:
    tiny = Uncertainty(np.full(2, 1e-3), 1e-3, "given") if a.uncertainty.value == 0.0 else a.uncertainty
    found = compare(FORCE, Signal(a.values, tiny, a.sizes), b, 1.0)
    assert found.scale == size


def results(text: str, runs: list) -> CaseResults:
    """The results of records, before they are judged."""
    record = CaseRecord(case="made/made", run=run_file(text), provenance=None, readme="", variants={})
    return collect([record, *runs]).cases[0]


def result(text: str, runs: list, variant: str = "rigid", engine: str = "one") -> Result:
    return results(text, runs).get(variant, engine)


FLIGHT = {  # 3 m/s, 2 rad/s and 12 J, 1.5 m from the origin
    "marker:tip.position": way(1.5),
    "marker:tip.velocity": way(3.0),
    "marker:tip.angular_velocity": way(2.0),
    "energy.kinetic": way(12.0)[:, :1],
}


@pytest.mark.parametrize(
    ("signals", "channel", "size"),
    [
        ({"load:pivot.force": way(10.0), TIP: way(2.0)}, "load:pivot.torque", 20.0),
        ({"load:pivot.torque": way(10.0), TIP: way(2.0)}, "load:pivot.force", 5.0),
        (FLIGHT, "momentum.linear", 8.0),
        (FLIGHT, "momentum.angular", 12.0),
        ({name: FLIGHT[name] for name in FLIGHT if "angular" not in name}, "marker:tip.angular_velocity", 2.0),
        ({name: FLIGHT[name] for name in FLIGHT if ".velocity" not in name}, "marker:tip.velocity", 3.0),
        ({}, "marker:tip.orientation", 1.0),
        ({}, "momentum.linear", 0.0),
        ({}, "load:pivot.force", 0.0),
        ({}, "drive:pivot", 0.0),
    ],
)
def test_a_family_that_vanishes_is_measured_by_the_scene(signals: dict, channel: str, size: float) -> None:
    """Twice the kinetic energy over a speed is a momentum, a torque over a length a force; of nothing comes nothing."""
    rest = np.zeros((len(TIMES), 3))
    if channel.endswith(".orientation"):
        rest = np.tile([1.0, 0.0, 0.0, 0.0], (len(TIMES), 1))
    sizes = result(ONE_PAIR, ladder("one", signals | {channel: rest})).signal(channel, False).sizes
    assert np.allclose(sizes, (0.0, size), rtol=1e-5)


def test_spatial_doubt_is_added_over_time() -> None:
    text = """
[[variant]]
name = "rigid"
transform = "segments"
segments = 2
refined = { segments = 6, order = 1.0 }
engines = ["one"]
"""
    runs = [*ladder("one", {TIP: way()}), *ladder("one", {TIP: way(1.01)}, role="refined")[-1:]]
    one = result(text, runs)
    doubt, own = one.doubt(TIP, True), one.doubt(TIP, False)
    extra = spatial(TIP, way(), way(1.01), 3.0, 1.0)
    assert np.allclose(doubt.envelope, own.envelope + extra, rtol=1e-3)
    assert (doubt.value, doubt.order) == (doubt.envelope[-1], own.order)
    assert doubt.how == "3 x the difference of the two finest tolerances; spatial refinement"
    assert np.isclose(extra[-1], 1.25 * 1.5 * 0.01, rtol=1e-3)


def test_efforts_that_did_the_same_work_with_the_same_result_are_one() -> None:
    runs = ladder("one", {TIP: way()})
    same = msgspec.structs.replace(runs[1], channels=runs[2].channels, evaluations=runs[2].evaluations)
    how = result(ONE_PAIR, [runs[0], same, runs[2]]).doubt(TIP, False).how
    assert how == "unknown: fewer than two efforts finished with different results"
    worked = msgspec.structs.replace(same, evaluations=1)
    assert result(ONE_PAIR, [runs[0], worked, runs[2]]).doubt(TIP, False).value < 1e-12


def test_what_was_never_recorded_says_so() -> None:
    missing = result(ONE_PAIR, [])
    assert (missing.variant, missing.engine, missing.status, missing.runs) == ("rigid", "one", "did not run", ())
    assert missing.message == "no run of it is recorded: the session was cut short"
    assert missing.ending.reason == f"one on rigid: {missing.message}"
    cut = result(ONE_PAIR, ladder("one", {TIP: way()})[:2])
    assert (cut.status, cut.message) == ("did not run", "the finest effort is not recorded: the session was cut short")


def test_spatial_edges() -> None:
    one, other = np.zeros((1, 1)), np.ones((1, 1))
    assert np.allclose(spatial(FORCE, one, other, 4.0, 0.5), 2.5)
    assert np.all(np.isinf(spatial(FORCE, one, other, 1.0, 1.0)))


def verdict(kind: str, a: str = "one", b: str = "two", E: float | None = 1e-9, U: float | None = 1e-8) -> Verdict:
    return Verdict(
        case="c", comparison="é", kind=kind, channel=TIP, variant_a="v", engine_a=a, variant_b="v", engine_b=b,
        level="", status="agree", expected="agree", E=E, U=U, goal=1e-6, scale=1.0, reason="",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("given", "yes"),
    [
        (verdict("comparison"), True),
        (verdict("comparison", b="mine"), False),
        (verdict("comparison", a="mine"), False),
        (verdict("comparison", E=None), False),
        (verdict("control"), False),
        (verdict("control", E=None), False),
        (verdict("conservation", b="conservation law", U=None), True),
        (verdict("conservation", a="mine", b="conservation law", U=None), False),
    ],
)
def test_what_has_a_figure(given: Verdict, yes: bool) -> None:
    own = ("one", "two")
    assert recordable(given, own) is yes
    assert bool(figures([given], own)) is yes


def test_a_drift_is_written_without_uncertainty_and_names_as_they_are() -> None:
    text = dumps(figures([verdict("conservation", b="law", U=None)], ("one",)))
    assert text.splitlines()[2:] == ['["é"]', f'"{TIP} | one (v) | law (v)" = {{ E = 1.0e-09 }}']


def test_channels_that_one_side_lacks() -> None:
    """A kind of energy that one engine alone knows is left out; of anything else the other refuses."""
    text = ONE_PAIR.replace(
        '"marker:tip.position" = 1e-3', 'energy = 1e-3, "energy.strain" = 1e-3, momentum = 1e-3, load = 0.1'
    )
    flat = way()[:, :1]
    one = {"energy.kinetic": flat, "energy.gravity": flat, "energy.strain": flat, "momentum.linear": way()}
    runs = [*ladder("one", one), *ladder("two", {"energy.kinetic": flat})]
    found = [(each.channel, each.status, each.goal, each.reason) for each in judged(text, runs).all]
    assert [each[:3] for each in found] == [
        ("energy.kinetic", "agree", 1e-3),
        ("energy.strain", "refused", 1e-3),
        ("momentum.linear", "refused", 1e-3),
        ("load", "did not run", 0.1),
    ]
    assert found[1][3] == "two does not offer energy.strain"
    assert found[3][3] == 'neither one nor two has a channel "load"'


def test_an_unused_pattern_says_all_of_itself() -> None:
    text = ONE_PAIR + 'scales = { "marker:top.position" = 2.0 }\nreason = "why"\n'
    unused = judged(text, PAIR).all[-1]
    said = 'a scale is given for "marker:top.position", which is no channel judged here'
    assert plain(unused) == PLAIN | {
        "comparison": "both", "kind": "comparison", "channel": "marker:top.position", "status": "unresolved",
        "expected": "agree", "goal": 0.0, "outside": said, "expected_reason": "why",
    }  # fmt: skip
    assert unused.reason == said
    assert single(judged(text, PAIR[:3])).status == "did not run"


def test_an_unused_band_is_named_as_one() -> None:
    text = (
        ONE_PAIR
        + 'expect = "differ"\nreason = "why"\nband = { "marker:tip" = [0.1, 1.0], "load:pivot" = [1.0, 2.0] }\n'
    )
    runs = [*ladder("one", {TIP: way()}), *ladder("two", {TIP: way(1.5)})]
    *_, unused = judged(text, runs).all
    assert unused.reason == 'a band is given for "load:pivot", which is no channel judged here'


@pytest.mark.parametrize("broken", ["one", "two"])
def test_a_missing_side_is_told_once_for_each_goal(broken: str) -> None:
    """Whichever side it is; what else the run file says of channels is not asked then."""
    text = ONE_PAIR.replace("= 1e-3 }", '= 1e-3, "load" = 0.1 }') + 'scales = { "marker:top.position" = 2.0 }\n'
    runs = {name: ladder(name, {TIP: way()}) for name in ("one", "two")}
    runs[broken][-1] = ended(runs[broken][-1], "failed", "no luck")
    found = judged(text, [*runs["one"], *runs["two"]]).all
    said = f"{broken} on rigid: no luck"
    assert [(each.channel, each.goal, each.status, each.reason) for each in found] == [
        (TIP, 1e-3, "failed", said),
        ("load", 0.1, "failed", said),
    ]


def test_bounds_are_held_against_what_was_expected_alone() -> None:
    """An expected difference that is none, or a drift that is none, is not as expected; its size is no matter."""
    text = ONE_PAIR + 'expect = "differ"\nreason = "why"\nband = { "marker:tip" = [0.1, 1.0] }\n'
    verdict = single(judged(text, PAIR))
    assert (verdict.status, verdict.outside, verdict.ok) == ("agree", "", False)
    assert verdict.reason == "0 of the range apart, within the uncertainty 5.4e-05"


@pytest.mark.parametrize(
    ("level", "status", "beyond"),
    [(0.5, "differ", ""), (0.95, "differ", "E = 0.05 is outside the expected 0.1 to 1"), (1.0, "agree", "")],
)
def test_the_band_of_a_drift(level: float, status: str, beyond: str) -> None:
    momentum = np.ones((len(TIMES), 3))
    momentum[4] = level
    text = CONTROL[CONTROL.index("[[variant]]") : CONTROL.index("[[control]]")]
    text += CONTROL[CONTROL.index("[[conservation]]") :]
    verdict = single(judged(text, ladder("two", {"momentum.linear": momentum})))
    assert (verdict.status, verdict.outside) == (status, beyond)
    assert verdict.ok is (level == 0.5)
    assert verdict.reason.endswith(f"; {beyond}" if beyond else "limit 0.001")


ACROSS = """
[[variant]]
name = "rigid"
engines = ["one", "two"]

[[variant]]
name = "cut"
transform = "segments"
segments = 2
refined = { segments = 4 }
engines = ["two"]
"""


def across(item: str) -> list[Verdict]:
    """Verdicts where the other side's variant has a refined run that is another."""
    true = [*ladder("one", {TIP: way()}), *ladder("two", {TIP: way()}), *ladder("two", {TIP: way()}, variant="cut")]
    refined = ladder("two", {TIP: way(1.1)}, variant="cut", role="refined")[-1:]
    faulty = ladder("one", {TIP: way(3.0)}, role="control:fault")[-1:]
    return judged(ACROSS + item, [*true, *refined, *faulty]).all


@pytest.mark.parametrize("sides", [("one", "rigid", "two", "cut"), ("two", "cut", "one", "rigid")])
def test_across_variants_the_doubt_of_either_side_is_also_spatial(sides: tuple[str, ...]) -> None:
    item = f"""
[[comparison]]
name = "both"
a = {{ engine = "{sides[0]}", variant = "{sides[1]}" }}
b = {{ engine = "{sides[2]}", variant = "{sides[3]}" }}
goals = {{ "{TIP}" = 0.5 }}
"""
    (found,) = across(item)
    assert (found.status, found.level) == ("agree", "rigid")
    assert np.isclose(found.U or 0.0, 0.1 * 1.25 / 0.75, rtol=1e-3)


def test_a_control_across_variants_too() -> None:
    item = f"""
[[control]]
name = "fault"
mutation = "mass"
a = {{ engine = "one", variant = "rigid" }}
b = {{ engine = "two", variant = "cut" }}
goals = {{ "{TIP}" = 0.5 }}
scales = {{ "{TIP}" = 1.0 }}
"""
    (found,) = across(item)
    assert found.status == "differ" and np.isclose(found.E or 0.0, 2.0, rtol=1e-4)
    assert np.isclose(found.U or 0.0, 0.1 * 1.25 / 0.75, rtol=1e-3)


def test_a_control_has_no_accepted_figure() -> None:
    place = f"{TIP} | one (rigid) | two (rigid)"
    runs = [*PAIR]
    runs += ladder("one", {TIP: way(1.5)}, role="control:fault")[-1:]
    text = CONTROL.split("[[conservation]]")[0]
    control = single(judged(text, runs, {"fault": {place: Figure(1e-9, 1e-9)}}))
    assert (control.accepted, control.worse, control.ok) == (None, "", True)


def test_levels_of_both_sides_are_named_once_each() -> None:
    text = """
[[variant]]
name = "rigid"
engines = ["one", "two"]

[[variant]]
name = "soft"
engines = ["two"]

[[comparison]]
name = "both"
a = { engine = "one", variant = "rigid" }
b = { engine = "two", variant = "soft" }
goals = { "marker:tip.position" = 1e-3 }
"""
    runs = [*ladder("one", {TIP: way()}), *ladder("two", {TIP: way()}, variant="soft")]
    infos = {"rigid": VariantInfo(level="exact", drawing=None), "soft": VariantInfo(level="full", drawing=None)}
    record = CaseRecord(case="made/made", run=run_file(text), provenance=None, readme="", variants=infos)
    (verdict,) = judge(collect([record, *runs]).cases[0])
    assert (verdict.level, verdict.status) == ("exact / full", "agree")
    alike = {name: VariantInfo(level="full", drawing=None) for name in infos}
    (verdict,) = judge(collect([msgspec.structs.replace(record, variants=alike), *runs]).cases[0])
    assert verdict.level == "full"


@pytest.mark.parametrize(
    ("torque", "evaluations", "size"),
    [
        (1e-13, 0, 1e-13), (1e-15, 0, 20.0), (0.0, 10**6, 0.0), (1e-13, 200, 1e-13), (1e-13, 250, 20.0),
        (1e-13, -1, 1e-13),
    ],
)  # fmt: skip
def test_rounding_of_a_family_that_is_nothing_is_that_of_the_scene(
    torque: float, evaluations: int, size: float
) -> None:
    """It is nothing below 2^-50 of the scene, or below eps (sqrt(N) + 7.1), which is 9.4e-14 and 1.02e-13 of 20 Nm
    here: rounding in N evaluations, and in arithmetic past one joint."""
    signals = {"load:pivot.force": way(10.0), TIP: way(2.0), "load:pivot.torque": way(torque)}
    found = Sizes(signals, signals.__getitem__).magnitude("load:pivot.torque", evaluations)
    assert np.isclose(found, size, rtol=1e-5, atol=0.0)


def test_loads_of_free_hinges_and_work_are_measured_by_the_energy() -> None:
    """Where all loads are rounding, or no work is done, they are no size of their own: the energy is one."""
    way = {"marker:m.position": np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])}
    zeros = {name: np.array([[1e-17, 0.0, 0.0]] * 2) for name in ("load:free.torque", "load:free.force")}
    rest = {"work": np.array([[0.0], [1e-17]]), "energy.total": np.full((2, 1), 3.0)}
    signals = way | zeros | rest | {"energy.kinetic": np.array([[0.0], [3.0]])}
    found = Sizes(signals, signals.__getitem__)
    sizes = {name: size_of(1e-17, found.of(name), 1e-17) for name in (*zeros, "work")}
    assert sizes == {"load:free.torque": 6.0, "load:free.force": 3.0, "work": 3.0}
