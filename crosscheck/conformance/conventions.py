"""Frames, orders, signs and reference points: errors in converting a correct code's results."""

from __future__ import annotations

from typing import Any

import numpy as np
from msgspec.structs import replace

from crosscheck.conformance.clause import (
    ARM,
    INERTIA,
    MASS,
    NONE,
    QUARTER,
    Chapter,
    G,
    acceleration,
    arm,
    equal,
    given,
    snapshot,
)
from crosscheck.engines.contract import Engine

CONVENTIONS = Chapter(physical=True)


@CONVENTIONS.clause("Positions are in World axes; quaternions are scalar-first and map body to World components.")
def quaternions_are_scalar_first(engine: Engine) -> None:
    quaternion = np.array([0.8, 0.0, 0.0, 0.6])  # about z by 2 atan(3/4)
    scene = arm().free("free", "ground", "arm", quaternion=tuple(quaternion), position=(1.0, 2.0, 3.0)).scene()
    com = snapshot(engine, scene).markers["com"]
    equal("the position of the mass centre", com.position, [1.0 + ARM * 0.28, 2.0 + ARM * 0.96, 3.0])
    equal("its quaternion", com.quaternion * np.sign(com.quaternion[0]), quaternion)


@CONVENTIONS.clause("Speeds of a free hinge are given in outboard axes; marker velocities come back in World axes.")
def free_velocities_are_in_outboard_axes(engine: Engine) -> None:
    turned: dict[str, Any] = {"quaternion": QUARTER, "angular_velocity": (1.0, 0.0, 0.0), "velocity": (2.0, 0.0, 3.0)}
    scene = arm(NONE).free("free", "ground", "arm", **turned).scene()
    velocity = snapshot(engine, scene).markers["origin"].velocity
    equal("the velocity [angular; linear] of the origin", velocity, [0, 1, 0, 0, 2, 3])


@CONVENTIONS.clause("Speeds of a spherical hinge are given in outboard axes.")
def spherical_speeds_are_in_outboard_axes(engine: Engine) -> None:
    ball = arm(NONE).spherical("ball", "ground", "arm", quaternion=QUARTER, angular_velocity=(0.0, 0.0, 2.0))
    scene = ball.scene()
    velocity = snapshot(engine, scene).markers["com"].velocity
    equal("the velocity [angular; linear] of the mass centre", velocity, [0, 0, 2, -2 * ARM, 0, 0])
    turned = replace(scene.hinges[0], angular_velocity_rad_s=(1.0, 0.0, 0.0))
    velocity = snapshot(engine, replace(scene, hinges=(turned,))).markers["origin"].velocity
    equal("the angular velocity", velocity[:3], [0, 1, 0])


@CONVENTIONS.clause("`loads[hinge]` acts on the outboard body: a hanging mass is held up.")
def a_hanging_mass_is_held_up(engine: Engine) -> None:
    scene = arm(com=(0.0, 0.0, -ARM)).revolute("pivot", "ground", "arm", axis=(0.0, 1.0, 0.0)).scene()
    load = given("the load of a revolute hinge", snapshot(engine, scene).loads.get("pivot"))
    equal("the load [torque; force] across the pivot", load, [0, 0, 0, 0, 0, MASS * G], MASS * G)


@CONVENTIONS.clause("`loads[hinge]` is about the outboard hinge point, in World axes.")
def loads_are_about_the_outboard_hinge_point(engine: Engine) -> None:
    scene = arm().weld("weld", "ground", "arm", child_position=(-0.4, 0.0, 0.0)).scene()
    load = given("the load of a weld", snapshot(engine, scene).loads.get("weld"))
    expected = [0, -(ARM + 0.4) * MASS * G, 0, 0, 0, MASS * G]
    equal("the load [torque; force] across the weld", load, expected, MASS * G)


@CONVENTIONS.clause("`momentum` is [angular about the World origin; linear].")
def momentum_is_about_the_world_origin(engine: Engine) -> None:
    place, w, v = np.array([1.0, -2.0, 0.5]), np.array([0.4, -0.7, 1.1]), np.array([0.3, 0.2, -0.5])
    com = np.array([0.2, -0.1, 0.3])
    motion: dict[str, Any] = {"position": tuple(place), "angular_velocity": tuple(w), "velocity": tuple(v)}
    scene = arm(NONE, tuple(com)).free("free", "ground", "arm", **motion).scene()
    momentum = given("the momentum", snapshot(engine, scene).momentum)
    p = MASS * (v + np.cross(w, com))
    equal("the momentum", momentum, [*(np.array(INERTIA) * w + np.cross(place + com, p)), *p])


@CONVENTIONS.clause("Accelerations are [angular; classical acceleration of the marker's point], in World axes.")
def accelerations_are_those_of_the_point(engine: Engine) -> None:
    w, v, com = np.array([0.4, -0.7, 1.1]), np.array([0.3, 0.2, -0.5]), np.array([0.2, -0.1, 0.3])
    free = arm(NONE, tuple(com)).free("free", "ground", "arm", angular_velocity=tuple(w), velocity=tuple(v))
    answer = snapshot(engine, free.scene())
    J = np.diag(INERTIA)
    alpha = -np.linalg.solve(J, np.cross(w, J @ w))
    origin = -np.cross(alpha, com) - np.cross(w, np.cross(w, com))
    p = MASS * (v + np.cross(w, com))
    if "kinetic" in answer.energy:
        equal("the kinetic energy", answer.energy["kinetic"], 0.5 * (w @ J @ w + p @ p / MASS))
    equal("the acceleration of the origin", acceleration(answer, "origin"), [*alpha, *origin])
