"""Connectors: signs, laws and frames of springs, bushings and friction, and what acts on the other side."""

from __future__ import annotations

from typing import Any

import numpy as np

from crosscheck.conformance.clause import (
    INERTIA,
    MASS,
    NONE,
    QUARTER,
    THIRD,
    Chapter,
    acceleration,
    allowance,
    arm,
    equal,
    finest_two,
    given,
    hub,
    require,
    snapshot,
    within,
)
from crosscheck.engines.contract import Engine
from crosscheck.engines.conventions import cross_matrix, rotation_matrix
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant
from flexmb.typing import Real

CONNECTORS = Chapter(physical=True)

# A line from the World origin: its length, its direction, and its rate of length if B moves along x.
PLACE, LENGTH, FREE, SPEED = (0.3, 0.0, 0.4), 0.5, 0.4, 2.0
ALONG, RATE = np.array([0.6, 0.0, 0.8]), 0.6 * SPEED
LAW: dict[str, Any] = {"free_length": FREE, "preload": 2.0, "stiffness": 100.0, "stiffening": (300.0, 4000.0)}
STRETCH = LENGTH - FREE
TENSION = 2.0 + 100.0 * STRETCH + 300.0 * STRETCH**2 + 4000.0 * STRETCH**3
STORED = 2.0 * STRETCH + 50.0 * STRETCH**2 + 100.0 * STRETCH**3 + 1000.0 * STRETCH**4

# A bushing, diagonal except for one coupling, and its frame B: a rotation vector and a position in axes of A.
STIFF = np.diag([40.0, 50.0, 30.0, 400.0, 500.0, 600.0])
STIFF[0, 4] = STIFF[4, 0] = 12.0
LOSSY = 0.02 * STIFF
TURN, SHIFT, TWO = np.array([0.3, -0.5, 0.4]), np.array([0.02, -0.01, 0.03]), (0.1, 0.2, 0.3)


@CONNECTORS.clause("A line longer than its free length pulls B towards A; its energy is the integral of its law.")
def a_stretched_line_pulls(engine: Engine) -> None:
    answer = snapshot(engine, _held(**LAW).scene())
    load = given("loads of connectors", answer.connectors.get("line"))
    equal("the load of the line on B", load, [0, 0, 0, *(-TENSION * ALONG)])
    equal("the acceleration of the body", acceleration(answer, "com")[3:], -TENSION / MASS * ALONG)
    equal("the spring energy", given("the spring energy", answer.energy.get("spring")), STORED)


@CONNECTORS.clause("A line's damper pulls where the ends part, and stores nothing.")
def a_damper_resists_the_rate_of_length(engine: Engine) -> None:
    answer = snapshot(engine, _held(free_length=FREE, damping=5.0).scene())
    equal("the acceleration of the body", acceleration(answer, "com")[3:], -5.0 * RATE / MASS * ALONG)
    equal("the spring energy", given("the spring energy", answer.energy.get("spring")), 0.0)


@CONNECTORS.clause("A line's actuator pushes its ends apart where its force is positive.")
def an_actuator_pushes_its_ends_apart(engine: Engine) -> None:
    answer = snapshot(engine, _held(free_length=FREE, force=Constant(value=3.0)).scene())
    equal("the acceleration of the body", acceleration(answer, "com")[3:], 3.0 / MASS * ALONG)


@CONNECTORS.clause("A cable neither pushes nor damps nor stores while it is slack; taut, it pulls as a spring does.")
def a_slack_cable_does_nothing(engine: Engine) -> None:
    slack = snapshot(engine, _held(acts="tension", free_length=0.6, stiffness=100.0, damping=5.0).scene())
    equal("the acceleration of the body", acceleration(slack, "com"), np.zeros(6))
    equal("the spring energy", given("the spring energy", slack.energy.get("spring")), 0.0)
    taut = snapshot(engine, _held(acts="tension", free_length=FREE, stiffness=100.0, damping=5.0).scene())
    pull = 100.0 * STRETCH + 5.0 * RATE
    equal("the acceleration of the body", acceleration(taut, "com")[3:], -pull / MASS * ALONG)


