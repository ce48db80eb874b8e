"""Derivatives and frequencies in verdicts: an engine's own account is part of U, and the worst entry is told."""

import msgspec
import numpy as np
import pytest

from crosscheck.judging.outcome import SessionOutcome, conclude
from crosscheck.judging.question import entry
from crosscheck.judging.results import Result, collect
from crosscheck.library.find import load_case, shipped_folder
from crosscheck.library.reference import column_names, parse_values, scene_digest, values_text
from crosscheck.library.selection import select
from crosscheck.records.kinds import CaseRecord, RunRecord, VariantInfo
from crosscheck.records.packing import pack
from crosscheck.running.plan import plan, scene_identity
from flexmb.typing import Real
from tests.crosscheck.made_records import ONE_PAIR, TIMES, TIP, ladder, run_file, way

SPEED, KNOWN = "derivatives.by_speed", "known_to.by_speed"
ENGINES = 'engines = ["one", "two"]'
TEXT = ONE_PAIR.replace("marker:tip.position", SPEED).replace(ENGINES, f'{ENGINES}\nlinear = ["derivatives"]')
NAMES = ("shoulder.rotation", "slide.translation")


def matrix(off: float = 0.0) -> Real:
    """(T, 4): the second entry of the first row changes with time; `off` is added to it at the last sample."""
    values = np.tile([2.0, 0.0, -1.0, 0.5], (len(TIMES), 1))
    values[:, 1] = TIMES
    values[-1, 1] += off
    return values


def runs(engine: str, values: Real, known: float, spread: float = 0.0, moving: bool = True) -> list[RunRecord]:
    found = ladder(engine, {SPEED: values, TIP: way() if moving else 0.0 * way() + 1.0}, spread=spread)
    own = {KNOWN: pack(np.full((len(TIMES), 1), known))}
    same = 100 if not moving else 0  # a state at rest takes as many evaluations at every effort
    return [
        msgspec.structs.replace(run, channels=run.channels | own, evaluations=same or run.evaluations) for run in found
    ]


def judged(*records: list[RunRecord]) -> SessionOutcome:
    infos = {"rigid": VariantInfo(level="rigid", drawing=None, coordinates=NAMES)}
    run = select(run_file(TEXT), ())
    case = CaseRecord(case="made/made", run=run, provenance=None, readme="", variants=infos)
    return conclude(collect([case, *(run for record in records for run in record)]))


def one(records: list[RunRecord]) -> Result:
    case = CaseRecord(case="made/made", run=run_file(TEXT), provenance=None, readme="", variants={})
    return collect([case, *records]).cases[0].get("rigid", "one")


def test_what_an_engine_says_of_its_own_error_is_part_of_U() -> None:
    without, with_own = (one(runs("one", matrix(), known, spread=1e-9)) for known in (0.0, 1e-4))
    doubt, plain = with_own.uncertainty(SPEED), without.uncertainty(SPEED)
    assert doubt.value == pytest.approx(plain.value + 1e-4, rel=1e-9)
    assert "1.0e-04 by the engine's own account" in doubt.how
    assert (with_own.own_account(SPEED), with_own.own_account(TIP)) == (1e-4, 0.0)
    assert with_own.uncertainty(TIP).value == without.uncertainty(TIP).value
    assert KNOWN not in with_own.channels


def test_a_difference_beyond_both_accounts_differs_and_its_entry_is_told() -> None:
    (verdict,) = judged(runs("one", matrix(), 1e-6, 1e-9), runs("two", matrix(3e-6), 1e-6, 1e-9)).all
    assert verdict.status == "differ"
    where = "d udot[shoulder.rotation]/d u[slide.translation] = 1 at t = 1 s"
    assert f"farthest apart, by 3e-06, is {where}" in verdict.reason


def test_a_difference_names_the_models_that_stand_for_the_scene() -> None:
    soft = [msgspec.structs.replace(run, support="loops are springs") for run in runs("two", matrix(3e-6), 1e-6, 1e-9)]
    (verdict,) = judged(runs("one", matrix(), 1e-6, 1e-9), soft).all
    assert verdict.status == "differ" and verdict.reason.endswith("; two: loops are springs")
    near = [msgspec.structs.replace(run, support="loops are springs") for run in runs("two", matrix(1e-6), 1e-6, 1e-9)]
    (verdict,) = judged(runs("one", matrix(), 1e-6, 1e-9), near).all
    assert verdict.status == "agree" and "springs" not in verdict.reason


