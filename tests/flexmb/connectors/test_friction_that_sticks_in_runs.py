"""Friction that sticks beside everything else that a run has, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.integrate import quad

import flexmb as fm
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.native import NativeEngine
from crosscheck.library.mutations.connectors import MUTATIONS
from flexmb.dense.dense_system import DenseSystem
from flexmb.export.refusals import NotExportable, refuse
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.scene.sticking import events_of
from tests.flexmb.connectors.test_friction_that_sticks import BOUND, TIGHT, belt, block

ALONG_X = (1.0, 0.0, 0.0)


def body(builder: fm.SceneBuilder, name: str, mass: float) -> fm.SceneBuilder:
    return builder.rigid_body(name, mass=mass, inertia=(1.0, 1.0, 1.0))


def thrown(rate: float = 3.0) -> fm.Scene:
    law = {"sliding": 1.0, "static": 2.0, "stribeck": 0.4}
    return block(rate=rate).linear_friction("dry", "rail", smoothing=0.0, **law).scene()


STOPPED = 2.0 * quad(lambda v: 1.0 / (1.0 + 1.0 / (1.0 + (v / 0.4) ** 2)), 0.0, 3.0, epsabs=1e-14)[0]


def told(run: fm.Trajectory) -> list[str]:
    return [event.name for event in run.events]


# The law


def test_the_curve_of_stribeck_holds_up_to_the_zero_of_the_speed() -> None:
    run = fm.simulate(thrown(), 8.0, **TIGHT)
    [stop] = run.events
    assert stop.name == "dry: sticks" and stop.t == pytest.approx(STOPPED, rel=BOUND)
    v = run.u[run.t < stop.t, 0]
    np.testing.assert_allclose(
        run.hinge_forces["dry"][run.t < stop.t, 0], -(1.0 + 1.0 / (1.0 + (v / 0.4) ** 2)), rtol=BOUND
    )
    assert run.hinge_forces["dry"][-1, 0] == 0.0 == run.signals["dry: holding"][-1, 0]


@pytest.mark.parametrize(("method", "near"), [("radau5", 1e-8), ("exponential", 1e-8), ("rk4", 1e-8),
                                              ("generalised_alpha", 1e-4)])  # fmt: skip
def test_methods(method: str, near: float) -> None:
    given = {"step": 0.01} if INTEGRATORS[method].fixed else {"rtol": 1e-11, "atol": 1e-13}
    run = fm.simulate(thrown(), 8.0, method, **given)
    assert told(run) == ["dry: sticks"] and run.events[0].t == pytest.approx(STOPPED, rel=near)


@pytest.mark.parametrize("algorithm", ["composite", "frisch"])
def test_algorithms(algorithm: str) -> None:
    run, other = fm.simulate(belt(), 3.0, **TIGHT), fm.simulate(belt(), 3.0, algorithm=algorithm, **TIGHT)
    assert told(run) == told(other) and len(told(run)) > 5
    np.testing.assert_allclose([e.t for e in other.events], [e.t for e in run.events], rtol=BOUND)


def test_an_evaluation_has_the_law_where_it_moves_and_is_refused_at_rest() -> None:
    system = fm.compile(thrown(1.0))
    state = system.initial_state
    load = -(1.0 + 1.0 / (1.0 + 6.25))
    assert system.evaluate(0.0, state.q, state.u).hinge_forces["dry"] == pytest.approx(load)
    assert system.accelerations(state) == pytest.approx(load / 2.0)
    by_speed = 2.0 / 0.16 / (1.0 + 6.25) ** 2
    assert system.evaluation_derivatives(state).hinge_forces["dry"].by_speed == pytest.approx(by_speed)
    assert system.acceleration_derivatives(state).by_speed == pytest.approx(by_speed / 2.0)
    dense = DenseSystem(thrown(1.0))
    assert dense.accelerations(0.0, state.q, state.u) == pytest.approx(load / 2.0)
    still = system.state(state.q, [0.0])
    for asked in (
        lambda: system.accelerations(still), lambda: system.evaluate(0.0, still.q, still.u),
        lambda: system.evaluation_derivatives(still), lambda: system.acceleration_derivatives(still),
        lambda: system.evaluator()(0.0, np.zeros(1), np.zeros(1)),
    ):  # fmt: skip
        with pytest.raises(fm.DynamicsError, match='friction "dry" sticks .* decided in a run; use flexmb.simulate'):
            asked()


# Runs


@pytest.mark.parametrize(("cut", "phase"), [(0.05, "sticking"), (0.5, "backward"), (0.7, "sticking")])
def test_a_run_is_resumed_to_the_last_bit(cut: float, phase: str, tmp_path: Path) -> None:
    """While it sticks, while it slips, and after both."""
    scene, times = belt(), [0.05, 0.5, 0.7, 2.0]
    whole = fm.simulate(scene, 2.0, samples=[0.0, *times])
    first = fm.simulate(scene, cut, samples=[0.0, *[t for t in times if t <= cut]])
    assert first.restart is not None
    first.restart.save(tmp_path / "run.npz")
    restart = fm.Restart.load(tmp_path / "run.npz")
    rest = fm.simulate(restart.scene, 2.0, samples=[cut, *[t for t in times if t > cut]], state=restart)
    np.testing.assert_array_equal(rest.q[-1], whole.q[-1])
    assert [(e.name, e.t) for e in (*first.events, *rest.events)] == [(e.name, e.t) for e in whole.events]
    [friction] = [each for each in restart.scene.connectors if each.name == "dry"]
    assert friction.phase == phase and len(events_of(restart.scene)) == (1 if phase == "backward" else 2)


def test_copies_are_run_as_single_ones() -> None:
    scenes = [thrown(rate) for rate in (1.0, 2.0, 3.0)]
    many = fm.simulate_batch(scenes, 8.0)
    for events, scene in zip(many.events, scenes, strict=True):
        assert [(e.name, e.t) for e in events] == [(e.name, e.t) for e in fm.simulate(scene, 8.0).events]
        assert len(events) == 1


def test_stages_and_files(tmp_path: Path) -> None:
    scene = belt()
    run = fm.simulate_stages(scene, [fm.RunStage(0.4), fm.RunStage(0.6)], **TIGHT)
    whole = fm.simulate(scene, 1.0, **TIGHT)
    np.testing.assert_allclose(run.q[-1], whole.q[-1], rtol=BOUND)
    assert told(run) == told(whole)
    fm.save_scene(scene, tmp_path / "belt.toml")
    assert fm.load_scene(tmp_path / "belt.toml") == scene
    estimated = fm.simulate(scene, 1.0).error_estimate()
    assert 0.0 < max(np.max(error) for name, error in estimated.items() if "slip" in name) < 1e-6


def test_an_impulse_passes_by_what_friction_holds() -> None:
    """A bounded load has no part in an impulse: the lower block is struck as if it were free, then slides to rest."""
    builder = body(body(fm.SceneBuilder("hit"), "lower", 2.0), "upper", 1.0)
    scene = (
        builder.prismatic("floor", "ground", "lower", axis=ALONG_X)
        .prismatic("between", "lower", "upper", axis=ALONG_X, position=-1.0, rate=2.0)
        .linear_friction("dry", "floor", sliding=3.0, static=4.0, smoothing=0.0)
        .event(
            "stop", "between.translation", 0.0, fm.Impact(coordinate="between.translation", restitution=0.5),
            crossing="rising",
        )
        .scene()
    )  # fmt: skip
    run = fm.simulate(scene, 2.0, **TIGHT)
    assert told(run) == ["stop", "dry: slips", "dry: sticks"]
    np.testing.assert_allclose(run.events[0].after.u, [1.0, -1.0], rtol=1e-12)
    assert run.events[2].t == pytest.approx(0.5 + 1.0 / (3.0 / 2.0), rel=BOUND)
    assert np.abs(run.energy_drift).max() < 1e-12


def test_a_latch_carries_the_load_alone_and_friction_takes_over_when_it_opens() -> None:
    """Released where the spring pulls with less than static friction."""
    scene = (
        block(rate=1.0, stiffness=20.0)
        .linear_friction("dry", "rail", sliding=3.0, smoothing=0.0)
        .event("held", "time", 0.1, fm.Latch(coordinate="rail.translation"))
        .event("free", "time", 0.3, fm.Release(coordinate="rail.translation"))
        .scene()
    )
    run = fm.simulate(scene, 0.5, samples=501, **TIGHT)
    assert told(run) == ["held", "free"] and not run.drives["rail"][run.t > 0.3].any()
    at = run.events[0].after.q[0]
    load = run.hinge_forces["dry"][:, 0]
    assert np.all(load[run.t < 0.0999] == -3.0) and not load[(run.t > 0.1) & (run.t < 0.2999)].any()
    np.testing.assert_allclose(load[run.t > 0.3], 20.0 * at, rtol=BOUND)
    assert 0.0 < 20.0 * at < 3.0


def test_rest_on_a_stop_beside_friction() -> None:
    """A rail upright: the stop carries the weight alone."""
    builder = body(fm.SceneBuilder("stop", gravity=(0.0, 0.0, -9.81)), "block", 2.0)
    floor = fm.Impact(coordinate="rail.translation", restitution=0.5, rests=True)
    scene = (
        builder.prismatic("rail", "ground", "block", position=1.0)
        .linear_friction("dry", "rail", sliding=3.0, static=5.0, smoothing=0.0)
        .event("floor", "rail.translation", 0.0, floor, crossing="falling")
        .scene()
    )
    run = fm.simulate(scene, 3.0)
    assert told(run)[-1] == "floor: at rest"
    assert run.events[0].t == pytest.approx(np.sqrt(2.0 / (9.81 - 1.5)), rel=BOUND)
    assert run.signals["floor: stop"][-1, 0] == pytest.approx(2.0 * 9.81) and run.hinge_forces["dry"][-1, 0] == 0.0


def geared(*frictions: tuple[str, float]) -> fm.Scene:
    builder = body(body(fm.SceneBuilder("gear"), "slow", 2.0), "fast", 1.0)
    builder = (
        builder.prismatic("a", "ground", "slow", axis=ALONG_X, rate=1.0, stiffness=50.0)
        .prismatic("b", "ground", "fast", axis=ALONG_X, rate=2.0)
        .coupling("gear", "b", {"a": 2.0})
    )
    for hinge, sliding in frictions:
        builder = builder.linear_friction(f"on {hinge}", hinge, sliding=sliding, smoothing=0.0)
    return builder.scene()


def test_a_closed_chain_as_the_one_body_that_it_is() -> None:
    """A gear of ratio 2: mass 2 + 4 * 1, friction 2 * 1."""
    one = body(fm.SceneBuilder("one"), "block", 6.0).prismatic(
        "a", "ground", "block", axis=ALONG_X, rate=1.0, stiffness=50.0
    )
    alone = fm.simulate(one.linear_friction("dry", "a", sliding=2.0, smoothing=0.0).scene(), 8.0, **TIGHT)
    run = fm.simulate(geared(("b", 1.0)), 8.0, **TIGHT)
    assert told(run) == [name.replace("dry", "on b") for name in told(alone)]
    assert told(run)[-1] == "on b: sticks" and len(told(run)) == 5
    np.testing.assert_allclose([e.t for e in run.events], [e.t for e in alone.events], rtol=BOUND)
    np.testing.assert_allclose(2.0 * run.hinge_forces["on b"][-1], alone.hinge_forces["dry"][-1], rtol=BOUND)


def test_frictions_at_rest_that_move_together_only_are_refused() -> None:
    with pytest.raises(fm.DynamicsError, match='friction "on a" and "on b" is at rest on coordinates that move tog'):
        fm.simulate(geared(("a", 1.0), ("b", 1.0)), 8.0)


def test_a_mechanism_without_freedom_leaves_friction_nothing_to_carry() -> None:
    """The gear's other side is latched while both move: what holds the mechanism has the whole load."""
    scene = geared(("b", 1.0))
    latch = fm.SceneEvent(name="stop", watch="time", level=0.2, actions=(fm.Latch(coordinate="a.translation"),))
    run = fm.simulate(replace(scene, events=(latch,)), 0.5)
    assert told(run) == ["stop"] and not run.u[-1].any() and abs(run.hinge_forces["on b"][-1, 0]) == 0.0
    assert run.drives["a"][-1, 0] == pytest.approx(50.0 * run.q[-1, 0])


