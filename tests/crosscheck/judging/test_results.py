"""From records to results and their U: which records count, what a ladder must be, what each lack is called, and what a
conserved quantity stands on.
"""

from typing import Any

import msgspec
import numpy as np
import pytest

from crosscheck.judging.case_verdicts import drift_of
from crosscheck.judging.results import CaseResults, Result, Session, collect
from crosscheck.judging.verdict import conserve
from crosscheck.library.accepted import Figure, dumps
from crosscheck.records.kinds import BrokenLine, CaseRecord, RunRecord, VariantInfo
from crosscheck.records.machine import environment
from crosscheck.records.packing import pack
from tests.crosscheck.made_records import ONE_PAIR, TIMES, TIP, ended, judged, ladder, run_file, single, way

FORCE = "load:pivot.force"
GROWING = np.column_stack([TIMES, TIMES**2, 0.0 * TIMES])
TWO_VARIANTS = """
[[variant]]
name = "plain"
engines = ["one"]

[[variant]]
name = "rigid"
transform = "segments"
segments = 2
refined = { segments = 6, order = 1.0 }
engines = ["one"]
"""


def session(text: str, records: list[Any]) -> Session:
    run = run_file(text)
    infos = {variant.name: VariantInfo(level="", drawing=None) for variant in run.variants}
    return collect([CaseRecord(case="made/made", run=run, provenance=None, readme="", variants=infos), *records])


def case(text: str, records: list[Any]) -> CaseResults:
    return session(text, records).cases[0]


def one(records: list[Any], text: str = ONE_PAIR) -> Result:
    return case(text, records).get("rigid", "one")


def steps(signals: dict[str, np.ndarray], order: float) -> list[RunRecord]:
    """A ladder of steps 0.4, 0.2, 0.1 whose error is h^order times the signal."""
    values = {h: {name: (1.0 + h**order) * signal for name, signal in signals.items()} for h in (0.4, 0.2, 0.1)}
    return [
        msgspec.structs.replace(
            run, effort_kind="step", effort_value=h, channels={name: pack(value) for name, value in values[h].items()}
        )
        for run, h in zip(ladder("one", signals), values, strict=True)
    ]


def test_a_session_keeps_its_environments_and_broken_lines() -> None:
    where, broken = environment(("made/made",)), BrokenLine("records.jsonl", 3, "why")
    found = session(ONE_PAIR, [where, broken, *ladder("one", {TIP: way()})])
    assert (found.environments, found.broken, len(found.cases)) == ((where,), (broken,), 1)


def test_what_is_run_again_counts_as_the_last_even_if_it_is_cut_short() -> None:
    """The scene was edited and one effort run before the session was killed: the old results are another scene's."""
    runs = ladder("one", {TIP: way()})
    assert one(runs).status == "finished"
    again = msgspec.structs.replace(runs[0], scene="edited")
    assert one([*runs, again]).status == "did not run"


def test_a_record_without_an_effort_has_no_runs() -> None:
    blank = ended(ladder("one", {TIP: way()})[0], "crashed", "why", effort="", times=None, channels={})
    found = one([blank])
    assert (found.status, found.message, found.runs, found.channels) == ("crashed", "why", (), ())


@pytest.mark.parametrize(
    ("changes", "status", "message", "reached"),
    [
        ({}, "finished", "", None),
        ({"rungs": 4}, "did not run", "the finest effort is not recorded: the session was cut short", None),
        ({"times": None}, "failed", "its record holds no times", None),
        ({"status": "failed", "message": "why"}, "failed", "why", None),
        ({"status": "did not finish", "message": "why"}, "did not finish", "why", None),
        ({"status": "diverged", "message": "why"}, "diverged", "diverged at t = 1 s: why", 1.0),
        ({"status": "diverged", "message": "why", "times": None}, "diverged", "diverged at t = 0 s: why", 0.0),
        (
            {"status": "diverged", "message": "why", "times": pack(TIMES[:0])},
            "diverged",
            "diverged at t = 0 s: why",
            0.0,
        ),
    ],
)
def test_a_result_is_its_finest_run(changes: dict[str, Any], status: str, message: str, reached: float | None) -> None:
    runs = [msgspec.structs.replace(run, rungs=changes.get("rungs", 3)) for run in ladder("one", {TIP: way()})]
    runs[-1] = msgspec.structs.replace(runs[-1], **changes)
    found = one(runs[::-1])
    assert (found.variant, found.engine, found.status, found.message) == ("rigid", "one", status, message)
    assert (found.reached_s, found.runs) == (reached, tuple(runs))


