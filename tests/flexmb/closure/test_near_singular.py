"""Random mechanisms whose branches cross or nearly do: a run is right, or says that it does not know the branch."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import flexmb
from flexmb.tables.status import Status
from tests.flexmb.closure import mechanisms as m
from tests.flexmb.closure.bennett import random_bennett
from tests.flexmb.closure.near_singular import random_row

# The last of a row of many, whose rows vanish nearly together, by loose tolerances: corrections do not converge there.
LOST = (Status.BRANCH_UNKNOWN, Status.CLOSURE_SINGULAR, Status.CLOSURE_OPEN)
# By settings: how they integrate, and the error (rad) that a run on the right branch keeps to in two seconds.
SETTINGS = {
    "dop853": ({}, 1e-6), "loose": ({"rtol": 1e-6, "atol": 1e-8}, 1e-2), "looser": ({"rtol": 1e-3, "atol": 1e-4}, 0.3),
    "stabilised": ({"stabilise": 20.0}, 1e-4), "composite": ({"algorithm": "composite"}, 1e-6),
    "fine rk4": ({"method": "rk4", "step": 1e-3}, 1e-3), "rk4": ({"method": "rk4", "step": 3e-3}, 1e-2),
    "coarse rk4": ({"method": "rk4", "step": 1e-2}, 0.1), "coarser rk4": ({"method": "rk4", "step": 3e-2}, 0.3),
    "stabilised rk4": ({"stabilise": 20.0, "method": "rk4", "step": 3e-3}, 1e-2),
}  # fmt: skip
TRUSTED = 1e-3  # change of the reference's energy beyond which it says nothing
# Known faults (docs/notation.md, Branches): linkages that are 2e-11 and 6e-11 m too short to cross take the other
# branch by a tolerance that hardly resolves it, and one run by small steps takes more than it may, and says so.
KNOWN = {"Bennett": ("60 loose: WRONG by", "92 loose: WRONG by", "35 fine rk4: WRONG MAX_STEPS"), "rows": ()}
TIMES = np.linspace(0.0, 2.0, 9)


def outcomes(seed: int, settings: tuple[str, ...]) -> dict[str, str]:
    """By settings "right", the name of the status, or what is wrong; none where the reference is not trusted."""
    row, error = random_row(np.random.default_rng(seed))
    angles, drift = row.motion(TIMES, exact=error == 0.0)
    if not drift < TRUSTED:
        return {}
    system = flexmb.compile(row.scene())
    feet = [system.coordinate(f"foot {i}").start for i in range(len(row.uprights))]
    found = {}
    for setting in settings:
        given, tolerance = SETTINGS[setting]
        run = flexmb.simulate(system, TIMES[-1], samples=TIMES, **given)
        bound = tolerance + 300.0 * drift
        if "rk4" in setting:  # a step too coarse for the motion anywhere shows in its energy, and spoils its time
            bound += 20.0 * lost_energy(run, row.kinetic) * float(np.max(np.abs(row.rates)))
        found[setting] = judged(run, run.q[:, feet], angles[: len(run.t), : len(feet)], bound)
    return found


def bennett_outcomes(seed: int, settings: tuple[str, ...]) -> dict[str, str]:
    """The same of Bennett's linkage, two of whose rows are independent, over five near misses or crossings."""
    linkage = random_bennett(np.random.default_rng(seed))
    times, angles = linkage.motion(5.2, 14)
    system, found = flexmb.compile(linkage.scene()), {}
    fastest = float(np.max(np.abs(np.diff(angles, axis=0) / np.diff(times)[:, None])))
    for setting in settings:
        given, tolerance = SETTINGS[setting]
        if "step" in given:
            given = given | {"step": given["step"] * 6.0 / fastest}
        run = flexmb.simulate(system, times[-1], samples=times, **given)
        bound = tolerance * max(fastest * times[-1], 1.0)
        if "rk4" in setting:
            bound += 10.0 * lost_energy(run, linkage.kinetic) * fastest * times[-1]
        found[setting] = judged(run, run.q, angles[: len(run.t)], bound)
    return found


def lost_energy(run: flexmb.Trajectory, kinetic: float) -> float:
    """The largest change of energy beside the kinetic one at the start, a fifth at most."""
    return min(float(np.max(np.abs(run.energy_drift), initial=0.0)) / kinetic, 0.2)