def test_a_bearing_brings_wheel_and_body_to_one_rate() -> None:
    builder = body(fm.SceneBuilder("wheel"), "bus", 2.0).free("flight", "ground", "bus")
    of_wheel = {"mass": 0.1, "axial_inertia": 0.1, "transverse_inertia": 0.1, "speed": 10.0}
    builder = builder.wheel("rw", "bus", axis=(0, 0, 1), **of_wheel)
    scene = builder.angular_friction("bearing", "rw", sliding=0.05, smoothing=0.0).scene()
    run = fm.simulate(scene, 25.0, **TIGHT)
    assert told(run) == ["bearing: sticks"]
    assert run.events[0].t == pytest.approx(10.0 / (0.05 / 0.1 + 0.05), rel=BOUND)
    assert run.u[-1, -1] == 0.0 and np.abs(run.momentum_drift).max() < 1e-13


def test_a_sampled_controller_breaks_it_loose_at_the_sample_that_is_beyond() -> None:
    """Its integral rises by 0.05 N a sample, from 1 N; static friction is 2.02 N: the 22nd sample after the first."""
    scene = (
        block(force=fm.ControlSignal(source="law"), position=0.5)
        .sense_coordinate("x", "rail")
        .pid("law", "x", kp=2.0, ki=10.0, period=0.01)
        .linear_friction("dry", "rail", sliding=1.0, static=2.02, smoothing=0.0)
        .scene()
    )
    run = fm.simulate(scene, 0.5, samples=1001)
    first = run.events[0]
    u = run.signals["law"][:, 0]
    beyond = run.t[np.flatnonzero(np.abs(u) > 2.02)[0]]
    assert first.name == "dry: slips" and first.t == pytest.approx(beyond, abs=1e-12) and first.t > 0.1
    assert np.ptp(run.q[run.t < first.t]) == 0.0


