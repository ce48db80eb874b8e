"""Closures that open and close in a run: separation, docking, capture; closed forms, dense M, twins."""

from __future__ import annotations

from typing import Any, get_args

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.dense import DenseSystem
from flexmb.dense.body_frames import Motions
from flexmb.dense.closures import rows, wrenches
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.scene.hinges import ClosureKind
from flexmb.scene.shapes import beam_section
from flexmb.scene.values import PathError
from tests.flexmb.sensitivity.test_sensitivities import agrees

Z = (0.0, 0.0, 1.0)
# Where the closure is closed at the start, it does not allow the speeds of two bodies in flight: told.
CHANGED = pytest.mark.filterwarnings("ignore:.*the nearest values that they allow are taken:flexmb.SceneWarning")
STRIP = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700.0)
SHARP = {"rtol": 1e-12, "atol": 1e-13}


def at(t: float, *actions: Any, name: str = "now") -> fm.SceneEvent:
    return fm.SceneEvent(name=name, watch="time", level=t, actions=actions)


def opened(t: float, closure: str = "port") -> fm.SceneEvent:
    return at(t, fm.Separate(closure=closure), name="opens")


def closed(t: float, closure: str = "port", **tolerances: float) -> fm.SceneEvent:
    return at(t, fm.Dock(closure=closure, **tolerances), name="closes")


# Separation

LAUNCHER, SATELLITE, STROKE = 900.0, 150.0, 0.08
SPRINGS = {"one": (0.3, 0.0, 4e4), "two": (-0.2, 0.25, 3e4), "three": (-0.1, -0.25, 5e4)}  # y, z (m), stiffness (N/m)


def launcher(springs: dict[str, tuple[float, float, float]], lets_go: bool = True) -> fm.Scene:
    """A stage and a satellite in flight, clamped together against springs that let go at the end of their stroke."""
    scene = fm.SceneBuilder("launcher")
    scene.rigid_body("stage", mass=LAUNCHER, inertia=(200.0, 900.0, 950.0))
    scene.rigid_body("satellite", mass=SATELLITE, inertia=(20.0, 30.0, 25.0))
    scene.free("flight", "ground", "stage", velocity=(7.0, -3.0, 2.0))
    scene.free("leaves", "ground", "satellite", position=(2.0, 0.0, 0.0), velocity=(7.0, -3.0, 2.0))
    scene.closure("clamp", "weld", "stage", "satellite", position_a=(2.0, 0.0, 0.0))
    for name, (y, z, stiffness) in springs.items():
        scene.spring_damper(name, "stage", "satellite", position_a=(1.5, y, z), position_b=(-0.3, y, z),
                            free_length=0.2 + STROKE, stiffness=stiffness)  # fmt: skip
        scene.marker(f"{name}: foot", "stage", offset=(1.5, y, z))
        scene.marker(f"{name}: head", "satellite", offset=(-0.3, y, z))
        scene.sense_distance(f"{name}: length", f"{name}: foot", f"{name}: head")
        scene.event(
            f"{name} is out", f"{name}: length[0]", 0.2 + STROKE, fm.Change(path=f"{name}.stiffness_N_m", value=0.0)
        )
    scene.sense_load("held", "clamp")
    return scene.add(*[opened(0.1, "clamp")] * lets_go).scene()


