"""Initial states that close all closures, or refusals that say where and why; failures on the way."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

import flexmb
from flexmb.run import propagate
from flexmb.scene import schema as s
from flexmb.tables.status import Status
from tests import trees
from tests.flexmb.closure import chains
from tests.flexmb.closure import mechanisms as m


def test_a_closed_scene_is_left_as_it_is():
    scene = m.four_bar(rate=0.0)
    start = flexmb.compile(scene).initial_state
    assert np.array_equal(start.q, flexmb.System(scene).initial_state.q)
    assert np.array_equal(start.u, np.zeros(3))


@pytest.mark.parametrize("off", [1e-3, 0.1, 0.5])
@pytest.mark.parametrize("modes", [0, 2])
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_rough_coordinates_are_closed(off, modes):
    system = flexmb.compile(m.four_bar(off=off, modes=modes))
    start = system.initial_state
    assert m.gap(system, start) < 1e-12
    assert np.linalg.norm(start.q - flexmb.System(system.scene).initial_state.q) < 3.0 * off


@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_rough_angles_do_not_bend_bodies():
    system = flexmb.compile(m.four_bar(off=0.2, modes=2))
    start = system.initial_state
    assert system.evaluate(0.0, start.q, start.u).energy["strain"] < 1e-6


@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_a_small_correction_is_the_nearest_in_the_metric_of_kinetic_energy():
    system = flexmb.compile(m.four_bar(off=1e-6))
    rough, start = flexmb.System(system.scene).initial_state, system.initial_state
    dense = chains.constrained(system.scene, start.q, start.u)
    moved = dense.M @ (start.q - rough.q)
    left = moved - dense.J.T @ np.linalg.lstsq(dense.J.T, moved, rcond=1e-12)[0]
    assert np.max(np.abs(left)) < 1e-4 * np.max(np.abs(moved))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_random_loops(seed):
    recipe = replace(trees.FULL, prescribed=False, branching=False, deformation=0.01)
    rng = np.random.default_rng(seed)
    scene = chains.with_closures(trees.random_scene(seed, recipe), rng, ["revolute", "spherical"])
    system = flexmb.compile(scene)
    start = system.initial_state
    assert m.gap(system, start) < 1e-12
    dense = chains.constrained(scene, start.q, start.u)
    assert np.max(np.abs(dense.rate)) < 1e-12 * np.max(np.abs(dense.J)) * np.sum(np.abs(start.u))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_speeds_of_rigid_bodies_are_the_nearest_in_the_metric_of_kinetic_energy(seed):
    recipe = replace(trees.RIGID, prescribed=False, branching=False)
    scene = chains.with_closures(trees.random_scene(seed, recipe), np.random.default_rng(seed), ["revolute"])
    start = flexmb.compile(scene).initial_state
    expected = chains.consistent_speeds(scene, start.q, flexmb.System(scene).initial_state.u)
    assert np.max(np.abs(start.u - expected)) < 1e-9 * np.max(np.abs(expected))


DRIVE = s.Ramp(value=0.5 * np.pi, rate=0.6)


def driven_twice() -> s.Scene:
    """A crank that turns, and a pivot that is driven to stand still."""
    scene = m.four_bar(prescribed=s.Ramp(value=1.0, rate=2.0))
    pivot = next(hinge for hinge in scene.hinges if hinge.name == "pivot")
    still = s.AngularCoordinate(prescribed_rad=s.Constant(value=pivot.rotation.angle_rad))
    hinges = (*(h for h in scene.hinges if h is not pivot), msgspec.structs.replace(pivot, rotation=still))
    return msgspec.structs.replace(scene, hinges=hinges)


REFUSED = {
    "a gap": (m.four_bar(position_b=(0.0, 0.0, 0.1)), r'closure "loop" \(gap 0\.1 m.*no coordinates close it'),
    "opposite axes": (m.four_bar(quaternion_b=(0.0, 1.0, 0.0, 0.0)), "half a turn apart"),
    "contradictory drives": (driven_twice(), "no speeds keep it closed"),
    "rigid bars, a tilted pin": (
        m.tilted_four_bar(flexible=False, drive=None),
        r'"c" leave none of the 3 free speeds: the mechanism is locked',
    ),
    "the same, driven": (m.tilted_four_bar(flexible=False, drive=DRIVE), r'closure "c" .*the mechanism is locked'),
}


@pytest.mark.parametrize(("scene", "why"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_closed_or_moved_is_refused_by_name(scene, why):
    with pytest.raises(flexmb.ClosureError, match=why):
        flexmb.simulate(scene, 1.0)


def test_a_driven_mechanism_has_no_freedom_left_and_runs():
    """The crank turns as prescribed; the work of its drive is what energy gains."""
    system = flexmb.compile(m.four_bar(prescribed=s.Ramp(value=1.0, rate=3.0)))
    run = flexmb.simulate(system, 4.0, rtol=1e-11, atol=1e-12, samples=41)
    assert run.finished and system.closures.mobility == 0
    rocker = np.array([m.GRASHOF.angles(1.0 + 3.0 * t)[1] for t in run.t])
    assert np.max(np.abs(np.sin(run.q[:, system.coordinate("pivot").start] - rocker))) < 1e-11
    assert np.max(np.abs(run.energy_drift)) < 1e-9 * run.energy_scale


def test_the_rigid_four_bar_with_a_tilted_pin_is_locked():
    with pytest.raises(flexmb.ClosureError, match=r'"c" leave none of the 3 free speeds: the mechanism is locked'):
        flexmb.simulate(m.tilted_four_bar(flexible=False, drive=None), 1.0)
    with pytest.raises(flexmb.ClosureError, match=r'closure "c" .*the mechanism is locked'):
        flexmb.simulate(m.tilted_four_bar(flexible=False, drive=s.Ramp(value=0.5 * np.pi, rate=0.6)), 1.0)


def test_the_flexible_four_bar_with_a_tilted_pin_runs():
    """Its drive does what bars store: work of the drive equals the gain of energy."""
    system = flexmb.compile(m.tilted_four_bar(flexible=True, drive=DRIVE))
    run = flexmb.simulate(system, 0.2, rtol=1e-7, atol=1e-9, samples=11)
    assert run.finished, run.message
    assert m.largest_gap(system, run) < 1e-10
    assert np.max(np.abs(run.energy_drift)) < 1e-9 * run.energy_scale
    assert run.work[-1] > 0.5 * run.energy["strain"][-1] > 0.0
    # Without the tilt the bars of a parallelogram turn together and stay straight, as far as the run knows its modes:
    # its absolute tolerance. Rounding out of the plane depends on the machine, 3e-13 to 3e-12 m here.
    straight = m.tilted_four_bar(flexible=True, drive=DRIVE, tilt=0.0)
    plane = flexmb.simulate(straight, 0.05, rtol=1e-7, atol=1e-9, samples=11)
    assert np.max(np.abs(plane.markers["pin"].position[:, 2])) < 1e-9
    assert np.max(np.abs(run.markers["pin"].position[:, 2])) > 1e-5


@pytest.mark.slow
def test_the_flexible_four_bar_turns_around():
    """A whole revolution, through both positions with all bars on one line, and back to where it started."""
    system = flexmb.compile(m.tilted_four_bar(flexible=True, drive=DRIVE))
    run = flexmb.simulate(system, 2.0 * np.pi / 0.6, rtol=1e-6, atol=1e-8, samples=101)
    assert run.finished, run.message
    assert m.largest_gap(system, run) < 1e-10
    assert np.max(np.abs(run.energy_drift)) < 1e-7 * run.energy_scale
    there = run.markers["pin"].position
    assert np.max(np.abs(there[-1] - there[0])) < 1e-4 < 1e-3 < np.max(there[:, 2])
    assert run.energy["strain"][-1] < 1e-4 * np.max(run.energy["strain"])


def test_attachment_modes_are_what_a_loop_needs():
    """Loads with five of them equal those with an eigenmode beside; six eigenmodes alone are a quarter off."""
    loads, quarter = [], 0.5 * np.pi
    turn = s.SmoothStep(start_value=quarter, end_value=quarter + 0.1, start_s=0.0, duration_s=0.02)
    for modes in (s.Modes(count=0, static=True), s.Modes(count=1, static=True), s.Modes(count=6)):
        scene = m.tilted_four_bar(flexible=True, drive=turn)
        families = ("torsion", "bending_y", "bending_z")
        chosen = msgspec.structs.replace(modes, families=families)
        bodies = tuple(msgspec.structs.replace(body, modes=chosen) for body in scene.bodies)
        run = flexmb.simulate(msgspec.structs.replace(scene, bodies=bodies), 0.03, rtol=1e-7, atol=1e-9, samples=61)
        assert run.finished
        loads.append(np.mean(run.loads["c"][-20:, :3], axis=0))
    exact, same, wrong = loads
    assert np.linalg.norm(same - exact) < 1e-2 * np.linalg.norm(exact)
    assert np.linalg.norm(wrong - exact) > 0.1 * np.linalg.norm(exact)


def test_a_singular_configuration_has_a_status():
    """A parallelogram's four pins on one line: one suppressed motion less, two ways to go on."""
    system = flexmb.compile(m.four_bar(m.FourBar(0.3, 1.0, 0.3, 1.0), crank=0.8))
    system.initial_state  # noqa: B018  (counts the independent rows)
    flat = system.state(np.zeros(3), np.array([1.0, -1.0, 1.0]))
    with pytest.raises(flexmb.DynamicsError, match='closure "loop" is singular'):
        system.accelerations(flat)


