"""Outputs of a run at every sample: loads, momentum and energy must belong to the motion at the same sample.

In a snapshot each component has one sign. Here bodies turn over and swing, so that it takes both, and each sample
is compared with mechanics at the position, orientation and velocity that the engine itself reports.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crosscheck.conformance.clause import (
    ARM,
    INERTIA,
    MASS,
    NONE,
    SECOND,
    Chapter,
    G,
    arm,
    finest_two,
    given,
    hold_at_samples,
)
from crosscheck.engines.contract import Engine, MarkerPath
from crosscheck.engines.conventions import rotation_matrix
from flexmb.scene.functions import Sine
from flexmb.scene.schema import Scene
from flexmb.typing import Real

SAMPLES = Chapter(physical=True)
TIMES = np.linspace(0.0, 2.0, 41)
TILTED = np.array([1.0, -2.0, 2.0]) / 3.0
FIELD = np.array([3.0, -4.0, -7.0])  # m/s^2: oblique, as is the axis, so that no component of a load is zero
COM = np.array([0.2, -0.1, 0.3])


@SAMPLES.clause("A body that nothing holds flies along its parabola and keeps its angular momentum while it tumbles.")
def a_thrown_body_flies(engine: Engine) -> None:
    scene, start = _thrown(), np.array([0.3, 0.2, -0.5])
    rough, fine = finest_two(engine, scene, TIMES)
    origin = start + np.cross([0.4, -0.7, 1.1], COM)  # velocity of the mass centre
    exact = COM + np.outer(TIMES, origin) + 0.5 * np.outer(TIMES**2, FIELD)
    hold_at_samples(
        "the position (m) of the mass centre", (run.markers["com"].position for run in (rough, fine)), exact, TIMES
    )
    spins = [_spin(run.markers["com"]) for run in (rough, fine)]
    hold_at_samples(
        "the angular momentum (Nms) about the mass centre", spins, np.tile(spins[1][0], (len(TIMES), 1)), TIMES
    )


@SAMPLES.clause("The load across a hinge is the mass times the acceleration, less gravity, at every sample of a run.")
def loads_of_a_run_hold_at_every_sample(engine: Engine) -> None:
    turning = arm(tuple(FIELD), tuple(COM)).revolute("pivot", "ground", "arm", axis=tuple(TILTED), angle=0.4, rate=9.0)
    rough, fine = finest_two(engine, turning.scene(), TIMES)
    loads = [given("the load of a revolute hinge", run.loads.get("pivot")) for run in (rough, fine)]
    expected = _loads_of_the_pivot(fine.markers["com"])
    hold_at_samples("the torque (Nm) across the pivot", (load[:, :3] for load in loads), expected[:, :3], TIMES)
    hold_at_samples("the force (N) across the pivot", (load[:, 3:] for load in loads), expected[:, 3:], TIMES)


@SAMPLES.clause("The drive load of a prescribed hinge is what its motion needs at every sample of a run.")
def drive_loads_of_a_run_hold_at_every_sample(engine: Engine) -> None:
    A, w, phase = 1.8, 4.0, 0.7
    wave = Sine(amplitude=A, angular_frequency_rad_s=w, phase_rad=phase)
    scene = arm().revolute("drive", "ground", "arm", axis=(0.0, 1.0, 0.0), prescribed=wave).scene()
    rough, fine = finest_two(engine, scene, TIMES)
    drives = [given("drive loads", run.drives.get("drive")) for run in (rough, fine)]
    theta = A * np.sin(w * TIMES + phase)
    expected = -SECOND * w * w * theta - MASS * G * ARM * np.cos(theta)
    hold_at_samples("the drive load (Nm)", drives, expected[:, None], TIMES)


@SAMPLES.clause("Momentum and kinetic and gravity energy are those of the motion at every sample of a run.")
def momentum_and_energy_of_a_run_hold_at_every_sample(engine: Engine) -> None:
    rough, fine = finest_two(engine, _thrown(), TIMES)
    path = fine.markers["com"]
    spin, linear = _spin(path), MASS * path.velocity[:, 3:]
    about_origin = spin + np.cross(path.position, linear)
    kinetic = 0.5 * np.sum(path.velocity[:, :3] * spin, axis=1) + 0.5 * np.sum(linear**2, axis=1) / MASS
    expected = {"kinetic": kinetic, "gravity": -MASS * path.position @ FIELD}
    offered = [kind for kind in expected if kind in fine.energy]
    if not offered:
        given("the momentum, or kinetic and gravity energy", fine.momentum)
    for kind in offered:
        energies = [run.energy[kind][:, None] for run in (rough, fine)]
        hold_at_samples(f"the {kind} energy (J)", energies, expected[kind][:, None], TIMES)
    if fine.momentum is not None and rough.momentum is not None:
        momenta = rough.momentum, fine.momentum
        hold_at_samples("the angular momentum (Nms)", (momentum[:, :3] for momentum in momenta), about_origin, TIMES)
        hold_at_samples("the linear momentum (Ns)", (momentum[:, 3:] for momentum in momenta), linear, TIMES)


@SAMPLES.clause("The load of a line is along it, by its law of the length, at every sample of a run.")
def connector_loads_of_a_run_hold_at_every_sample(engine: Engine) -> None:
    """A body on a line from the World origin to its mass centre, which pulls and pushes in turn."""
    body = arm(NONE, NONE).free("free", "ground", "arm", position=(0.5, 0.0, 0.2), velocity=(0.3, 1.0, 0.5))
    line: dict[str, Any] = {"free_length": 0.5, "stiffness": 60.0}
    scene = body.spring_damper("line", "ground", "arm", **line).scene()
    rough, fine = finest_two(engine, scene, TIMES[:21])
    loads = [given("loads of connectors", run.connectors.get("line"))[:, 3:] for run in (rough, fine)]
    place = fine.markers["com"].position
    length = np.linalg.norm(place, axis=1)[:, None]
    hold_at_samples("the force (N) of the line on B", loads, -60.0 * (length - 0.5) * place / length, TIMES[:21])


def _thrown() -> Scene:
    free: dict[str, Any] = {"angular_velocity": (0.4, -0.7, 1.1), "velocity": (0.3, 0.2, -0.5)}
    return arm(tuple(FIELD), tuple(COM)).free("free", "ground", "arm", **free).scene()


def _in_world(path: MarkerPath) -> Real:
    """The inertia (T,3,3) about the mass centre, in World axes."""
    turned = np.array([rotation_matrix(quaternion) for quaternion in path.quaternion])
    return np.asarray(turned * np.array(INERTIA) @ turned.transpose(0, 2, 1))


def _spin(path: MarkerPath) -> Real:
    """Angular momentum (T,3) about the mass centre."""
    return np.einsum("tij,tj->ti", _in_world(path), path.velocity[:, :3])


def _loads_of_the_pivot(path: MarkerPath) -> Real:
    """[torque; force] (T,6) on the arm about the pivot, which is at the World origin: Newton and Euler."""
    r, w, J = path.position, path.velocity[:, :3], _in_world(path)
    about_axis = np.einsum("i,tij,j->t", TILTED, J, TILTED) + MASS * np.sum(np.cross(TILTED, r) ** 2, axis=1)
    alpha = (np.cross(r, MASS * FIELD) @ TILTED / about_axis)[:, None] * TILTED
    force = MASS * (np.cross(alpha, r) + np.cross(w, np.cross(w, r)) - FIELD)
    moment = np.einsum("tij,tj->ti", J, alpha) + np.cross(w, _spin(path))
    return np.hstack([moment + np.cross(r, force), force])