def test_springs_drive_two_stages_apart():
    """Along one axis: v = s sqrt(k/mu), with the reduced mass mu, and the centre of mass goes on as it did."""
    stiffness = 1e5
    run = fm.simulate(launcher({"spring": (0.0, 0.0, stiffness)}), 0.6, samples=61, **SHARP)
    assert [event.name for event in run.events] == ["opens", "spring is out"]
    reduced = LAUNCHER * SATELLITE / (LAUNCHER + SATELLITE)
    speed = STROKE * np.sqrt(stiffness / reduced)
    assert run.events[1].t - 0.1 == pytest.approx(0.5 * np.pi * np.sqrt(reduced / stiffness), rel=1e-12)
    expected = 7.0 + np.array([-SATELLITE, LAUNCHER]) / (LAUNCHER + SATELLITE) * speed
    assert run.u[-1, [3, 9]] == pytest.approx(expected, rel=1e-12)
    assert run.loads["clamp"][run.t < 0.1, 3] == pytest.approx(-stiffness * STROKE, rel=1e-12)  # it pulls against them
    assert np.array_equal(run.loads["clamp"][run.t >= 0.1], np.zeros_like(run.loads["clamp"][run.t >= 0.1]))
    held = fm.simulate(launcher({"spring": (0.0, 0.0, stiffness)}, lets_go=False), 0.6, samples=3, **SHARP)
    assert abs(held.u[-1, 9] - 7.0) < 1e-12  # without the event nothing of this happens


def test_separation_keeps_momentum_and_the_energy_of_its_springs():
    """Three unequal springs turn both bodies; each lets go by itself."""
    run = fm.simulate(launcher(SPRINGS), 0.6, samples=61, **SHARP)
    assert len(run.events) == 4 and run.events[0].energy_change == 0.0
    assert np.array_equal(run.events[0].before.u, run.events[0].after.u)
    size = np.abs(run.momentum).max()
    assert np.abs(run.momentum_drift).max() < 1e-12 * size
    kinetic = run.energy["kinetic"]
    stored = sum(0.5 * k * STROKE**2 for _, _, k in SPRINGS.values())
    assert kinetic[-1] - kinetic[0] == pytest.approx(stored, abs=1e-12 * kinetic[0])
    assert np.abs(run.u[-1, [1, 2, 7, 8]]).min() > 1e-3  # both turn
    early = launcher(SPRINGS)
    events = [msgspec.structs.replace(e, level=0.2 + 0.5 * STROKE) if "one" in e.name else e for e in early.events]
    less = fm.simulate(msgspec.structs.replace(early, events=tuple(events)), 0.6, samples=3, **SHARP)
    lost = 0.5 * SPRINGS["one"][2] * (0.5 * STROKE) ** 2
    gained = less.energy["kinetic"][-1] - less.energy["kinetic"][0]
    assert gained == pytest.approx(stored - lost, abs=1e-12 * kinetic[0])  # a spring that goes half-way gives less


# What is open

HALF = -0.5 * (np.pi + 0.2)  # of the turn from the tip of one arm to that of the other


def pair(kind: str | None, *events: fm.SceneEvent, is_closed: bool = False) -> fm.Scene:
    """Two bodies with flexible arms, in flight, whose tips meet; a closure of some kind between these."""
    scene = fm.SceneBuilder("pair")
    for name, side in (("a", -1.0), ("b", 1.0)):
        scene.rigid_body(name, mass=3.0, inertia=(1.0, 2.0, 2.5))
        scene.beam(f"arm {name}", length=1.0, elements=4, section=STRIP, modes=3)
        scene.revolute(f"root {name}", name, f"arm {name}", axis=Z, angle=0.1 * side, stiffness=40.0)
    scene.free("flight a", "ground", "a", velocity=(0.2, 0.0, 0.1), angular_velocity=(0.4, -0.3, 0.5))
    scene.free("flight b", "ground", "b", position=(2.0 * np.cos(0.1), 0.0, 0.0), quaternion=(0.0, 0.0, 0.0, 1.0),
               velocity=(0.3, -0.1, 0.2), angular_velocity=(0.1, 0.2, -0.3))  # fmt: skip
    if kind is not None:
        turned = (np.cos(HALF), 0.0, 0.0, np.sin(HALF))
        scene.closure("port", kind, "arm a", "arm b", node_a="tip", node_b="tip", quaternion_b=turned, closed=is_closed)
        scene.sense_load("felt", "port")
        scene.total_load("all", ["port"], "arm b").event("never", "felt[0]", 1e9, fm.EndRun())  # so that it is a signal
    # Arms without torsion, whatever a joint carries: that is not what it is for.
    return msgspec.structs.replace(scene.add(*events).scene(), allow=("few_modes",))


