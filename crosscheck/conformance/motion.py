"""Gravity, motors, springs and loads, and runs that are known in closed form."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from scipy.special import ellipj, ellipk

from crosscheck.conformance.clause import (
    ARM,
    DOWN,
    INERTIA,
    MASS,
    NONE,
    QUARTER,
    SECOND,
    THIRD,
    Chapter,
    G,
    acceleration,
    allowance,
    arm,
    equal,
    finest_two,
    given,
    hub,
    ladder,
    offered,
    require,
    simulated,
    snapshot,
    within,
)
from crosscheck.engines.contract import Engine
from flexmb.scene.build import SceneBuilder, linear
from flexmb.scene.functions import Constant, Ramp, Sine
from flexmb.scene.schema import Scene

MOTION = Chapter(physical=True)
FIRST_ORDER = 2.0
"""The error of the finest effort over its distance from the one before: of a method of first order whose steps halve, 1
and a little more or less, as the next order has it; less of all others."""
FEW = 16
"""Roundings of a position after one short step."""


@MOTION.clause("Gravity accelerates along its vector, and loads nothing that falls freely.")
def gravity_accelerates_along_its_vector(engine: Engine) -> None:
    answer = snapshot(engine, arm(DOWN).free("free", "ground", "arm").scene())
    equal("the acceleration of the origin", acceleration(answer, "origin"), [0, 0, 0, 0, 0, -G])
    equal("the load across the free hinge", answer.loads.get("free", np.zeros(6)), np.zeros(6))
    equal("the gravity energy at the origin", answer.energy.get("gravity", 0.0), 0.0)


@MOTION.clause("A positive angle turns by the right-hand rule about the hinge's axis.")
def gravity_turns_a_level_arm_down(engine: Engine) -> None:
    answer = snapshot(engine, arm().revolute("pivot", "ground", "arm", axis=(0.0, 1.0, 0.0)).scene())
    alpha = MASS * G * ARM / SECOND  # about +y: +x turns towards -z
    equal("the acceleration of the origin", acceleration(answer, "origin"), [0, alpha, 0, 0, 0, 0])
    equal("the acceleration of the mass centre", acceleration(answer, "com")[3:], [0, 0, -ARM * alpha])


@MOTION.clause("The torque of a hinge's motor is on the outboard body, and part of the hinge's load.")
def motor_torque_is_on_the_outboard_body(engine: Engine) -> None:
    scene = arm(NONE).revolute("pivot", "ground", "arm", torque=Constant(value=1.5)).scene()
    answer = snapshot(engine, scene)
    expected = [0, 0, 1.5 / THIRD, 0, ARM * 1.5 / THIRD, 0]
    equal("the acceleration of the mass centre", acceleration(answer, "com"), expected)
    load = given("the load of a revolute hinge", answer.loads.get("pivot"))
    equal("the torque across the pivot", load[:3], [0, 0, 1.5])


@MOTION.clause("The force of a hinge's motor is on the outboard body, and part of the hinge's load.")
def motor_force_is_on_the_outboard_body(engine: Engine) -> None:
    slide = arm(NONE).prismatic("slide", "ground", "arm", axis=(0.0, 1.0, 0.0), force=Constant(value=3.0))
    answer = snapshot(engine, slide.scene())
    equal("the acceleration of the mass centre", acceleration(answer, "com"), [0, 0, 0, 0, 3.0 / MASS, 0])
    load = given("the load of a prismatic hinge", answer.loads.get("slide"))
    equal("the load across the slide", load, [0, 0, ARM * 3.0, 0, 3.0, 0])


@MOTION.clause("The drive load of a prescribed hinge is what its motion needs beyond springs and motors.")
def prescribed_hinge_reports_its_drive_load(engine: Engine) -> None:
    A, w, phase = 0.4, 2.0, 0.7
    wave = Sine(amplitude=A, angular_frequency_rad_s=w, phase_rad=phase)
    scene = arm().revolute("drive", "ground", "arm", axis=(0.0, 1.0, 0.0), prescribed=wave, stiffness=3.0).scene()
    answer = snapshot(engine, scene)
    theta, rate, alpha = A * np.sin(phase), A * w * np.cos(phase), -A * w * w * np.sin(phase)
    equal("the angular velocity", answer.markers["origin"].velocity[:3], [0, rate, 0])
    equal("the angular acceleration", acceleration(answer, "origin")[:3], [0, alpha, 0])
    total = SECOND * alpha - MASS * G * ARM * np.cos(theta)
    equal("the torque across the hinge", given("the load", answer.loads.get("drive"))[1], total)
    equal("the drive load", given("drive loads", answer.drives.get("drive")), [total + 3.0 * theta])


@MOTION.clause("A force in World axes at a node acts in World axes on the body, at the node.")
def force_in_world_axes(engine: Engine) -> None:
    answer = acceleration(snapshot(engine, _pushed("world")), "body")
    equal("the acceleration of the body", answer, [0, 0, 0, 4.0 / MASS, 0, 0])


@MOTION.clause("A force in node axes turns with the body.")
def force_in_node_axes(engine: Engine) -> None:
    answer = acceleration(snapshot(engine, _pushed("node")), "body")
    # The force is along the turned body's x, which is World y, at World (-0.5, 0, 0).
    equal("the acceleration of the body", answer, [0, 0, -2.0 / INERTIA[2], 0, 4.0 / MASS, 0])


@MOTION.clause("A torque at a node turns the body.")
def torque_at_a_node(engine: Engine) -> None:
    scene = (
        SceneBuilder("turned")
        .rigid_body("body", mass=MASS, inertia=INERTIA, nodes={"side": (0.0, 0.5, 0.0)})
        .free("free", "ground", "body")
        .torque("turn", "body", node="side", direction=(0.0, 1.0, 0.0), function=Constant(value=0.9))
        .marker("body", "body")
        .scene()
    )
    answer = acceleration(snapshot(engine, scene), "body")
    equal("the acceleration of the body", answer, [0, 0.9 / INERTIA[1], 0, 0, 0, 0])


@MOTION.clause("A moving point mass pulls on its carrier through its spring, whose energy counts as spring energy.")
def moving_point_mass_pulls_on_its_carrier(engine: Engine) -> None:
    """Carrier M and mass m on a spring along x, both free to move along x: M a = k s, m (a + s'') = -k s."""
    scene = (
        SceneBuilder("slosh")
        .rigid_body("tank", mass=MASS, inertia=INERTIA)
        .prismatic("rail", "ground", "tank", axis=(1.0, 0.0, 0.0))
        .point_mass(
            "slug", "tank", mass=0.5, directions=[(1.0, 0.0, 0.0)], coordinates=[linear(position=0.1, stiffness=20.0)]
        )
        .marker("tank", "tank")
        .scene()
    )
    answer = snapshot(engine, scene)
    equal("the acceleration of the carrier", acceleration(answer, "tank")[3:], [20.0 * 0.1 / MASS, 0, 0])
    equal("the spring energy", given("the spring energy", answer.energy.get("spring")), 0.5 * 20.0 * 0.1**2)


@MOTION.clause("A pendulum swings as the elliptic functions say, ever closer with finer efforts.")
def a_pendulum_swings(engine: Engine) -> None:
    """theta = 2 asin(k sn(K - omega t | k^2)) from rest at theta0; k = sin(theta0/2), omega^2 = m g l / I."""
    theta0 = 1.2
    # The hinge axis is -y: from the arm hanging along -z, a positive angle turns it towards +x.
    hanging = arm(com=(0.0, 0.0, -ARM)).revolute("pivot", "ground", "arm", axis=(0.0, -1.0, 0.0), angle=theta0)
    times = np.linspace(0.0, 3.0, 13)
    k = np.sin(theta0 / 2)
    sn = ellipj(ellipk(k**2) - np.sqrt(MASS * G * ARM / SECOND) * times, k**2)[0]
    theta = 2 * np.arcsin(k * sn)
    exact = ARM * np.column_stack([np.sin(theta), np.zeros_like(theta), -np.cos(theta)])
    coarser, finest = (run.markers["com"].position for run in finest_two(engine, hanging.scene(), times))
    refinement = np.abs(coarser - finest).max()
    error, bound = np.abs(finest - exact).max(), FIRST_ORDER * refinement + allowance(1e-10)
    within("the position (m) of the mass centre", error, bound)
    require(bool(refinement < 1e-3 * ARM), f"the last two efforts are {refinement:.3g} m apart: that is no ladder")


@MOTION.clause("Energy is kept where nothing does work: kinetic, spring and gravity energies have one sum.")
def energy_is_kept(engine: Engine) -> None:
    swing = arm(com=(0.0, 0.0, -ARM)).revolute("pivot", "ground", "arm", axis=(0.0, 1.0, 0.0), angle=1.0, stiffness=2.0)
    coarser, finest = finest_two(engine, swing.scene(), np.linspace(0.0, 2.0, 9))
    given("the kinetic, spring and gravity energies", {"kinetic", "spring", "gravity"} <= set(finest.energy) or None)
    rough, total = (np.sum(list(run.energy.values()), axis=0) for run in (coarser, finest))
    exact = 0.5 * 2.0 * 1.0**2 - MASS * G * ARM * np.cos(1.0)
    equal("the energy at t = 0", total[0], exact)
    within("the energy (J)", np.abs(total - exact).max(), FIRST_ORDER * np.abs(rough - total).max() + allowance(1e-9))


@MOTION.clause("Momentum is kept where nothing acts from outside.")
def momentum_is_kept(engine: Engine) -> None:
    w, v, com = (0.4, -0.7, 1.1), (0.3, 0.2, -0.5), (0.2, -0.1, 0.3)
    scene = arm(NONE, com).free("free", "ground", "arm", angular_velocity=w, velocity=v).scene()
    coarser, finest = finest_two(engine, scene, np.linspace(0.0, 2.0, 5))
    rough, path = (given("the momentum", run.momentum) for run in (coarser, finest))
    within("the momentum", np.abs(path - path[0]).max(), FIRST_ORDER * np.abs(rough - path).max() + allowance(1e-10))


@MOTION.clause("`work` is the work done by drives, motors, dampers and loads: positive where energy comes in.")
def work_balances_energy(engine: Engine) -> None:
    turn = arm(NONE).revolute("pivot", "ground", "arm", torque=Constant(value=1.5)).scene()
    coarser, finest = finest_two(engine, turn, np.linspace(0.0, 1.0, 6))
    given("the kinetic energy", finest.energy.get("kinetic"))
    rough, work = (given("the work", run.work) for run in (coarser, finest))
    require(bool(work[-1] > 0.0), f"a motor that spins up an arm does work, and it is {work[-1]:.6g} J")
    gained = finest.energy["kinetic"] - finest.energy["kinetic"][0]
    refinement = np.abs(rough - work).max() + np.abs(coarser.energy["kinetic"] - finest.energy["kinetic"]).max()
    error = np.abs(gained - (work - work[0])).max()
    within("the energy (J) gained, less the work,", error, FIRST_ORDER * refinement + allowance(1e-9))


@MOTION.clause("Velocities are the rates of the positions, accelerations those of the velocities.")
def velocity_is_the_rate_of_position(engine: Engine) -> None:
    """x(h) = x + h v + h^2/2 a + O(h^3) for a short h; the arm's jerk is some 20 m/s^3."""
    scene = arm().revolute("pivot", "ground", "arm", axis=(0.0, 1.0, 0.0), angle=0.3, rate=1.0).scene()
    model, h = offered(engine, scene), 1e-3
    seen = model.evaluate()
    start = seen.markers["com"]
    run = simulated(model, np.array([0.0, h]), ladder(engine, scene, h)[-1])
    require(run.status == "finished", f"a millisecond of a pendulum ended as {run.status}: {run.message}")
    rate = acceleration(seen, "com")
    predicted = start.position + h * start.velocity[3:] + 0.5 * h * h * rate[3:]
    path = run.markers["com"]
    within("the position (m) after a millisecond", np.abs(path.position[1] - predicted).max(), allowance(2e-7, FEW))
    change = path.velocity[1] - start.velocity - h * rate
    within("the velocity after a millisecond", np.abs(change).max(), 1e-3)