@CONNECTORS.clause("A buffer pushes below its free length alone, and its damper never makes it pull.")
def a_buffer_pushes_alone(engine: Engine) -> None:
    apart = snapshot(engine, _held(acts="compression", free_length=FREE, stiffness=100.0).scene())
    equal("the acceleration of the body", acceleration(apart, "com"), np.zeros(6))
    pressed = snapshot(engine, _held(acts="compression", free_length=0.6, stiffness=100.0, damping=5.0).scene())
    push = 100.0 * 0.1 - 5.0 * RATE
    equal("the acceleration of the body", acceleration(pressed, "com")[3:], push / MASS * ALONG)
    parting = snapshot(engine, _held(acts="compression", free_length=0.6, stiffness=100.0, damping=50.0).scene())
    equal("the acceleration of the body", acceleration(parting, "com"), np.zeros(6))


@CONNECTORS.clause("A law by a table meets its samples (PCHIP), and goes on by its end slopes.")
def a_table_is_met_and_continued(engine: Engine) -> None:
    """Equal intervals of 0.2 with the secants 15 and 35: the end slope is (3 35 - 15)/2."""
    table: dict[str, Any] = {"table": (-0.1, 0.1, 0.3), "loads": (-1.0, 2.0, 9.0)}
    for free, tension in ((0.4, 2.0), (0.0, 9.0 + 45.0 * 0.2)):
        answer = snapshot(engine, _held(free_length=free, **table).scene())
        equal("the acceleration of the body", acceleration(answer, "com")[3:], -tension / MASS * ALONG)


@CONNECTORS.clause("What acts on A is the opposite of what acts on B: a line between free bodies keeps both momenta.")
def a_line_reacts_on_a(engine: Engine) -> None:
    pair = _pair().spring_damper(
        "line", "arm", "other", position_a=TWO, position_b=(-0.2, 0.1, 0.0), free_length=0.5, stiffness=100.0
    )
    _keeps_momenta(engine, pair)


@CONNECTORS.clause("A bushing's displacement is that of B seen from A, in axes of A, [rotation; translation].")
def a_bushing_is_in_axes_of_a(engine: Engine) -> None:
    """Frame A is on the ground, turned by a quarter about z; B is shifted along x of A and turned about z."""
    turn, shift = 0.4, 0.05
    B = (0.5**0.5 * (np.cos(turn / 2) - np.sin(turn / 2)), 0.0, 0.0, 0.5**0.5 * (np.cos(turn / 2) + np.sin(turn / 2)))
    body = arm(NONE, NONE).free("free", "ground", "arm", position=(0.0, shift, 0.0), quaternion=B)
    scene = body.bushing("mount", "ground", "arm", quaternion_a=QUARTER, stiffness=STIFF).scene()
    answer = snapshot(engine, scene)
    load = given("loads of connectors", answer.connectors.get("mount"))
    equal("the load of the bushing on B", load, [0, 0, -30.0 * turn, 0, -400.0 * shift, 0])
    stored = 15.0 * turn**2 + 200.0 * shift**2
    equal("the spring energy", given("the spring energy", answer.energy.get("spring")), stored)


@CONNECTORS.clause("A bushing's turn is the rotation vector, and its load the derivative of its energy, for any turn.")
def a_bushing_derives_from_its_energy(engine: Engine) -> None:
    w, v = np.array([0.5, 0.8, -0.4]), np.array([0.2, -0.1, 0.3])
    angle = np.linalg.norm(TURN)
    quaternion = (np.cos(angle / 2), *(np.sin(angle / 2) / angle * TURN))
    outboard = rotation_matrix(quaternion).T
    body = arm(NONE, NONE).free(
        "free", "ground", "arm", position=tuple(SHIFT), quaternion=quaternion,
        angular_velocity=tuple(outboard @ w), velocity=tuple(outboard @ v),
    )  # fmt: skip
    scene = body.bushing("mount", "ground", "arm", stiffness=STIFF, damping=LOSSY).scene()
    inverse = np.linalg.inv(_left_jacobian(TURN))
    xi, rate = np.concatenate([TURN, SHIFT]), np.concatenate([inverse @ w, v])
    g = STIFF @ xi + LOSSY @ rate
    load = given("loads of connectors", snapshot(engine, scene).connectors.get("mount"))
    equal("the load of the bushing on B", load, -np.concatenate([inverse.T @ g[:3], g[3:]]))