def approaching(scene: fm.Scene, t: float) -> fm.State:
    """A state from which the tips meet at time t (s), with the scene's own speeds: the motion there, backwards."""
    tree = fm.compile(pair(None))
    met = tree.initial_state
    last = fm.simulate(tree, t, state=tree.state(met.q, -met.u, 0.0), samples=2, **SHARP).last_state
    return fm.compile(scene).state(last.q, -last.u, 0.0)


@CHANGED
@pytest.mark.parametrize("kind", get_args(ClosureKind))
def test_an_open_closure_is_none(kind):
    """The same motion to the last bit as without it, and whatever reads its load reads zero."""
    scene, without = pair(kind, closed(9.0)), pair(None)
    run, other = (fm.simulate(each, 0.2, samples=5) for each in (scene, without))
    assert np.array_equal(run.q, other.q) and np.array_equal(run.u, other.u)
    zero = np.zeros((5, 6))
    assert np.array_equal(run.loads["port"], zero) and np.array_equal(run.signals["felt"], zero)
    assert np.array_equal(run.total_loads["all"], zero)
    system = fm.compile(scene)
    assert np.array_equal(system.hinge_loads(system.initial_state)["port"], zero[0])
    assert len(system.closure_operators(system.initial_state).rows) == 0 and system.rank == 0
    now_closed = fm.compile(pair(kind, opened(9.0), is_closed=True))
    assert np.abs(now_closed.hinge_loads(now_closed.initial_state)["port"]).max() > 1e-3  # it carries something
    assert now_closed.rank > 0


@CHANGED
def test_every_reader_of_loads_reads_zero_while_a_closure_is_open():
    scene = pair("weld", opened(0.1), closed(0.1 + 1e-9, tolerance_m=1e-6, tolerance_rad=1e-6), is_closed=True)
    run = fm.simulate(pair("weld", opened(0.1), is_closed=True), 0.2, samples=21)
    open_now = run.t >= 0.1
    readers = [
        run.loads["port"], run.loads_in("world", ("arm b", "tip"))["port"], run.total_load(["port"], "arm b"),
        run.signals["felt"], run.total_loads["all"],
    ]  # fmt: skip
    for load in readers:
        assert np.array_equal(load[open_now], np.zeros_like(load[open_now])) and np.abs(load[~open_now]).max() > 1e-3
    assert np.isfinite(run.section_loads("arm b", [0.5]).load).all()
    assert np.abs(run.envelope.loads["port"].greatest).max() > 1e-3  # from before it opened
    again = fm.simulate(scene, 0.2, samples=21)
    assert np.abs(again.loads["port"][again.t > 0.1]).max() > 1e-3  # closed again, it carries load


@CHANGED
@pytest.mark.parametrize("method", INTEGRATORS)
def test_every_method_passes_both_events(method):
    given: dict[str, Any] = {"step": 1e-4} if INTEGRATORS[method].fixed else {"rtol": 1e-8, "atol": 1e-10}
    scene = pair("weld", opened(0.02), closed(0.03, tolerance_m=0.05, tolerance_rad=0.05), is_closed=True)
    run = fm.simulate(scene, 0.06, method, samples=7, **given)
    assert run.finished and [event.name for event in run.events] == ["opens", "closes"]
    reference = fm.simulate(scene, 0.06, samples=7, **SHARP)
    assert np.abs(run.q - reference.q).max() < 1e-4 and np.abs(run.q[-1] - run.q[0]).max() > 1e-3


# Docking