def test_a_load_that_just_reaches_static_friction_does_not_chatter() -> None:
    for force in (fm.Constant(value=2.0), fm.Sine(amplitude=2.0, angular_frequency_rad_s=3.0)):
        scene = block(force=force).linear_friction("dry", "rail", sliding=2.0, smoothing=0.0).scene()
        run = fm.simulate(scene, 10.0)
        assert run.finished and not run.events and not run.u.any()


# Checks and refusals


@pytest.mark.parametrize(
    ("friction", "what"),
    [
        ({"sliding": 1.0, "stribeck": 0.1}, "no static friction"),
        ({"sliding": 2.0, "static": 1.0}, "below sliding"),
        ({"sliding": 0.0}, "there is no friction"),
    ],
)
def test_laws_that_are_none(friction: dict[str, Any], what: str) -> None:
    with pytest.raises(fm.SceneError, match=what):
        block().linear_friction("dry", "rail", smoothing=0.0, **friction).scene()


def test_scenes_that_are_none() -> None:
    dry = block().linear_friction("dry", "rail", sliding=1.0, smoothing=0.0)
    with pytest.raises(fm.SceneError, match='"dry" sticks along rail.translation too'):
        dry.linear_friction("other", "rail", sliding=1.0, smoothing=0.0).scene()
    with pytest.raises(fm.SceneError, match='"dry: holding" is the load by which friction "dry" holds'):
        dry.sense_time("dry: holding").scene()
    with pytest.raises(fm.SceneError, match='"dry: sticks" is what a run says of friction'):
        dry.event("dry: sticks", "time", 1.0, fm.EndRun()).scene()
    with pytest.raises(fm.SceneError, match="rail.translation is prescribed"):
        block(prescribed=fm.Ramp(rate=1.0)).linear_friction("dry", "rail", sliding=1.0, smoothing=0.0).scene()
    with pytest.raises(fm.SceneError, match='its phase is "forward", but smooth friction has none'):
        block().linear_friction("dry", "rail", sliding=1.0, smoothing=0.1, phase="forward").scene()