def _pushed(frame: Literal["world", "node"]) -> Scene:
    """A body turned by a quarter, pushed at its side along x of World or of the node."""
    return (
        SceneBuilder("pushed")
        .rigid_body("body", mass=MASS, inertia=INERTIA, nodes={"side": (0.0, 0.5, 0.0)})
        .free("free", "ground", "body", quaternion=QUARTER)
        .force("push", "body", node="side", direction=(1.0, 0.0, 0.0), function=Constant(value=4.0), frame=frame)
        .marker("body", "body")
        .scene()
    )


# Wheels: reactions of their motors on their body, and loads of their bearings.

WHEELS = Chapter(physical=True)
WHEEL: dict[str, Any] = {"axis": (0.0, 0.0, 1.0), "mass": 0.5, "axial_inertia": 0.04, "transverse_inertia": 0.025}


@WHEELS.clause("A wheel's motor reacts on its body; `wheel_loads` act on the wheel about its centre.")
def wheel_motor_reacts_on_its_body(engine: Engine) -> None:
    spun = hub().free("free", "ground", "hub")
    scene = spun.wheel("wheel", "hub", **WHEEL, torque=Constant(value=0.6), speed=10.0, friction=0.01).scene()
    answer = snapshot(engine, scene)
    torque = 0.6 - 0.01 * 10.0
    equal("the acceleration of the hub", acceleration(answer, "hub"), [0, 0, -torque / 1.5, 0, 0, 0])
    load = given("the load of a wheel", answer.wheel_loads.get("wheel"))
    equal("the load of the wheel", load, [0, 0, torque, 0, 0, 0])