@pytest.mark.parametrize("kind", ["weld", "spherical", "revolute", "prismatic"])
def test_docking_of_two_flexible_bodies(kind):
    """The impulse against the dense M and J: M (u+ - u-) = J'L with J u+ = 0."""
    scene = pair(kind, closed(0.1))
    run = fm.simulate(scene, 0.2, state=approaching(scene, 0.1), samples=21, **SHARP)
    [event] = run.events
    before, after = event.before, event.after
    assert np.abs(after.q - before.q).max() < 1e-9 and max(event.misfits["port"]) < 1e-9
    dense = DenseSystem(pair(kind, is_closed=True))
    M = dense.mass_matrix(after.q)
    J = rows(dense, dense.scene.closures[0], Motions(after.q, np.eye(dense.nu), np.zeros((dense.nu, dense.nu))))[1].T
    L = np.linalg.solve(J @ np.linalg.solve(M, J.T), -J @ before.u)
    expected = before.u + np.linalg.solve(M, J.T @ L)
    assert np.abs(after.u - expected).max() < 1e-10 * np.abs(expected).max()
    wrench = wrenches(dense, after.q)["port"] @ L
    assert np.abs(event.closures["port"] - wrench).max() < 1e-10 * np.abs(wrench).max()
    lost = 0.5 * (expected @ M @ expected - before.u @ M @ before.u)
    assert event.energy_change == pytest.approx(lost, rel=1e-10) and lost < -1e-3
    assert np.abs(run.momentum_drift).max() < 1e-10 * np.abs(run.momentum).max()
    assert np.abs(run.energy_drift).max() < 1e-10 * run.energy_scale
    assert np.abs(M @ (after.u - before.u)).max() > 1e-2  # the impulse is one


def test_after_docking_the_motion_is_that_of_the_closed_scene():
    scene = pair("weld", closed(0.1))
    run = fm.simulate(scene, 0.2, state=approaching(scene, 0.1), samples=21, **SHARP)
    twin = fm.compile(pair("weld", is_closed=True))
    start = run.events[0].after
    other = fm.simulate(twin, 0.2, t_start=0.1, state=twin.state(start.q, start.u, 0.1), samples=11, **SHARP)
    assert np.abs(run.q[10:] - other.q).max() < 1e-9
    assert np.abs(run.loads["port"][10:] - other.loads["port"]).max() < 1e-6
    apart = fm.simulate(pair("weld", closed(9.0)), 0.2, state=approaching(scene, 0.1), samples=21, **SHARP)
    assert np.abs(run.q[-1] - apart.q[-1]).max() > 1e-3


def arm_and_target(*events: fm.SceneEvent, target: tuple[float, ...], velocity: tuple[float, ...]) -> fm.Scene:
    """A satellite with an arm of two links, and a body that drifts into its gripper."""
    scene = fm.SceneBuilder("capture")
    scene.rigid_body("satellite", mass=50.0, inertia=(8.0, 8.0, 8.0))
    scene.rigid_body("target", mass=12.0, inertia=(1.0, 1.5, 2.0))
    scene.free("flight", "ground", "satellite").free("drifts", "ground", "target", position=target, velocity=velocity)
    for name, parent, angle, place in (("upper", "satellite", 0.5, 0.5), ("lower", "upper", -0.8, 1.0)):
        scene.rigid_body(name, mass=2.0, com=(0.5, 0.0, 0.0), inertia=(0.01, 0.2, 0.2))
        scene.revolute(f"{name} joint", parent, name, axis=Z, angle=angle, parent_position=(place, 0.0, 0.0),
                       damping=0.5, torque=fm.Sine(amplitude=0.3, angular_frequency_rad_s=2.0))  # fmt: skip
    scene.marker("hand", "lower", offset=(1.0, 0.0, 0.0)).marker("handle", "target", offset=(-0.2, 0.0, 0.0))
    scene.closure("grip", "spherical", "lower", "target", position_a=(1.0, 0.0, 0.0), position_b=(-0.2, 0.0, 0.0),
                  closed=False)  # fmt: skip
    return scene.add(*events).scene()