def judged(run: flexmb.Trajectory, found: np.ndarray, expected: np.ndarray, bound: float) -> str:
    """What became of a run whose angles (rad) are to be within a bound of those expected."""
    if not run.finished:
        return str(run.status) if run.status in LOST else f"WRONG {run.status}"
    off = np.max(np.abs(np.exp(1j * found) - np.exp(1j * expected)))
    return "right" if off < bound else f"WRONG by {off:.1e}, drift {np.max(np.abs(run.energy_drift)):.1e}"


@pytest.mark.parametrize("seed", range(4))
def test_bennetts_reference_closes(seed):
    """All the way round the axis behind the last link is the fourth one, on the ground, and at rest."""
    linkage = random_bennett(np.random.default_rng(seed))
    place, R, _, velocity = list(linkage.links(np.linspace(0.0, 2.0 * np.pi, 50)))[-1]
    assert np.max(np.abs(place - [-linkage.a, 0.0, 0.0])) < 1e-14
    assert np.max(np.abs(velocity)) < 1e-14
    axis = [0.0, np.sin(linkage.alpha), np.cos(linkage.alpha)]
    assert np.max(np.abs(R.apply([0.0, 0.0, 1.0]) - axis)) < 1e-14


@pytest.mark.parametrize("seed", range(6))
def test_a_random_bennett_is_right_or_lost(seed):
    found = bennett_outcomes(seed, ("dop853", "looser", "rk4"))
    assert not [each for each in found.values() if each.startswith("WRONG")], found


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*singular position:flexmb.SceneWarning")
@pytest.mark.parametrize(("name", "of", "count"), [("rows", outcomes, 300), ("Bennett", bennett_outcomes, 100)])
def test_random_mechanisms_are_right_or_lost(name, of, count):
    """The campaign: no run is wrong and says OK, and few are lost, but of those whose gaps and steps are given.

    Rows are tried here only, as their reference takes 13 s to compile.
    In 156 rows (of seeds 0 to 198) with a reference that is trusted, all runs were right but two: one of "looser"
    (CLOSURE_OPEN), one of "stabilised" (CLOSURE_SINGULAR). Of "stabilised rk4" one in thirty said BRANCH_UNKNOWN. In
    100 linkages of Bennett's all but the KNOWN ones were right. Thresholds, by what became of 33 rows when they moved:
    `UNRESOLVED` / 16 lost five runs of 99, times 16 made two wrong; crossings feign up to 2 of it, near misses have 0.2
    and more. `FASTEST` / 8 lost one, times 512 none; pivots of crossings fall by 0.5 at most.
    """
    counts: dict[str, dict[str, int]] = {setting: {} for setting in SETTINGS}
    wrong = []
    for seed in range(count):
        for settings, found in of(seed, tuple(SETTINGS)).items():
            counts[settings][found] = counts[settings].get(found, 0) + 1
            if found.startswith("WRONG") and not f"{seed} {settings}: {found}".startswith(KNOWN[name]):
                wrong.append(f"{seed} {settings}: {found}")
    for settings, each in counts.items():
        print(settings, each)
    assert not wrong, wrong
    for settings, each in counts.items():
        if settings != "stabilised rk4":
            assert each["right"] > 0.95 * sum(each.values())


@pytest.mark.parametrize("step", [1e-2, 3e-3, 1e-3])
@pytest.mark.parametrize("longer", [1e-3, 1e-4, 1e-6])
def test_equal_steps_resolve_what_they_pass_near(longer, step):
    """A parallelogram whose ground is a little too long folds, by steps however coarse beside the fold.

    Without a look at the distance to the singular position, a step of 10 ms lost 1.8e-2 J there, or stopped.
    """
    system = flexmb.compile(m.four_bar(m.FourBar(0.4, 1.0, 0.4, 1.0 + longer), crank=1.0, rate=6.0, gravity=0.0))
    tight = flexmb.simulate(system, 2.0, samples=9)
    run = flexmb.simulate(system, 2.0, samples=9, method="rk4", step=step)
    assert tight.finished and run.finished, run.message
    assert np.max(np.abs(run.energy_drift)) < 1e-3 * step / 1e-2
    assert np.max(np.abs(run.q - tight.q)) < 1e-1 * step / 1e-2


GIVEN = {
    "rk4": {"method": "rk4", "stabilise": 20.0}, "generalised_alpha": {"method": "generalised_alpha"},
    "dop853": {"stabilise": 20.0, "rtol": 1e-3, "atol": 1e-4},
}  # fmt: skip


