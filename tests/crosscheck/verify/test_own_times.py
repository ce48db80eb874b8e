"""Files with times of their own: right ones agree and wrong ones differ, whatever the times."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import flexmb as fm
from crosscheck.engines.registry import PROVIDER
from crosscheck.library.case import CaseError
from crosscheck.library.find import load_case
from crosscheck.library.reference import current_reference
from crosscheck.references.other_times import reference_at
from crosscheck.verify.against_case import CsvOutcome, verify_csv
from crosscheck.verify.columns import VerifyError
from flexmb.typing import Real
from tests.crosscheck.sessions import CASE, here
from tests.crosscheck.sessions import PROVIDER as FAKE
from tests.crosscheck.verify.strangers import RESAMPLINGS, STRANGERS, Resampling, Stranger, written

BY_NAME = {stranger.name: stranger for stranger in STRANGERS}
DOUBLE, GYROSTAT, LATCHING = (
    BY_NAME[name] for name in ("pendulums/double", "wheel_gyrostat/torque_driven", "deploying_boom/latching")
)


def verdicts(stranger: Stranger, file: Path, coarse: Path | None = None) -> CsvOutcome:
    return verify_csv(stranger.case, file, coarse=coarse, scheduler=here)


def statuses(outcome: CsvOutcome) -> dict[str, str]:
    return {verdict.channel: verdict.status for verdict in outcome.all}


def right_agrees_and_wrong_differs(stranger: Stranger, times: Real, folder: Path) -> None:
    right = verdicts(stranger, stranger.right(folder / "right.csv", times))
    assert set(statuses(right).values()) == {"agree"}, [each.reason for each in right.unexpected]
    assert max(each.E / each.U for each in right.all if each.U) < 0.1  # far from being doubtful
    heavy = verdicts(stranger, stranger.too_heavy(folder / "heavy.csv", times))
    assert heavy.counts()["differ"] > 0
    assert not [detail.cause for detail in heavy.details.values() if detail.cause]  # a mass is none of the causes
    late = verdicts(stranger, stranger.too_late(folder / "late.csv", times))
    assert late.counts()["differ"] > 0
    assert "s too late" in "".join(detail.cause for detail in late.details.values())


@pytest.mark.parametrize("resampling", RESAMPLINGS)
def test_any_times_will_do(resampling: Resampling, tmp_path: Path) -> None:
    stranger = GYROSTAT if RESAMPLINGS.index(resampling) % 2 else DOUBLE
    times = resampling(np.random.default_rng(3), stranger.stored.times)
    right_agrees_and_wrong_differs(stranger, times, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("stranger", STRANGERS, ids=lambda each: each.name)
def test_two_hundred_resamplings(stranger: Stranger, seed: int, tmp_path: Path) -> None:
    random = np.random.default_rng([seed, STRANGERS.index(stranger)])
    resampling = RESAMPLINGS[seed % len(RESAMPLINGS)]
    right_agrees_and_wrong_differs(stranger, resampling(random, stranger.stored.times), tmp_path)


@pytest.mark.parametrize("samples", [26, 51, 126, 251])
def test_few_samples_of_a_fast_motion_are_enough(samples: int, tmp_path: Path) -> None:
    """By interpolation of the file 5 to 10 channels differed, by 4 to 22 times the error that was estimated."""
    outcome = verdicts(DOUBLE, DOUBLE.right(tmp_path / "mine.csv", np.linspace(0.0, 5.0, samples)))
    assert set(statuses(outcome).values()) == {"agree"}
    assert ("nothing was interpolated" in outcome.interpolated) == (samples > 100)


def test_some_of_the_stored_times_need_no_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("crosscheck.references.routes.run_planned", lambda *_, **__: pytest.fail("an engine ran"))
    stored = DOUBLE.stored
    some = written(tmp_path / "some.csv", stored.times[::4], {n: rows[::4] for n, rows in stored.channels.items()})
    outcome = verdicts(DOUBLE, some)
    assert set(statuses(outcome).values()) == {"agree"}
    assert outcome.interpolated == "26 samples, at some of the reference's 101 times"


def test_the_reference_elsewhere_is_that_which_is_stored(tmp_path: Path) -> None:
    """At the stored times it is the stored one within its uncertainty; elsewhere its U is never less than stated."""
    for stranger in (DOUBLE, BY_NAME["tops/lagrange"]):
        stored = stranger.stored
        times = np.sort(np.concatenate([stored.times[3:6], stored.times[3:6] + 1e-3]))
        found = reference_at(stranger.case, stored, times, PROVIDER, here)
        assert list(found) == list(stored.channels)
        for name, signal in found.items():
            apart = np.max(np.abs(signal.values[::2] - stored.channels[name][3:6]))
            assert apart <= signal.uncertainty.value < np.inf
            assert signal.uncertainty.value >= stored.knowledge.channels[name].uncertainty


def test_a_reference_that_its_route_does_not_reproduce_is_not_known_elsewhere(tmp_path: Path) -> None:
    case, stored = GYROSTAT.case, current_reference(GYROSTAT.case)
    name = "marker:sensor.velocity"
    stored.channels[name][7] += 10.0 * stored.knowledge.channels[name].uncertainty
    found = reference_at(case, stored, np.linspace(0.0, stored.times[-1], 33), PROVIDER, here)
    assert [channel for channel, signal in found.items() if signal.uncertainty.value == np.inf] == [name]
    assert "is the most that may be" in found[name].uncertainty.how


def test_a_closed_form_is_not_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only `crosscheck regenerate` runs code of a case's folder; an engine takes its place."""
    monkeypatch.setattr("crosscheck.references.routes._function", lambda file: pytest.fail(f"{file} was loaded"))
    top = BY_NAME["tops/lagrange"]
    found = reference_at(top.case, top.stored, np.linspace(0.0, top.stored.times[-1], 33), PROVIDER, here)
    assert list(found) == list(top.stored.channels)
    assert "by native" in found["marker:apex.position"].uncertainty.how