def test_a_difference_within_the_accounts_agrees() -> None:
    (verdict,) = judged(runs("one", matrix(), 1e-6, 1e-9), runs("two", matrix(1e-6), 1e-6, 1e-9)).all
    assert verdict.status == "agree"


def test_an_engine_that_does_not_know_is_unresolved_and_no_effort_is_advised() -> None:
    for known in (1.0, np.inf):
        (verdict,) = judged(runs("one", matrix(), known, 1e-9), runs("two", matrix(), 1e-9, 1e-9)).all
        assert verdict.status == "unresolved" and "add" not in verdict.advice
        assert "goal" in verdict.advice or known == np.inf


def test_a_state_at_rest_is_the_same_at_every_effort() -> None:
    """Without motion equal results at all efforts are no sign that efforts are ignored; with it they are."""
    resting, ignoring = (one(runs("one", matrix(), 1e-9, moving=moving)) for moving in (False, True))
    assert resting.uncertainty(SPEED).value == pytest.approx(1e-9, rel=1e-4)
    assert "rests" in resting.uncertainty(SPEED).how
    equal = [msgspec.structs.replace(run, evaluations=100) for run in runs("one", matrix(), 1e-9)]
    assert np.isinf(one(equal).uncertainty(SPEED).value)
    assert np.isfinite(ignoring.uncertainty(SPEED).value)
    assert "rests" in resting.uncertainty(TIP).how  # of a run that is about the linearised motion
    without = [
        msgspec.structs.replace(run, channels={name: run.channels[name] for name in (SPEED, TIP)})
        for run in runs("one", matrix(), 1e-9, moving=False)
    ]
    assert np.isinf(one(without).uncertainty(TIP).value)  # of any other run that ends where it began


def test_entries_have_names() -> None:
    assert entry("derivatives.by_force", 2, 4, NAMES) == "d udot[slide.translation]/d tau[shoulder.rotation]"
    assert entry("derivatives.by_displacement", 5, 9, ()) == "d udot[2]/d xi[3]"
    assert entry("frequencies", 1, 3, NAMES) == "frequency 2 of 3"


def test_matrices_are_written_and_read_in_files_of_references() -> None:
    channels = {SPEED: matrix(), "frequencies": np.tile([0.0, 1.0, 1.0], (len(TIMES), 1))}
    times, found = parse_values(values_text(TIMES, channels), "reference.csv")
    assert np.array_equal(times, TIMES)
    assert {name: values.tolist() for name, values in found.items()} == {
        name: values.tolist() for name, values in channels.items()
    }
    assert column_names("frequencies", 2) == ["frequencies.0 [rad/s]", "frequencies.1 [rad/s]"]


def test_what_is_asked_is_part_of_a_run_and_not_of_the_model() -> None:
    """Runs without derivatives are not served where they are asked for, and figures and references stay valid."""
    case = load_case(shipped_folder() / "pendulums/double")
    variant = case.run.variants[0]
    asking = msgspec.structs.replace(variant, linear=("derivatives",))
    assert variant.asks == () and asking.asks == ("derivatives",)
    assert b"linear" not in msgspec.json.encode(variant)
    assert scene_digest(case, variant) == scene_digest(case, asking)
    scene = case.scene(variant)
    assert scene_identity(scene, TIMES) != scene_identity(scene, TIMES, ("derivatives",))


def test_a_case_that_asks_nothing_has_the_records_that_it_had() -> None:
    record, jobs = plan(load_case(shipped_folder() / "pendulums/double"), (), "none:none")
    written = msgspec.json.encode(record)
    assert b'"linear"' not in written and b'"coordinates"' not in written
    assert {job.linear for job in jobs} == {()}


def test_a_case_that_asks_has_names_of_coordinates_and_asks_in_controls_too() -> None:
    record, jobs = plan(load_case(shipped_folder() / "linearised/hanging_pendulum"), (), "none:none")
    assert record.variants["rest"].coordinates == ("shoulder.rotation", "elbow.rotation")
    assert {job.linear for job in jobs} == {("derivatives", "frequencies")}