@pytest.mark.parametrize("settings", GIVEN)
@pytest.mark.parametrize("longer", [1e-2, 1e-3, 1e-4, 1e-6])
def test_steps_that_are_not_shortened_are_noticed(longer, settings):
    """The same: a run that finishes is right, or warns of the closure and says so at its end.

    By "rk4" with stabilisation energies of 11 J grew by up to 350 J, and branches were wrong, with no word of it.
    """
    system = flexmb.compile(m.four_bar(m.FourBar(0.4, 1.0, 0.4, 1.0 + longer), crank=1.0, rate=6.0, gravity=0.0))
    tight = flexmb.simulate(system, 2.0, samples=9)
    for step in (1e-2, 1e-3):
        given = GIVEN[settings] | ({} if settings == "dop853" else {"step": step})
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            run = flexmb.simulate(system, 2.0, samples=9, **given)
        assert run.finished or run.status in (*LOST, Status.NOT_CONVERGED), run.message
        noticed = [str(each.message) for each in told if issubclass(each.category, flexmb.SceneWarning)]
        assert all('closure "loop"' in each and each.split(": ", 1)[1] in run.message for each in noticed)
        if run.finished and not noticed:
            assert np.max(np.abs(run.q - tight.q)) < 0.1


@pytest.mark.parametrize("settings", GIVEN)
def test_nothing_is_noticed_far_from_singular_positions(settings):
    with warnings.catch_warnings():
        warnings.simplefilter("error", flexmb.SceneWarning)
        given = GIVEN[settings] | ({} if settings == "dop853" else {"step": 1e-2})
        assert flexmb.simulate(m.four_bar(), 3.0, samples=2, **given).finished


SPATIAL = {"dop853": {}, "looser": {"rtol": 1e-3, "atol": 1e-4}, "coarse rk4": {"method": "rk4", "step": 1e-2}}


@pytest.mark.parametrize("settings", SPATIAL)
@pytest.mark.parametrize("shorter", [1e-1, 1e-2, 1e-4, 1e-6, 1e-8])
def test_a_nearly_equilateral_bennett_linkage(shorter, settings):
    """With links of one length its branches cross; nearly so, a half turn of one joint is a moment of the next."""
    alpha, b = 0.8, 1.0 - shorter
    run = flexmb.simulate(flexmb.compile(m.bennett(1.0, b, alpha, angle=2.0, rate=1.5)), 3.0, **SPATIAL[settings])
    assert run.finished or run.status in LOST, run.message
    if run.finished:
        ratio = m.bennett_ratio(1.0, b, alpha)[1]
        first, second = 0.5 * run.q[:, 0], 0.5 * run.q[:, 1]
        across = np.sin(first) * np.sin(second) - ratio * np.cos(first) * np.cos(second)
        assert np.max(np.abs(across)) < 1e-6 * ratio
        assert np.max(np.abs(run.energy_drift)) < {"dop853": 1e-6}.get(settings, 0.1)


@pytest.mark.parametrize("settings", ["dop853", "looser"])
@pytest.mark.parametrize("longer", [0.0, 1e-8, 1e-5, 1e-3])
def test_flexible_bars_near_a_singular_position(longer, settings):
    """Beams for bars: right as far as a run with tighter tolerances tells, or lost.

    Later their vibration decides how they turn at each near miss, and errors grow a thousandfold: nothing is compared.
    """
    bars = m.FourBar(0.4, 1.0, 0.4, 1.0 + longer)
    system = flexmb.compile(m.four_bar(bars, crank=1.0, rate=6.0, gravity=0.0, modes=1))
    run = flexmb.simulate(system, 0.35, samples=6, **SPATIAL[settings])
    tight = flexmb.simulate(system, 0.35, samples=6, rtol=1e-12, atol=1e-14)
    assert run.finished or run.status in LOST, run.message
    if run.finished and tight.finished:
        allowed = {"dop853": 1e-5}.get(settings, 0.1)
        assert np.max(np.abs(run.markers["joint"].position - tight.markers["joint"].position)) < allowed


def test_at_rest_where_branches_cross():
    """All bars on one line and no speed at all: nothing says which way gravity lets them fall."""
    for settings in ({}, {"method": "rk4", "step": 1e-2}):
        flat = flexmb.compile(m.windows(1, 0.0))
        state = flat.initial_state
        state.q[[flat.coordinate(name).start for name in ("foot 0", "foot 1", "corner 0")]] = 0.0
        try:
            run = flexmb.simulate(flat, 1.0, state=state, **settings)
        except flexmb.ClosureError:
            continue
        assert not run.finished and run.status in LOST