def test_a_case_whose_engines_do_not_run_here_needs_its_own_times(tmp_path: Path) -> None:
    times = np.linspace(0.0, 5.0, 77)
    with pytest.raises(CaseError, match="cannot be had at others.*template"):
        reference_at(DOUBLE.case, DOUBLE.stored, times, "tests.crosscheck.fake_engines:engines", here)


@pytest.mark.parametrize(("times", "said"), [
    (np.linspace(0.0, 9.0, 500), "do not cover the case's"),
    (np.linspace(0.5, 10.0, 500), "do not cover the case's"),
    (np.linspace(0.0, 10.0, 7), "only 7 rows"),
])  # fmt: skip
def test_times_that_do_not_cover_the_reference_are_refused(tmp_path: Path, times: Real, said: str) -> None:
    file = GYROSTAT.right(tmp_path / "mine.csv", times)
    with pytest.raises(VerifyError, match=said):
        verdicts(GYROSTAT, file)


def test_a_last_step_may_end_before_the_reference_does(tmp_path: Path) -> None:
    times = np.arange(0.0, 10.0, 0.03)
    outcome = verdicts(GYROSTAT, GYROSTAT.right(tmp_path / "mine.csv", times))
    assert set(statuses(outcome).values()) == {"agree"}
    assert "334 samples at times of its own" in outcome.interpolated


def test_a_coarse_file_shares_times(tmp_path: Path) -> None:
    name = "marker:sensor.velocity"

    def file(called: str, times: Real, factor: float = 1.0) -> Path:
        return written(tmp_path / called, times, {name: factor * GYROSTAT.solution(times)[name]})

    times = np.linspace(0.0, 10.0, 88)
    mine = file("mine.csv", times)
    outcome = verdicts(GYROSTAT, mine, file("coarse.csv", times[::3], 1.0 + 1e-9))
    assert statuses(outcome) == {name: "agree"}
    assert 2e-9 < outcome.all[0].U < 4e-9  # 3 x the difference
    with pytest.raises(VerifyError, match=r"has only 2 of the 88 times.*write both at the same times"):
        verdicts(GYROSTAT, mine, file("elsewhere.csv", np.linspace(0.0, 10.0, 89)))


def test_an_engine_asked_for_runs_at_the_times_of_the_file(tmp_path: Path) -> None:
    """It begins at 0 where the file does not."""
    times = np.sort(np.random.default_rng(1).uniform(0.0, 10.0, 200))
    file = GYROSTAT.right(tmp_path / "mine.csv", times)
    outcome = verify_csv(GYROSTAT.case, file, engine="native-frisch", scheduler=here)
    assert set(statuses(outcome).values()) == {"agree"}
    assert outcome.interpolated == "200 samples at times of its own, at which native-frisch ran"
    with pytest.raises(VerifyError, match="is not there"):
        still = written(tmp_path / "pendulum.csv", 0.4 * times, {"marker:tip.position": np.ones((len(times), 3))})
        verify_csv(load_case(CASE), still, engine="absent", provider=FAKE, scheduler=here)


# Jumps


NAME = "marker:tip.velocity"


@cache
def latch() -> float:
    """When (s) the boom latches."""
    return fm.simulate(LATCHING.scene, 3.0, rtol=1e-12, atol=1e-14).events[0].t


def around_the_latch(early: float, late: float) -> tuple[Real, dict[str, Real], int]:
    """Times of which one is `early` s before the latch, the solution there, and the place; but at that place what the
    solution is `late` s later."""
    at = latch()
    times = np.sort(np.append(np.linspace(0.0, LATCHING.stored.times[-1], 40), at - early))
    place = int(np.searchsorted(times, at - early))
    moved = times.copy()
    moved[place] += late
    return times, LATCHING.solution(moved), place


def test_a_sample_at_a_jump_may_have_either_side(tmp_path: Path) -> None:
    """A stranger's latch closes 2e-8 s earlier, just before a sample instead of behind it."""
    times, channels, place = around_the_latch(1e-8, 2e-8)
    outcome = verdicts(LATCHING, written(tmp_path / "mine.csv", times, channels))
    assert set(statuses(outcome).values()) == {"agree"}, [each.reason for each in outcome.unexpected]
    jumping = [name for name, detail in outcome.details.items() if detail.left_out]
    assert NAME in jumping
    assert not any(name.endswith((".position", ".orientation")) for name in jumping)
    assert all(outcome.details[name].left_out == (times[place],) for name in jumping)
    reasons = {each.channel: each.reason for each in outcome.all}
    assert all("left out: the sample at t = " in reasons[name] for name in jumping)
    assert all("where the reference jumps" in reasons[name] for name in jumping)
    at_a_jump = {name: channels[name].copy() for name in (NAME, "marker:aperture.velocity")}
    at_a_jump[NAME][place] *= 1.5  # neither side
    at_a_jump["marker:aperture.velocity"][place // 2] *= 1.001  # where there is no jump
    wrong = verdicts(LATCHING, written(tmp_path / "wrong.csv", times, at_a_jump))
    assert set(statuses(wrong).values()) == {"differ"}


def test_an_event_that_is_visibly_early_differs(tmp_path: Path) -> None:
    times, channels, _ = around_the_latch(1e-3, 2e-3)
    outcome = verdicts(LATCHING, written(tmp_path / "early.csv", times, {NAME: channels[NAME]}))
    assert statuses(outcome) == {NAME: "differ"}