REFUSED: dict[str, Callable[[fm.Scene], object]] = {
    "equilibrium": fm.equilibrium,
    "linearize": fm.linearize,
    "linearize_sampled": lambda scene: fm.linearize_sampled(scene, 0.01),
    "base_excitation": fm.base_excitation,
    "equilibrium_path": lambda scene: fm.equilibrium_path(scene, "block.mass_kg", [1.0, 2.0]),
    "steady_spin": lambda scene: fm.steady_spin(scene, "rail", 1.0),
    "sensitivities": lambda scene: fm.sensitivities(scene, 1.0, ["block.mass_kg"], ["energy.kinetic"]),
    "gradient": lambda scene: fm.gradient(scene, 1.0, ["block.mass_kg"], fm.FinalValue("energy.kinetic")),
    "uncertainty": lambda scene: fm.uncertainty(scene, 1.0, {"block.mass_kg": 0.1}, ["energy.kinetic"]),
    "advise": lambda scene: fm.advise(scene, 1e-3, t_end=1.0),
    "export": refuse,
}


@pytest.mark.parametrize("asked", REFUSED)
def test_what_has_no_answer_is_refused_by_name(asked: str) -> None:
    with pytest.raises((NotImplementedError, NotExportable), match='friction "dry" sticks .*smoothing speed'):
        REFUSED[asked](thrown())


def test_engines_whose_friction_is_smooth_refuse_it() -> None:
    class Smooth(NativeEngine):
        takes = ("connectors",)

    found = CheckedEngine(Smooth()).supports(thrown())
    assert found.kind == "no" and "never sticks" in found.reason
    assert CheckedEngine(NativeEngine()).supports(thrown()).kind == "exact"


def test_a_case_can_leave_its_friction_out() -> None:
    """The fault "no friction" of a case: a scene that can be run, without any load."""
    [mutation] = [each for each in MUTATIONS if each.name == "connector_losses"]
    run = fm.simulate(mutation.change(thrown(), "dry"), 1.0)
    assert not run.events and not run.hinge_forces["dry"].any()