@CONNECTORS.clause("A bushing's load acts at B on both bodies: between free bodies it keeps both momenta.")
def a_bushing_reacts_on_a(engine: Engine) -> None:
    _keeps_momenta(engine, _pair().bushing("mount", "arm", "other", position_a=TWO, stiffness=STIFF))


@CONNECTORS.clause("An angular spring turns back by its law of the angle beyond rest, and is part of the hinge's load.")
def an_angular_spring_turns_back(engine: Engine) -> None:
    pivot = arm(NONE).revolute("pivot", "ground", "arm", angle=0.3, rate=0.7)
    coil: dict[str, Any] = {"rest": 0.1, "preload": 0.5, "stiffness": 4.0, "stiffening": (0.0, 30.0), "damping": 0.2}
    answer = snapshot(engine, pivot.angular_spring("coil", "pivot", **coil).scene())
    torque = -(0.5 + 4.0 * 0.2 + 30.0 * 0.2**3 + 0.2 * 0.7)
    equal("the load along the angle", given("hinge forces", answer.hinge_forces.get("coil")), [torque])
    equal("the angular acceleration", acceleration(answer, "origin")[2], torque / THIRD)
    equal("the torque across the pivot", given("the load", answer.loads.get("pivot"))[2], torque)
    stored = 0.5 * 0.2 + 2.0 * 0.2**2 + 7.5 * 0.2**4
    equal("the spring energy", given("the spring energy", answer.energy.get("spring")), stored)


@CONNECTORS.clause("A linear spring pulls back along its hinge, by its law of the displacement beyond rest.")
def a_linear_spring_pulls_back(engine: Engine) -> None:
    slide = arm(NONE, NONE).prismatic("slide", "ground", "arm", axis=(0.0, 1.0, 0.0), position=0.3, rate=-0.5)
    answer = snapshot(engine, slide.linear_spring("coil", "slide", rest=0.1, stiffness=40.0, damping=2.0).scene())
    force = -(40.0 * 0.2 - 2.0 * 0.5)
    equal("the load along the slide", given("hinge forces", answer.hinge_forces.get("coil")), [force])
    equal("the acceleration of the body", acceleration(answer, "com")[3:], [0, force / MASS, 0])


@CONNECTORS.clause("A stop pushes back by k d (1 + e d') beyond its angle, on either side, and never pulls.")
def a_stop_pushes_back(engine: Engine) -> None:
    stops: dict[str, Any] = {"lower": -0.2, "upper": 0.5, "stop_stiffness": 50.0, "stop_dissipation": 0.5}
    for angle, rate, torque in (
        (0.3, 0.7, 0.0), (0.6, 0.8, -5.0 * 1.4), (-0.3, -0.8, 5.0 * 1.4), (0.6, -0.8, -5.0 * 0.6), (0.6, -4.0, 0.0),
    ):  # fmt: skip
        pivot = arm(NONE).revolute("pivot", "ground", "arm", angle=angle, rate=rate)
        answer = snapshot(engine, pivot.angular_spring("stops", "pivot", **stops).scene())
        equal(f"the load of stops at {angle} rad", given("hinge forces", answer.hinge_forces.get("stops")), [torque])
        equal("the angular acceleration", acceleration(answer, "origin")[2], torque / THIRD)


@CONNECTORS.clause("Friction acts against the rate, and is greatest near rest where a static level is given.")
def friction_acts_against_the_rate(engine: Engine) -> None:
    levels: dict[str, Any] = {"sliding": 0.4, "static": 0.6, "stribeck": 0.3, "smoothing": 0.05}
    for rate in (0.2, -2.0):
        pivot = arm(NONE).revolute("pivot", "ground", "arm", rate=rate)
        answer = snapshot(engine, pivot.angular_friction("bearing", "pivot", **levels).scene())
        torque = -(0.4 + 0.2 / (1.0 + (rate / 0.3) ** 2)) * rate / np.hypot(rate, 0.05)
        equal("the load along the angle", given("hinge forces", answer.hinge_forces.get("bearing")), [torque])
        equal("the angular acceleration", acceleration(answer, "origin")[2], torque / THIRD)


