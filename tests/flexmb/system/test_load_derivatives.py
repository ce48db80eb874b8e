"""Loads across hinges in other axes and about other points, the same wrench; their derivatives, those of given
accelerations and across sections."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.shapes import beam_section
from tests.bounds import UNIT_ROUNDOFF
from tests.flexmb.entry.test_tangent import extrapolated, rounding_of_limit
from tests.flexmb.system import test_section_loads as sections
from tests.flexmb.system.test_derivatives import asked, directions

DOUBTFUL = pytest.mark.filterwarnings("ignore:.*is doubtful")


@pytest.mark.parametrize("name", ["every level", "stiffened", "exact", "connectors"])
@DOUBTFUL
def test_loads_of_given_accelerations(name: str) -> None:
    """By accelerations they are linear; by the state and time as differences of inverse dynamics say."""
    at = asked(name)
    system, t, q, u = at.system, at.state.t, at.state.q, at.state.u
    rng = np.random.default_rng(11)
    rates, other = rng.normal(size=(2, system.nu))
    d = system.evaluation_derivatives(at.state, rates)
    here, there = (system.hinge_loads(at.state, each) for each in (rates, rates + 2.0**20 * other))
    for hinge, load in here.items():
        size = max(np.max(np.abs(each)) for each in there.values()) / 2.0**20
        np.testing.assert_allclose(
            d.loads[hinge].by_acceleration @ other, (there[hinge] - load) / 2.0**20, rtol=0.0, atol=1e-11 * size
        )
    np.testing.assert_array_equal(d.accelerations.by_acceleration, np.eye(system.nu))
    for xi, du, dt in directions(at):
        moved = lambda h, xi=xi, du=du, dt=dt: np.concatenate(list(system.hinge_loads(  # noqa: E731
            system.state(q + h * at.of_rates.motion @ xi, u + h * du, t + h * dt), rates
        ).values()))  # fmt: skip
        expected, doubt = extrapolated(moved, 1e-2)
        found = np.concatenate([
            load.by_displacement @ xi + load.by_speed @ du + load.by_time * dt for load in d.loads.values()
        ])  # fmt: skip
        size = np.max(np.abs(moved(0.0)))
        assert np.max(np.abs(found - expected)) <= 30.0 * np.max(doubt) + 1e-10 * size


@pytest.mark.parametrize(
    ("name", "axes", "node"),
    [("every level", "outboard", None), ("every level", "inboard", "tip"), ("every level", "world", "origin"),
     ("exact", "inboard", "tip")],
)  # fmt: skip
@DOUBTFUL
def test_loads_in_other_axes_against_differences(name: str, axes: Any, node: str | None) -> None:
    at = asked(name)
    system, state = at.system, at.state
    beam = next(body.name for body in system.scene.bodies if isinstance(body, fm.BeamBody))
    about = None if node is None else (beam if node == "tip" else "ground", node)
    d = system.hinge_load_derivatives(state, axes=axes, about=about)
    for xi, du, dt in directions(at)[:2]:
        moved = lambda h, xi=xi, du=du: np.array(list(system.hinge_loads(  # noqa: E731
            system.state(state.q + h * at.of_rates.motion @ xi, state.u + h * du, state.t), axes=axes, about=about
        ).values()))  # fmt: skip
        expected, doubt = extrapolated(moved, 1e-2)
        found = np.array([each.by_displacement @ xi + each.by_speed @ du + each.by_time * dt for each in d.values()])
        allowed = 30.0 * np.max(doubt) + 1e-8 * np.max(np.abs(expected))
        assert np.max(np.abs(found - expected)) <= allowed
        assert np.max(np.abs(found * (1.0 + 1e-5) - expected)) > allowed, "a planted error"
    plain = system.hinge_load_derivatives(state)
    for hinge, load in at.of_all.loads.items():
        for one, other in zip(plain[hinge], load, strict=True):
            np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-14 * np.max(np.abs(other), initial=1e-300))


@pytest.mark.parametrize(("connected", "level"), [(False, "full"), (True, "full"), (False, "exact")])
@DOUBTFUL
def test_section_loads_against_differences(connected: bool, level: fm.Level) -> None:
    modes = {"modes": fm.Modes(count=2)} if level == "exact" else {}
    scene = sections.everything(connected=connected, level=level, **modes)
    system = fm.compile(scene)
    state, body, x = sections.somewhere(system), "beam", [0.0, 0.7, 1.6]
    rng = np.random.default_rng(8)
    d = system.section_load_derivatives(state, body, x)
    motion = system.acceleration_derivatives(state).motion
    free = system.constants.speed["prescribed"] < 0
    xi, du = rng.normal(size=(2, system.nu)) * np.where(free, 1e-2, 0.0)
    for dq, dv, dt, found in (
        (motion @ xi, 0.0, 0.0, d.by_displacement @ xi),
        (0.0, du, 0.0, d.by_speed @ du),
        (0.0, 0.0, 1e-2, d.by_time * 1e-2),
    ):
        moved = lambda h, dq=dq, dv=dv, dt=dt: system.section_loads(  # noqa: E731
            system.state(state.q + h * dq, state.u + h * dv, state.t + h * dt), body, x
        ).load  # fmt: skip
        expected, doubt = extrapolated(moved, 1e-1)
        tiny = [moved(k * 2.0**-40) for k in range(4)]  # smooth parts have no third differences
        noise = np.max(np.abs(tiny[3] - 3.0 * tiny[2] + 3.0 * tiny[1] - tiny[0]))
        rounding = rounding_of_limit() * noise / (1e-1 / 2**5)
        size = max(np.max(np.abs(expected)), 1e-3 * np.max(np.abs(moved(0.0))))
        allowed = 30.0 * np.max(doubt) + 1e-9 * size + rounding
        assert np.max(np.abs(found - expected)) <= allowed
        if np.max(np.abs(expected)) > 1e-3:
            assert np.max(np.abs(found * (1.0 + 1e-5) - expected)) > allowed, "planted"


ROUNDING = 2.0**12 * UNIT_ROUNDOFF
BEAM = beam_section(E=7e10, G=2.7e10, A=2e-4, Iy=2e-9, Iz=3e-9, rho=2700)
TURN = (np.cos(0.35), 0.0, np.sin(0.35), 0.0)


def arm(child_node: str = "origin") -> fm.Scene:
    """A body on a turned hinge at the tip of a beam that hangs on a turned hinge itself; markers on both frames."""
    return (
        fm.SceneBuilder("arm", gravity=(0.3, -9.81, 1.0))
        .beam("upper", length=1.5, elements=4, section=BEAM, modes=3, nodes={"middle": 0.6})
        .beam("fore", length=1.0, elements=4, section=BEAM, modes=3)
        .rigid_body("hand", mass=0.5, inertia=(1e-3, 2e-3, 2e-3), com=(0.1, 0.0, 0.0))
        .revolute("shoulder", "ground", "upper", axis=(0, 0, 1), angle=0.4, parent_position=(0.2, 0.1, 0.0),
                  parent_quaternion=TURN, child_quaternion=TURN)
        .prismatic("elbow", "upper", "fore", parent_node="tip", axis=(0.6, 0.0, 0.8), position=0.1, stiffness=300.0,
                   child_node=child_node, child_position=(0.05, 0.0, 0.02), child_quaternion=TURN)
        .universal("wrist", "fore", "hand", parent_node="tip" if child_node == "origin" else "root")
        .marker("O+", "upper", node="tip")
        .marker("O", "fore", node=child_node, offset=(0.05, 0.0, 0.02))
        .marker("middle", "upper", node="middle")
        .scene()
    )  # fmt: skip


def moving(system: fm.System) -> fm.State:
    random = np.random.default_rng(5)
    state = system.initial_state
    state.q[:] += 0.02 * random.normal(size=system.nq)
    state.u[:] = random.normal(size=system.nu)
    return state


@pytest.mark.parametrize("child_node", ["origin", "tip"])  # a body at its own frame, and one held where it deforms
def test_axes_and_points_against_markers(child_node: str) -> None:
    system = fm.compile(arm(child_node))
    state = moving(system)
    seen = system.evaluate(state.t, state.q, state.u).markers
    turn = fm.scene.quaternions.rotation_matrix(TURN)
    frames = {"inboard": seen["O+"].rotation, "outboard": seen["O"].rotation @ turn}
    world = system.hinge_loads(state)["elbow"]
    for axes, R in frames.items():
        found = system.hinge_loads(state, axes=axes)["elbow"]
        np.testing.assert_allclose(found[:3], R.T @ world[:3], atol=ROUNDING * np.linalg.norm(world[:3]))
        np.testing.assert_allclose(found[3:], R.T @ world[3:], atol=ROUNDING * np.linalg.norm(world[3:]))
    for about, point in ((("upper", "middle"), seen["middle"].position), (("ground", "origin"), np.zeros(3))):
        found = system.hinge_loads(state, about=about)["elbow"]
        torque = world[:3] + np.cross(seen["O"].position - point, world[3:])
        np.testing.assert_allclose(found[:3], torque, atol=ROUNDING * np.linalg.norm(torque))
        assert np.array_equal(found[3:], world[3:])


def test_a_free_axis_feels_its_spring_alone() -> None:
    """Along the slide, in the axes of either frame, the load is spring and damper; of forced accelerations too."""
    system = fm.compile(arm())
    state = moving(system)
    spring = -300.0 * state.q[system.coordinate("elbow")][0]
    udot = system.accelerations(state)
    for loads in (system.hinge_loads(state, axes="inboard"), system.hinge_loads(state, udot, axes="outboard")):
        assert loads["elbow"][3:] @ (0.6, 0.0, 0.8) == pytest.approx(spring, rel=1e-9)
        assert loads["shoulder"][2] == pytest.approx(0.0, abs=1e-9 * np.linalg.norm(loads["shoulder"]))


def test_over_a_run() -> None:
    """The same as state by state."""
    system = fm.compile(msgspec.structs.replace(arm("tip"), allow=("few_modes",)))  # its hand twists it
    run = fm.simulate(system, 0.02, samples=4, rtol=1e-6, atol=1e-8)
    found = run.loads_in("outboard", about=("upper", "middle"))
    state = system.state(run.q[2], run.u[2], run.t[2])
    for name, load in system.hinge_loads(state, axes="outboard", about=("upper", "middle")).items():
        np.testing.assert_allclose(found[name][2], load, atol=1e-10 * np.linalg.norm(load))
    for name, load in run.loads_in().items():
        assert np.array_equal(load, run.loads[name])


def test_closures_have_frames_too() -> None:
    """A four-bar that lies in a plane: its pins transmit forces in the plane, whatever their frames' names."""
    bar = {"mass": 1.0, "com": (0.5, 0.0, 0.0), "inertia": (0.01, 0.1, 0.1)}
    scene = (
        fm.SceneBuilder("four-bar", gravity=(0.0, -9.81, 0.0))
        .rigid_body("crank", **bar).rigid_body("rod", **bar).rigid_body("rocker", **bar)
        .revolute("a", "ground", "crank", angle=1.2, rate=2.0)
        .revolute("b", "crank", "rod", parent_position=(1, 0, 0), angle=-1.2)
        .revolute("d", "ground", "rocker", parent_position=(1, 0, 0), angle=1.2)
        .closure("c", "revolute", "rod", "rocker", position_a=(1, 0, 0), position_b=(1, 0, 0))
        .marker("B", "rocker", offset=(1, 0, 0))
        .scene()
    )  # fmt: skip
    system = fm.compile(scene)
    state = system.initial_state
    world, inner = system.hinge_loads(state)["c"], system.hinge_loads(state, axes="outboard")["c"]
    rotation = system.evaluate(0.0, state.q, state.u).markers["B"].rotation
    force, size = world[3:5], np.linalg.norm(world[3:5])  # in the plane; what closes it in space is left open
    np.testing.assert_allclose(rotation[:2, :2] @ inner[3:5], force, atol=1e-12 * size)
    about = system.hinge_loads(state, about=("rocker", "origin"))["c"]
    [x, y, _] = rotation @ (1.0, 0.0, 0.0)
    np.testing.assert_allclose(about[2], world[2] + x * force[1] - y * force[0], atol=1e-12 * size)
    for load in (world, inner, about):
        assert np.isnan(load).tolist() == [True, True, False, False, False, True]