def test_a_start_at_a_singular_configuration_is_noticed():
    scene = m.four_bar(m.FourBar(0.3, 1.0, 0.3, 1.0), crank=1e-14, rate=1.0)
    run = flexmb.simulate(scene, 1.0)
    assert run.status in (Status.CLOSURE_OPEN, Status.CLOSURE_SINGULAR) and run.stopped_at < 0.1
    assert '"loop"' in run.message


def test_a_crank_driven_beyond_its_reach_stops_there():
    """0.6, 0.5, 0.5, 1: coupler and rocker stretch out where 1 + 0.36 - 1.2 cos(crank) = 1."""
    lengths = m.FourBar(0.6, 0.5, 0.5, 1.0)
    run = flexmb.simulate(m.four_bar(lengths, crank=0.8, prescribed=s.Ramp(value=0.8, rate=1.0)), 1.0)
    assert run.status in (Status.CLOSURE_OPEN, Status.CLOSURE_SINGULAR, Status.STEP_TOO_SMALL)
    assert run.stopped_at == pytest.approx(np.arccos(0.3) - 0.8, abs=1e-3)
    assert len(run.t) > 50


def test_what_is_not_supported_is_refused_with_a_remedy():
    scene = m.four_bar(modes=2)
    system = flexmb.compile(scene)
    for algorithm in ("unsplit", "frisch"):
        with pytest.raises(NotImplementedError, match='use algorithm="articulated" or "composite"'):
            flexmb.simulate(scene, 1.0, algorithm=algorithm)
        with pytest.raises(NotImplementedError, match='use algorithm="articulated" or "composite"'):
            system.accelerations(system.initial_state, algorithm)
    with pytest.raises(NotImplementedError, match="leave accelerations out"):
        system.hinge_loads(system.initial_state, np.zeros(system.nu))


