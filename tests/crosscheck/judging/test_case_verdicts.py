"""What becomes of recorded runs: nothing that is missing, late, elsewhere or apart at one sample goes unnoticed."""

import re
from typing import get_args

import msgspec
import numpy as np
import pytest

from crosscheck.judging.case_verdicts import CLOCK
from crosscheck.judging.results import NEEDED
from crosscheck.judging.verdict import SEVERITY, STATUSES
from crosscheck.records.kinds import RunStatus
from crosscheck.records.packing import pack
from crosscheck.report.views import SYMBOLS
from tests.crosscheck.made_records import ONE_PAIR, PAIR, TIMES, TIP, ended, judged, ladder, run_file, single, way

ENDINGS = [status for status in SEVERITY if status not in ("agree", "differ", "unresolved")]
CONSERVED = """
[[variant]]
name = "rigid"
engines = ["one"]

[[conservation]]
variant = "rigid"
quantity = "QUANTITY"
limit = 1e-3
"""
ACROSS = """
[[variant]]
name = "coarse"
transform = "segments"
segments = 2
refined = { segments = 4 }
engines = ["one"]

[[variant]]
name = "exact"
engines = ["two"]

[[comparison]]
name = "across"
a = { variant = "coarse", engine = "one" }
b = { variant = "exact", engine = "two" }
goals = { "marker:tip.position" = 0.5 }
"""


def test_two_that_converge_to_the_same_agree() -> None:
    verdict = single(judged(ONE_PAIR, PAIR))
    assert (verdict.status, verdict.ok, verdict.level) == ("agree", True, "rigid")
    assert np.isclose(verdict.U, 2 * 3 * 9e-6, rtol=1e-3)


@pytest.mark.parametrize("sample", range(len(TIMES)))
@pytest.mark.parametrize("component", range(3))
def test_a_difference_at_one_sample_in_one_component_is_noticed(sample: int, component: int) -> None:
    apart = way()
    apart[sample, component] += 0.1
    verdict = single(judged(ONE_PAIR, [*ladder("one", {TIP: way()}), *ladder("two", {TIP: apart})]))
    assert verdict.status == "differ"


@pytest.mark.parametrize("sample", range(1, len(TIMES)))
@pytest.mark.parametrize("component", range(3))
@pytest.mark.parametrize("quantity", ["linear", "angular"])
def test_a_momentum_that_strays_at_one_sample_is_not_conserved(quantity: str, sample: int, component: int) -> None:
    values = np.ones((len(TIMES), 3))
    text = CONSERVED.replace("QUANTITY", f"{quantity}_momentum")
    channel = f"momentum.{quantity}"
    assert single(judged(text, ladder("one", {channel: values}))).status == "agree"
    values[sample, component] += 0.1
    verdict = single(judged(text, ladder("one", {channel: values})))
    assert (verdict.status, verdict.comparison) == ("differ", f"{quantity} momentum conserved")
    assert np.isclose(verdict.E, 0.1 / np.linalg.norm([1.0, 1.0, 1.1]), rtol=1e-4)


@pytest.mark.parametrize("sample", range(1, len(TIMES)))
@pytest.mark.parametrize("strays", ["energy.total", "work"])
def test_an_energy_less_its_work_that_strays_at_one_sample_is_not_conserved(strays: str, sample: int) -> None:
    swing = np.linspace(1.0, 3.0, len(TIMES))[:, None]
    signals = {
        "energy.kinetic": swing, "energy.gravity": -np.ones_like(swing), "energy.total": swing - 1.0,
        "work": swing + 7.0,
    }  # fmt: skip
    text = CONSERVED.replace("QUANTITY", "energy")
    assert single(judged(text, ladder("one", signals, spread=0.0))).status == "agree"
    signals[strays] = signals[strays].copy()
    signals[strays][sample] -= 0.1
    verdict = single(judged(text, ladder("one", signals, spread=0.0)))
    assert verdict.status == "differ"
    assert np.isclose(verdict.E, 0.1 / 4.0)


def test_drift_is_measured_by_the_stated_scale() -> None:
    text = CONSERVED.replace("QUANTITY", "linear_momentum") + "scale = 1e4\n"
    values = np.ones((len(TIMES), 3))
    values[3] += 1.0
    verdict = single(judged(text, ladder("one", {"momentum.linear": values})))
    assert np.isclose(verdict.E, np.sqrt(3.0) / 1e4, rtol=1e-4)


def test_a_quantity_that_is_not_offered_is_refused() -> None:
    verdict = single(judged(CONSERVED.replace("QUANTITY", "energy"), ladder("one", {TIP: way()})))
    assert (verdict.status, verdict.ok) == ("refused", False)