def test_signals_are_unpacked_once() -> None:
    result = one(ladder("one", {TIP: way(), FORCE: way(2.0)}))
    assert result.values(TIP) is result.values(TIP)
    assert not np.array_equal(result.values(TIP), result.values(FORCE))


def test_a_finished_run_has_times_and_signals_at_them() -> None:
    runs = ladder("one", {TIP: way()})

    def last(**changes: Any) -> Result:
        return one([*runs[:2], msgspec.structs.replace(runs[2], **changes)])

    assert (last(times=None).status, last(times=None).message) == ("failed", "its record holds no times")
    single = last(times=pack(TIMES[:1]), channels={TIP: pack(way()[:1])})
    assert (single.status, single.channels) == ("finished", (TIP,))
    for times, values in ((TIMES[:0], way()[:0]), (TIMES, way()[:5]), (TIMES, way()[:, 0]), (way(), way())):
        found = last(times=pack(times), channels={TIP: pack(values)})
        text = f"its record holds {TIP} of shape {values.shape} at times of shape {times.shape}"
        assert (found.status, found.message) == ("failed", text)


def test_two_efforts_that_did_the_same_say_nothing_where_the_first_diverged() -> None:
    runs = ladder("one", {TIP: way()})
    coarse = ended(runs[0], "diverged", times=None, channels={})
    apart = one([coarse, *runs[1:]]).doubt(TIP, False)
    assert apart.how == "3 x the difference of the only two efforts"
    same = msgspec.structs.replace(runs[1], channels=runs[2].channels, evaluations=runs[2].evaluations)
    how = one([coarse, same, runs[2]]).doubt(TIP, False).how
    assert how == "unknown: fewer than two efforts finished with different results"


def four_tolerances() -> list[RunRecord]:
    """A hundredth apart, by a method of order 4: errors fall as the tolerances do, and evaluations grow by sqrt(10)."""
    made = ladder("one", {TIP: way()})
    return [
        msgspec.structs.replace(
            run, effort=f"rtol {n}", effort_value=1e-2 * 1e-2**n, rung=n, rungs=4,
            evaluations=round(100 * 10 ** (n / 2)), channels={TIP: pack(way(1.0 + 1e-2**n))},
        )
        for n, run in enumerate((made[0], *made))
    ]  # fmt: skip


def test_an_effort_before_the_last_three_narrows_u_and_is_not_needed() -> None:
    runs = four_tolerances()
    difference = 1e-4 - 1e-6
    assert one(runs).uncertainty(TIP).value == pytest.approx(10.0 / 90.0 * difference, rel=0.05)
    for lost in (ended(runs[0], "crashed"), msgspec.structs.replace(runs[0], channels={})):
        assert one([lost, *runs[1:]]).uncertainty(TIP).value == pytest.approx(difference, rel=0.05)


def test_spatial_doubt_keeps_the_order_and_ends_at_its_largest() -> None:
    runs = [*steps({TIP: GROWING}, 2.0), *ladder("one", {TIP: 1.5 * GROWING}, role="refined")[-1:]]
    doubt = one(runs, TWO_VARIANTS).doubt(TIP, True)
    own = one(runs, TWO_VARIANTS).doubt(TIP, False)
    assert doubt.how == "Richardson, observed order 2.00; spatial refinement"
    assert doubt.order == own.order and np.isclose(own.order or 0.0, 2.0)
    assert doubt.value == doubt.envelope[-1] > 1.1 * doubt.envelope[-2]


@pytest.mark.parametrize(
    ("refined", "why"),
    [
        ([], "did not run: no run of it is recorded: the session was cut short"),
        ([{"channels": {}}], "does not offer the channel"),
        ([{}], "gave the very same result: it is not refined"),
        ([{"status": "refused", "message": "no"}], "was refused: no"),
        ([{"status": "failed", "message": "no"}], "failed: no"),
    ],
)
def test_what_a_refined_run_lacks_is_named(refined: list[dict[str, Any]], why: str) -> None:
    runs = ladder("one", {TIP: way()})
    finer = [msgspec.structs.replace(runs[-1], role="refined", **changes) for changes in refined]
    result = one([*runs, *finer], TWO_VARIANTS)
    assert result.doubt(TIP, True).how == f"unknown: its refined run {why}"
    assert np.isfinite(result.doubt(TIP, False).value)
    assert result.refined is not None
    assert (result.refined.variant, result.refined.engine) == ("rigid", "one")