def test_capture_by_an_arm():
    """The target is where the hand comes to be; plastic impact through the mass matrix of the whole."""
    velocity = (-0.3, 0.1, 0.0)
    far_away = arm_and_target(closed(9.0, "grip"), target=(9.0, 0.0, 0.0), velocity=velocity)
    alone = fm.simulate(far_away, 1.0, samples=2, **SHARP)
    target = alone.markers["hand"].position[-1] + (0.2, 0.0, 0.0) - np.array(velocity)
    scene = arm_and_target(closed(1.0, "grip"), target=tuple(target), velocity=velocity)
    run = fm.simulate(scene, 2.0, samples=41, **SHARP)
    [event] = run.events
    assert event.misfits["grip"][0] < 1e-11 and event.energy_change < -1e-2
    assert np.abs(run.momentum_drift).max() < 1e-12 * np.abs(run.momentum).max()
    assert np.abs(run.energy_drift).max() < 1e-10 * run.energy_scale
    apart = run.markers["hand"].position - run.markers["handle"].position
    assert np.abs(apart[run.t >= 1.0]).max() < 1e-12 and np.abs(apart[0]).max() > 0.1
    assert np.array_equal(run.loads["grip"][run.t < 1.0], np.zeros((20, 6)))
    assert np.all(np.abs(run.loads["grip"][run.t >= 1.0]).max(axis=1) > 1e-3)  # from the same instant


# Misfits

def gap(**tolerances: float) -> fm.Scene:
    scene = fm.SceneBuilder("gap")
    for name, mass in (("a", 3.0), ("b", 1.0)):
        scene.rigid_body(name, mass=mass, inertia=(1.0, 1.0, 1.0))
    scene.prismatic("rail a", "ground", "a", axis=(1.0, 0.0, 0.0), rate=1.0)
    scene.free("flight", "ground", "b", position=(1.0, 0.02, 0.0), quaternion=(np.cos(0.01), 0.0, 0.0, np.sin(0.01)))
    scene.closure("port", "weld", "a", "b", position_a=(0.5, 0.0, 0.0), closed=False)
    return scene.add(closed(0.5, **tolerances)).scene()


def test_a_misfit_within_tolerance_is_corrected_and_told():
    run = fm.simulate(gap(tolerance_m=0.03, tolerance_rad=0.03), 1.0, samples=5)
    [event] = run.events
    assert event.misfits["port"] == pytest.approx((0.02, 0.02), abs=1e-12)
    assert np.abs(run.energy_drift).max() < 1e-12
    system = fm.compile(gap())
    assert max(system.closure_gaps(event.before)["port"]) == 0.0  # of what is open nothing is asked
    twin = fm.compile(msgspec.structs.replace(gap(), events=(), closures=(replaced_closed(),)))
    assert max(twin.closure_gaps(event.before)["port"]) > 0.01 and max(twin.closure_gaps(event.after)["port"]) < 1e-12


def replaced_closed() -> fm.Closure:
    return msgspec.structs.replace(gap().closures[0], closed=True)


@pytest.mark.parametrize("tolerances", [{}, {"tolerance_m": 0.03}, {"tolerance_rad": 0.03}, {"tolerance_m": 0.019,
                                                                                          "tolerance_rad": 0.03}])
def test_a_misfit_beyond_tolerance_is_refused(tolerances):
    with pytest.raises(fm.DynamicsError, match='closes closure "port", whose frames are 0.02 m and 0.02 rad apart'):
        fm.simulate(gap(**tolerances), 1.0)