@pytest.mark.parametrize("status", ["failed", "crashed", "did not finish", "refused", "diverged", None])
def test_a_refined_run_without_result_leaves_the_uncertainty_unknown(status: str | None) -> None:
    """Else the spatial part of U would be left out in silence, and two models agree that are merely close."""
    coarse, exact = ladder("one", {TIP: way()}, variant="coarse"), ladder("two", {TIP: way()}, variant="exact")
    finer = ladder("one", {TIP: way(1.0 + 1e-3)}, variant="coarse", role="refined")[-1:]
    sound = single(judged(ACROSS, [*coarse, *exact, *finer]))
    assert sound.status == "agree"
    assert sound.U > 1e-3
    gone = [] if status is None else [ended(finer[0], status, "no memory left")]
    verdict = single(judged(ACROSS, [*coarse, *exact, *gone]))
    assert verdict.status == "unresolved"
    assert "its refined run" in verdict.reason
    assert status is None or f"{status}: " in verdict.reason and "no memory left" in verdict.reason


def test_within_a_variant_the_refined_run_does_not_matter() -> None:
    text = ACROSS.replace('engines = ["one"]', 'engines = ["one", "two"]').split("[[comparison]]")[0]
    text += '[[comparison]]\nname = "both"\nvariant = "coarse"\ngoals = { "marker:tip.position" = 1e-3 }\n'
    runs = [run for engine in ("one", "two") for run in ladder(engine, {TIP: way()}, variant="coarse")]
    assert single(judged(text, runs)).status == "agree"


WITHOUT_RESULT = ("failed", "crashed", "did not finish", "refused")
FINEST = NEEDED - 1
# What becomes of efforts of one engine, by their numbers; the verdict, and what it names.
EFFORTS = [
    ({rung: status}, "failed" if status == "refused" else status, f"effort rtol={rung} ")
    for rung in range(FINEST)
    for status in WITHOUT_RESULT
]
EFFORTS += [
    ({FINEST: "refused"}, "failed", ""),  # else all efforts but one could be passed over
    (dict.fromkeys(range(NEEDED), "refused"), "refused", ""),  # the scene as a whole
    *[({**dict.fromkeys(range(last), "crashed"), last: "failed"}, "failed", f"of {last}") for last in range(NEEDED)],
    *[({rung: None}, "unresolved", "is not recorded") for rung in range(FINEST)],
    ({1: "without the channel"}, "unresolved", "does not offer the channel"),
]


@pytest.mark.parametrize(("efforts", "status", "said"), EFFORTS, ids=str)
def test_an_engine_may_not_pass_over_efforts(efforts: dict[int, str | None], status: str, said: str) -> None:
    """The finest effort that has no result is named, and no other."""
    one = []
    for rung, run in enumerate(ladder("one", {TIP: way()})):
        match efforts.get(rung, "finished"):
            case "finished":
                one.append(run)
            case "without the channel":
                one.append(msgspec.structs.replace(run, channels={}))
            case str(ending):
                one.append(ended(run, ending, f"no memory of {rung}"))
    verdict = single(judged(ONE_PAIR, [*one, *ladder("two", {TIP: way()})]))
    assert (verdict.status, verdict.ok, said in verdict.reason) == (status, False, True), verdict.reason
    if status != "unresolved":
        assert set(re.findall("no memory of .", verdict.reason)) == {f"no memory of {max(efforts)}"}


def test_efforts_of_another_ladder_do_not_count() -> None:
    """The ladder was changed from one of three efforts to another of three: what is left of the first is stale."""
    text = ONE_PAIR.replace(
        'engines = ["one", "two"]',
        'engines = ["one", "two"]\n'
        'efforts = [{ engine = "one", kind = "tolerance", method = "m", values = [1e-7, 1e-8, 1e-9] }]',
    )
    old = ladder("one", {TIP: way(1.1)})
    new = [
        msgspec.structs.replace(run, effort=f"new {run.rung}", effort_value=run.effort_value / 10.0)
        for run in ladder("one", {TIP: way()})
    ]
    two = ladder("two", {TIP: way()})
    for runs in ([*old, *new, *two], [*new, *old, *two]):
        assert single(judged(text, runs)).status == "agree"
    assert single(judged(text, [*old, *two])).status == "did not run"


def test_a_crash_is_not_hidden_behind_an_expected_refusal() -> None:
    text = ONE_PAIR + 'expect = "refused"\nbecause = "cannot"\nreason = "neither can"\n'
    one, two = ladder("one", {TIP: way()})[-1], ladder("two", {TIP: way()})[-1]
    refused = msgspec.structs.replace(ended(one, "refused", "it cannot"), effort="", channels={})
    assert single(judged(text, [refused, *ladder("two", {TIP: way()})])).ok
    crashed = msgspec.structs.replace(ended(two, "crashed", "it cannot"), effort="", channels={})
    verdict = single(judged(text, [refused, crashed]))
    assert (verdict.status, verdict.ok) == ("crashed", False)