def test_elements_are_refined_twofold() -> None:
    text = ONE_PAIR.replace('engines = ["one", "two"]', 'engines = ["one"]\nrefined = { elements = 8, order = 4.0 }', 1)
    assert one(ladder("one", {TIP: way()}), text).refinement == (2.0, 4.0)
    assert one(ladder("one", {TIP: way()}), TWO_VARIANTS).refinement == (3.0, 1.0)


def flat(level: float, samples: int = 11) -> np.ndarray:
    return np.full((samples, 1), level)


def test_a_small_quantity_is_measured_by_itself() -> None:
    result = one(ladder("one", {"energy.total": flat(0.2), "energy.kinetic": flat(-0.25), "momentum.linear": way(0.5)}))
    assert drift_of(result, "energy.total")[1] == pytest.approx(0.25)
    assert drift_of(result, "momentum.linear")[1] == pytest.approx(0.5)
    assert drift_of(one(ladder("one", {"energy.total": flat(0.2)})), "energy.total")[1] == 0.0


def test_the_drift_of_nothing_is_nothing() -> None:
    last = ladder("one", {"energy.total": flat(1.0, 0), "energy.kinetic": flat(1.0, 0), "momentum.linear": way()[:0]})[
        -1
    ]
    result = Result("rigid", "one", "finished", "", (last,))
    for channel in ("energy.total", "momentum.linear"):
        drift, size = drift_of(result, channel)
        assert (len(drift), size) == (0, 0.0)
        assert conserve(drift, size, 0.5).status == "failed"


def test_a_figure_is_written_with_its_basis_if_it_has_one() -> None:
    written = dumps({"both": {"with": Figure(1e-9, 1e-8, "ab.c"), "without": Figure(1e-9)}}).splitlines()[3:]
    assert written == ['"with" = { E = 1.0e-09, U = 1.0e-08, of = "ab.c" }', '"without" = { E = 1.0e-09 }']


def test_a_drift_stands_on_its_run_and_scale() -> None:
    """The basis of a conserved quantity names the rule, the scene and scale, the efforts and the version."""
    text = 'engines = ["one"]\nname = "rigid"\n[[conservation]]\nvariant = "rigid"\nquantity = "linear_momentum"\n'
    signals = {"momentum.linear": np.ones((len(TIMES), 3))}

    def stands_on(scale: str, spread: float = 1e-6, scenes: str = "s1", steps: float = 1.0) -> list[str]:
        runs = [
            msgspec.structs.replace(run, effort_value=run.effort_value * steps)
            for run in ladder("one", signals, spread=spread)
        ]
        found = single(judged(f"[[variant]]\n{text}limit = 1e-3\n{scale}", runs, basis=scenes)).basis
        return found.split(".")

    first = stands_on("scale = 1.0")
    assert len(first) == 4 and "-" not in first
    assert stands_on("scale = 1.0", spread=1e-7) == first  # figures change, what they stand on does not
    for place, other in ((1, stands_on("scale = 2.0")), (1, stands_on("scale = 1.0", scenes="s2")),
                         (2, stands_on("scale = 1.0", steps=2.0))):  # fmt: skip
        assert [then != now for then, now in zip(first, other, strict=True)] == [part == place for part in range(4)]


@pytest.mark.parametrize(
    ("one", "two", "reason"),
    [
        ("energy.kinetic", "energy.gravity", 'one and two share no channel "energy"'),
        ("energy.kinetic", TIP, 'two has no channel "energy"'),
        (TIP, "energy.kinetic", 'one has no channel "energy"'),
        (TIP, TIP, 'neither one nor two has a channel "energy"'),
    ],
)
def test_who_lacks_a_channel_is_named(one: str, two: str, reason: str) -> None:
    """Kinds of energy that only one engine offers are left out; if none is left, the goal was never judged."""
    text = ONE_PAIR.replace('"marker:tip.position"', "energy")
    found = judged(text, [*ladder("one", {one: way()[:, :1]}), *ladder("two", {two: way()[:, :1]})])
    assert [(each.channel, each.status, each.reason) for each in found.all] == [("energy", "did not run", reason)]


def test_a_record_that_finished_without_an_effort_is_a_damaged_one() -> None:
    case = CaseRecord(case="made/made", run=run_file(ONE_PAIR), provenance=None, readme="", variants={})
    damaged = msgspec.structs.replace(ladder("one", {TIP: way()})[-1], effort="")
    found = collect([case, damaged]).cases[0].get("rigid", "one")
    assert (found.variant, found.engine, found.status, found.runs) == ("rigid", "one", "failed", ())
    assert found.message == "its record names no effort"