@pytest.mark.parametrize("kind", get_args(ClosureKind))
def test_what_is_gripped_as_it_is_found_stays_where_it_is(kind):
    """No body moves, so that momentum is kept whatever the misfit; but that of the frames is told as ever."""
    tolerant = {"tolerance_m": 0.2, "tolerance_rad": 0.5}
    runs = [
        fm.simulate(pair(kind, at(0.1, fm.Dock(closure="port", as_found=found, **tolerant))), 0.2, samples=21, **SHARP)
        for found in (True, False)
    ]  # fmt: skip
    size = np.abs(runs[0].momentum).max()
    for run, is_found in zip(runs, (True, False), strict=True):
        [event] = run.events
        assert np.abs(run.energy_drift).max() < 1e-10 * run.energy_scale
        moved, change = np.abs(event.after.q - event.before.q).max(), np.abs(run.momentum_drift).max()
        assert (moved < 1e-11 and change < 1e-11 * size) == is_found
    assert runs[0].events[0].misfits == runs[1].events[0].misfits
    assert max(runs[0].events[0].misfits["port"]) > 1e-4 and runs[0].events[0].energy_change < 0.0
    held, given = runs[0].restart.scene.closures[0], pair(kind, closed(9.0)).closures[0]
    assert held.closed and (held.position_b_m, held.quaternion_b) != (given.position_b_m, given.quaternion_b)


def test_a_closure_that_closes_again_has_the_frames_of_the_scene():
    tolerant = {"tolerance_m": 0.2, "tolerance_rad": 0.5}
    events = [
        at(0.1, fm.Dock(closure="port", as_found=True, **tolerant), name="grips"),
        at(0.1, fm.Separate(closure="port"), name="lets go"),
        at(0.1, fm.Dock(closure="port", **tolerant), name="docks"),
    ]  # fmt: skip
    run = fm.simulate(pair("weld", *events), 0.2, samples=3)
    grips, _, docks = run.events
    assert docks.misfits["port"] == pytest.approx(grips.misfits["port"], rel=1e-9)
    assert run.restart.scene.closures == pair("weld", opened(9.0), is_closed=True).closures


def test_frames_half_a_turn_apart_do_not_close():
    turned = gap(tolerance_m=9.0, tolerance_rad=1.5).with_values({"flight.quaternion": (0.0, 0.0, 0.0, 1.0)})
    with pytest.raises(fm.DynamicsError, match="at least 1.57 rad apart"):
        fm.simulate(turned, 1.0)


# What else a run has

@CHANGED
def test_what_is_open_may_be_closed_again_and_opened():
    """Docking what is closed, or opening what is open, changes nothing."""
    tolerant = {"tolerance_m": 0.5, "tolerance_rad": 0.5}
    events = [
        at(0.05, fm.Dock(closure="port"), name="is closed"), at(0.1, fm.Separate(closure="port"), name="opens"),
        at(0.15, fm.Separate(closure="port"), name="is open"),
        at(0.2, fm.Dock(closure="port", **tolerant), name="closes"),
        at(0.3, fm.Separate(closure="port"), name="leaves"),
    ]  # fmt: skip
    run = fm.simulate(pair("spherical", *events, is_closed=True), 0.4, samples=41)
    assert [event.energy_change == 0.0 for event in run.events] == [True, True, True, False, True]
    carries = np.abs(run.loads["port"]).max(axis=1) > 0.0
    assert np.array_equal(carries, (run.t < 0.1 - 1e-9) | ((run.t > 0.2 - 1e-9) & (run.t < 0.3 - 1e-9)))
    assert np.abs(run.energy_drift).max() < 1e-6 * run.energy_scale