def test_every_status_is_known_wherever_statuses_are_listed() -> None:
    assert set(SEVERITY) == set(SYMBOLS) == set(STATUSES)
    assert set(ENDINGS) | {"finished"} == set(get_args(RunStatus))


@pytest.mark.parametrize("status", ENDINGS)
def test_a_run_without_result_gives_its_status_to_the_verdict(status: str) -> None:
    last = ended(ladder("two", {TIP: way()})[-1], status, "so it was")
    blank = msgspec.structs.replace(last, effort="", times=None, channels={})
    verdict = single(judged(ONE_PAIR, [*ladder("one", {TIP: way()}), blank]))
    assert (verdict.status, verdict.ok) == (status, False)
    assert "two on rigid" in verdict.reason and "so it was" in verdict.reason


def test_a_scale_replaces_the_range_where_its_pattern_is_the_most_specific() -> None:
    text = ONE_PAIR + 'scales = { "marker" = 5.0, "marker:tip.position" = 100.0 }\n'
    assert single(judged(text, PAIR)).scale == 100.0


def test_a_control_across_variants_counts_the_spatial_uncertainty() -> None:
    control = (
        ACROSS.split("[[comparison]]")[0]
        + """
[[control]]
name = "fault"
mutation = "gravity_sign"
a = { variant = "coarse", engine = "one" }
b = { variant = "exact", engine = "two" }
goals = { "marker:tip.position" = 0.5 }
"""
    )
    runs = [*ladder("one", {TIP: way()}, variant="coarse"), *ladder("two", {TIP: way()}, variant="exact")]
    runs += ladder("one", {TIP: way(1.001)}, variant="coarse", role="control:fault")[-1:]
    finer = ladder("one", {TIP: way(1.01)}, variant="coarse", role="refined")[-1:]
    assert single(judged(control, [*runs, *finer])).status == "agree"
    assert single(judged(control, runs)).status == "unresolved"


def test_an_expectation_without_bounds_in_old_records_is_not_as_expected() -> None:
    text = ONE_PAIR + 'expect = "differ"\nreason = "so"\n'
    assert run_file(text).comparisons[0].band == {}
    verdict = single(judged(text, [*ladder("one", {TIP: way()}), *ladder("two", {TIP: way(2.0)})]))
    assert (verdict.status, verdict.ok) == ("differ", False)
    assert "sets no bounds to E" in verdict.reason


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"times": pack(2.0 * TIMES)}, "at other times: 11 samples to 1 s, and 11 to 2 s"),
        ({"times": pack(TIMES**2)}, "at other times"),
        ({"times": pack((1.0 + 2.0 * CLOCK) * TIMES)}, "at other times"),
        ({"scene": "t"}, "different scenes"),
    ],
)
def test_results_of_other_times_or_scenes_are_not_compared(changes: dict, said: str) -> None:
    other = [msgspec.structs.replace(run, **changes) for run in ladder("two", {TIP: way()})]
    verdict = single(judged(ONE_PAIR, [*ladder("one", {TIP: way()}), *other]))
    assert (verdict.status, said in verdict.reason) == ("failed", True), verdict.reason


def test_clocks_are_compared_by_their_ratio_alone() -> None:
    def found(one: float, two: float) -> str:
        """The verdict on runs of nanoseconds, say, whose clocks show these times at the end."""
        runs = [
            msgspec.structs.replace(run, times=pack(end * TIMES))
            for name, end in (("one", one), ("two", two))
            for run in ladder(name, {TIP: way()})
        ]
        return single(judged(ONE_PAIR, runs)).status

    assert (found(1e-9, 1e-9), found(1e-9, 1.5e-9), found(1.0, 1.0 + 0.5 * CLOCK)) == ("agree", "failed", "agree")


def test_two_variants_may_be_of_two_scenes() -> None:
    text = ONE_PAIR.replace('engines = ["one", "two"]', 'engines = ["one"]').split("[[comparison]]")[0]
    text += '''
[[variant]]
name = "other"
engines = ["two"]

[[comparison]]
name = "across"
a = { engine = "one", variant = "rigid" }
b = { engine = "two", variant = "other" }
goals = { "marker:tip.position" = 1e-3 }
'''
    runs = ladder("two", {TIP: way()}, variant="other")
    other = [msgspec.structs.replace(run, scene="t") for run in runs]
    assert single(judged(text, [*ladder("one", {TIP: way()}), *other])).status == "agree"


def test_where_nothing_is_judged_no_scale_is_unused() -> None:
    text = ONE_PAIR.replace(TIP, "load:pivot") + 'scales = { "marker:top.position" = 2.0 }\n'
    assert single(judged(text, PAIR)).status == "did not run"