@WHEELS.clause("A spinning wheel needs a gyroscopic bearing torque.")
def spinning_wheel_needs_a_gyroscopic_torque(engine: Engine) -> None:
    """Precession at w about x of a wheel with spin s about z: torque on the wheel w x (J s z) = -w J s y."""
    scene = (
        SceneBuilder("precession", gravity=DOWN)
        .rigid_body("yoke", mass=5.0, inertia=(1.0, 1.2, 1.5))
        .revolute("drive", "ground", "yoke", axis=(1.0, 0.0, 0.0), prescribed=Ramp(rate=0.5))
        .wheel("wheel", "yoke", **WHEEL, speed=100.0)
        .scene()
    )
    answer = snapshot(engine, scene)
    torque = -0.5 * 0.04 * 100.0
    wheel = given("the load of a wheel", answer.wheel_loads.get("wheel"))
    equal("the load of the wheel", wheel, [0, torque, 0, 0, 0, 0.5 * G])
    equal("the torque across the drive", given("the load", answer.loads.get("drive"))[:3], [0, torque, 0])


@WHEELS.clause("The drive load of a prescribed wheel is the torque that its motion needs, friction included.")
def prescribed_wheel_reports_its_drive_torque(engine: Engine) -> None:
    wave = Sine(amplitude=0.4, angular_frequency_rad_s=2.0, phase_rad=0.7)
    scene = hub().weld("weld", "ground", "hub").wheel("wheel", "hub", **WHEEL, prescribed=wave, friction=0.1).scene()
    answer = snapshot(engine, scene)
    rate, alpha = 0.8 * np.cos(0.7), -1.6 * np.sin(0.7)
    equal("the drive torque", given("drive loads", answer.drives.get("wheel")), [0.04 * alpha + 0.1 * rate])
    equal("the torque across the weld", given("the load", answer.loads.get("weld"))[2], 0.04 * alpha)