def test_a_clamp_breaks_where_its_load_is_too_large():
    """An event on the load of a closure: the weight it holds grows as it is pulled up."""
    scene = fm.SceneBuilder("breaks", gravity=(0.0, 0.0, -10.0)).rigid_body("weight", mass=2.0, inertia=(1.0, 1.0, 1.0))
    scene.free("falls", "ground", "weight").closure("clamp", "weld", "ground", "weight")
    scene.force("pull", "weight", direction=(0.0, 0.0, -1.0), function=fm.Ramp(rate=10.0))
    scene.sense_load("felt", "clamp")
    scene.event("breaks", "felt[5]", 30.0, fm.Separate(closure="clamp"))
    run = fm.simulate(scene.scene(), 2.0, samples=5)
    [event] = run.events
    assert event.t == pytest.approx(1.0, abs=1e-9)
    assert run.loads["clamp"][1, 5] == pytest.approx(25.0) and np.array_equal(run.loads["clamp"][3], np.zeros(6))


def test_a_mechanism_that_is_caught_is_at_rest():
    """A closure takes the last freedom: all energy is lost, and what holds is a structure until it opens."""
    scene = fm.SceneBuilder("caught", gravity=(0.0, -9.81, 0.0))
    scene.rigid_body("rod", mass=1.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
    scene.revolute("pivot", "ground", "rod", axis=Z)
    scene.closure("catch", "in_plane", "ground", "rod", axis=(0.0, 1.0, 0.0), position_a=(0.0, -0.5, 0.0),
                  position_b=(1.0, 0.0, 0.0), closed=False)  # fmt: skip
    scene.event("caught", "pivot.rotation", -np.pi / 6.0, fm.Dock(closure="catch"))
    scene.event("let go", "time", 1.0, fm.Separate(closure="catch"))
    run = fm.simulate(scene.scene(), 1.2, samples=25)
    assert [event.name for event in run.events] == ["caught", "let go"]
    held = (run.t > run.events[0].t) & (run.t < 1.0)
    assert held.sum() > 5 and np.abs(run.u[held]).max() == 0.0
    assert run.loads["catch"][held, 4] == pytest.approx(0.5 * 9.81, rel=1e-9)
    assert run.events[0].energy_change == pytest.approx(-9.81 * 0.25, rel=1e-6)
    assert run.q[-1, 0] < -np.pi / 6.0 - 0.1


def test_what_prescribed_motions_do_not_allow_is_told():
    scene = fm.SceneBuilder("driven").rigid_body("rod", mass=1.0, com=(0.5, 0.0, 0.0), inertia=(0.1,) * 3)
    scene.rigid_body("more", mass=1.0, inertia=(0.1,) * 3).free("flight", "ground", "more", position=(5.0, 0.0, 0.0))
    scene.revolute("pivot", "ground", "rod", axis=Z, prescribed=fm.Ramp(rate=1.0), rate=1.0)
    scene.closure("catch", "weld", "ground", "rod", closed=False, quaternion_a=(np.cos(0.25), 0.0, 0.0, np.sin(0.25)))
    scene.event("caught", "time", 0.5, fm.Dock(closure="catch"))
    with pytest.raises(fm.DynamicsError, match="closures and prescribed motions do not allow"):
        fm.simulate(scene.scene(), 1.0)


@CHANGED
@pytest.mark.parametrize("method", ["dop853", "rk4", "radau5"])
@pytest.mark.parametrize("cut", [1, 3, 4, 5])
def test_restarts_know_what_is_open(method, cut, tmp_path):
    given: dict[str, Any] = {"step": 2e-4} if INTEGRATORS[method].fixed else {"rtol": 1e-8, "atol": 1e-10}
    scene = pair("weld", opened(0.1), closed(0.2, tolerance_m=0.5, tolerance_rad=0.5), is_closed=True)
    times = np.array([0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3])
    whole = fm.simulate(scene, 0.3, method, samples=times, **given)
    first = fm.simulate(scene, times[cut], method, samples=times[: cut + 1], **given)
    first.restart.save(tmp_path / "restart.npz")
    restart = fm.Restart.load(tmp_path / "restart.npz")
    assert restart.scene.closures[0].closed == (cut in (1, 4, 5))
    rest = fm.simulate(restart.scene, 0.3, method, state=restart, samples=times[cut:], **given)
    assert np.array_equal(rest.q[-1], whole.q[-1]) and np.array_equal(rest.loads["port"][-1], whole.loads["port"][-1])
    assert [event.name for event in (*first.events, *rest.events)] == ["opens", "closes"]


@CHANGED
def test_copies_of_a_batch_are_runs():
    scene = pair("weld", opened(0.02), closed(0.04, tolerance_m=0.5, tolerance_rad=0.5), is_closed=True)
    system = fm.compile(scene)
    start = system.initial_state
    u = np.vstack([start.u, 0.5 * start.u])
    batch = fm.simulate_batch(system, 0.06, q=np.vstack([start.q] * 2), u=u, samples=4)
    for copy in range(2):
        run = fm.simulate(system, 0.06, state=system.state(start.q, u[copy], 0.0), samples=4)
        assert np.array_equal(batch.q[copy], run.q) and len(run.events) == len(batch.events[copy]) == 2


BY = ["stone.mass_kg", "axle.rotation.torque_Nm.value", "flies.level", "clamp.position_a_m.0"]


def flung(*events: fm.SceneEvent) -> fm.Scene:
    """A wheel that is driven and flings a stone off where it has turned far enough."""
    scene = fm.SceneBuilder("flung").rigid_body("hub", mass=4.0, com=(0.1, 0.0, 0.0), inertia=(1.0, 1.0, 1.0))
    scene.rigid_body("stone", mass=1.0, com=(0.05, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
    scene.revolute("axle", "ground", "hub", axis=Z, torque=fm.Constant(value=2.0))
    scene.planar("flight", "ground", "stone", parent_position=(1.0, 0.0, 0.0))
    scene.closure("clamp", "revolute", "hub", "stone", axis=Z, position_a=(1.0, 0.0, 0.0))
    scene.event("flies", "axle.rotation", 0.5, fm.Separate(closure="clamp"))
    return scene.add(*events).scene()


def test_derivatives_through_a_separation():
    """Of where the stone flies and of what the clamp holds: against differences; the adjoint gives the same."""
    of = ["flight.x", "flight.y.rate", "axle.rotation", "clamp.force.x"]
    found = agrees(flung(), 2.0, BY, of)
    assert [event.name for event in found.events] == ["flies"]
    assert np.abs(found.derivatives[-1, :2]).max(axis=0).min() > 1e-2  # all of them count after it
    assert not np.any(found.derivatives[-1, 3]) and np.any(found.derivatives[1, 3])
    gradient = fm.gradient(flung(), 2.0, BY, fm.FinalValue("flight.x"))
    assert gradient.derivatives == pytest.approx(found.derivatives[-1, 0], rel=1e-6)


def test_derivatives_through_a_docking_are_refused_by_name():
    docks = at(1.8, fm.Dock(closure="clamp", tolerance_m=9.0, tolerance_rad=1.0), name="returns")
    with pytest.raises(NotImplementedError, match='closes closure "clamp": derivatives through an impulse'):
        fm.sensitivities(flung(docks), 2.0, BY[:1], ["flight.x"], samples=3)
    early = fm.sensitivities(flung(docks), 1.7, BY[:1], ["flight.x"], samples=3)  # it does not come to that
    assert np.abs(early.derivatives).max() > 1e-3


def test_scenes_that_cannot_be_meant_are_refused():
    with pytest.raises(fm.SceneError, match="it is open, and no event closes it"):
        fm.check_scene(pair("weld"))
    with pytest.raises(fm.SceneError, match=r'there is no closure "porch"\s+-> did you mean "port"'):
        fm.check_scene(pair("weld", opened(0.1, "porch"), closed(0.2)))
    with pytest.raises(PathError, match='"port.closed" is true or false'):
        pair("weld", closed(0.2)).with_values({"port.closed": True})
    fm.check_scene(pair("weld", closed(0.2)))