@CONNECTORS.clause("Friction in a wheel's bearing brakes the wheel and turns its body along.")
def friction_of_a_wheel_reacts_on_its_body(engine: Engine) -> None:
    spun = (
        hub()
        .free("free", "ground", "hub")
        .wheel("wheel", "hub", axis=(0.0, 0.0, 1.0), mass=0.5, axial_inertia=0.04, transverse_inertia=0.025, speed=10.0)
    )
    answer = snapshot(engine, spun.angular_friction("bearing", "wheel", sliding=0.3, smoothing=0.01).scene())
    torque = 0.3 * 10.0 / np.hypot(10.0, 0.01)
    equal("the load along the angle", given("hinge forces", answer.hinge_forces.get("bearing")), [-torque])
    equal("the acceleration of the hub", acceleration(answer, "hub"), [0, 0, torque / 1.5, 0, 0, 0])


@CONNECTORS.clause("Springs keep the energy; `work` has what dampers and friction lose and what actuators do.")
def connectors_balance_energy_and_work(engine: Engine) -> None:
    swing = (
        arm(NONE).revolute("pivot", "ground", "arm", rate=2.0)
        .spring_damper("line", "ground", "arm", position_a=(0.0, 1.0, 0.0), position_b=(0.5, 0.0, 0.0), free_length=0.8,
                       stiffness=20.0, damping=1.0, force=Constant(value=0.5))
        .angular_friction("bearing", "pivot", sliding=0.1, smoothing=0.1)
    )  # fmt: skip
    coarser, finest = finest_two(engine, swing.scene(), np.linspace(0.0, 0.5, 6))
    given("the kinetic and spring energies", {"kinetic", "spring"} <= set(finest.energy) or None)
    rough, work = (given("the work", run.work) for run in (coarser, finest))
    before, energy = (run.energy["kinetic"] + run.energy["spring"] for run in (coarser, finest))
    gained, done = energy - energy[0], work - work[0]
    require(bool(done[-1] < -0.01), f"dampers and friction take energy, and the work is {done[-1]:.6g} J")
    refinement = np.abs(rough - work).max() + np.abs(before - energy).max()
    within("the energy (J) gained, less the work,", np.abs(gained - done).max(), refinement + allowance(1e-8))


def _held(**line: Any) -> SceneBuilder:
    """A free body without gravity at PLACE, moving along x, on a line from the World origin to its mass centre."""
    body = arm(NONE, NONE).free("free", "ground", "arm", position=PLACE, velocity=(SPEED, 0.0, 0.0))
    return body.spring_damper("line", "ground", "arm", **line)


def _pair() -> SceneBuilder:
    """Two free bodies at rest without gravity, side by side and turned against each other."""
    return (
        arm(NONE, NONE)
        .rigid_body("other", mass=0.7, inertia=(0.05, 0.06, 0.07))
        .marker("other", "other")
        .free("free", "ground", "arm", quaternion=(0.8, 0.0, 0.6, 0.0))
        .free("loose", "ground", "other", position=(0.4, 0.5, 0.2), quaternion=(0.6, 0.0, 0.0, 0.8))
    )


def _keeps_momenta(engine: Engine, pair: SceneBuilder) -> None:
    answer = snapshot(engine, pair.scene())
    linear, angular = np.zeros(3), np.zeros(3)
    for marker, mass, inertia in (("com", MASS, INERTIA), ("other", 0.7, (0.05, 0.06, 0.07))):
        at = answer.markers[marker]
        turned, pulled = rotation_matrix(at.quaternion), acceleration(answer, marker)
        force = mass * pulled[3:]
        linear += force
        angular += turned @ (inertia * (turned.T @ pulled[:3])) + np.cross(at.position, force)
        require(bool(np.linalg.norm(force) > 1.0), f"the connector pulls at the body of {marker}, which is not moved")
    equal("the rate of the linear momentum", linear, np.zeros(3))
    equal("the rate of the angular momentum about the World origin", angular, np.zeros(3))


def _left_jacobian(turn: Real) -> Real:
    """(3,3): angular velocity = J times the rate of the rotation vector."""
    angle, across = np.linalg.norm(turn), cross_matrix(turn)
    grown = (1.0 - np.cos(angle)) / angle**2 * across + (angle - np.sin(angle)) / angle**3 * across @ across
    return np.asarray(np.eye(3) + grown)