def test_stabilisation_holds_a_drift_that_projection_does_not_have():
    system = flexmb.compile(m.four_bar())
    runs = {rate: flexmb.simulate(system, 10.0, "rk4", step=0.005, samples=21, stabilise=rate) for rate in (0.0, 20.0)}
    drift = {rate: m.largest_gap(system, run) for rate, run in runs.items()}
    assert all(run.finished for run in runs.values())
    assert drift[0.0] < 1e-12 < drift[20.0] < 1e-5


def test_a_step_allocates_nothing(monkeypatch):
    """However many steps a run takes, it allocates as much; all are handed to another thread, like long ones."""
    monkeypatch.setattr(propagate, "SHORT", -1.0)
    system = flexmb.compile(m.four_bar(modes=2))
    flexmb.simulate(system, 0.01, "rk4", step=0.001, samples=2)
    counts = []
    _nrt_python.memsys_enable_stats()
    try:
        for steps in (10, 1000):
            before = rtsys.get_allocation_stats().alloc
            run = flexmb.simulate(system, 0.01, "rk4", step=0.01 / steps, samples=2)
            counts.append(rtsys.get_allocation_stats().alloc - before)
            assert run.statistics.accepted_steps == steps
    finally:
        _nrt_python.memsys_disable_stats()
    assert 0 < counts[0] == counts[1]


def test_stabilisation_needs_closures_and_a_rate():
    with pytest.raises(ValueError, match="no closures"):
        flexmb.simulate(msgspec.structs.replace(m.four_bar(), closures=()), 1.0, stabilise=1.0)
    with pytest.raises(ValueError, match="positive rate"):
        flexmb.simulate(m.four_bar(), 1.0, stabilise=-1.0)


NO_STATES = {
    "short": np.zeros(2), "long": np.zeros(10**5), "2-D": np.zeros((1, 7)), "complex": np.zeros(7) + 0j,
    "not finite": np.full(7, np.nan), "None": None,
}  # fmt: skip


@pytest.mark.parametrize("y", NO_STATES.values(), ids=NO_STATES)
@pytest.mark.parametrize("method", ["motion", "composite_motion", "gaps", "determined"])
def test_states_that_do_not_fit_are_refused(method, y):
    closures = flexmb.compile(m.four_bar()).closures
    with pytest.raises((ValueError, TypeError), match="y: |q\\["):
        getattr(closures, method)(0.0, y)


@pytest.mark.parametrize("call", [flexmb.compile, lambda what: flexmb.simulate(what, 1.0)])
@pytest.mark.parametrize("what", ["scene.toml", None, {"name": "scene"}])
def test_what_is_no_scene_is_named(call, what):
    with pytest.raises(TypeError, match=f"a Scene is needed, not {type(what).__name__}: load_scene reads one"):
        call(what)
