"""Distance from gimbal lock: accurate digits of accelerations with gimbals and quaternions."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap, digit_kinds
from flexmb.scene.build import SceneBuilder, angular
from flexmb.scene.schema import Scene
from flexmb.system.compile import compile
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real

HINGES = ("gimbal xyz", "gimbal zxz", "quaternion")
LOCK = {"gimbal xyz": 0.5 * np.pi, "gimbal zxz": 0.0}  # second angle, rad
INERTIA = np.diag([1.0, 2.0, 2.5])
STATES = 24
ROUNDING = 2.0**-53
AWAY = (angular(), angular(angle=0.8), angular())  # the scene starts away from lock; all states are set explicitly
"""The measurement is the worst of `STATES` states."""


class Body(NamedTuple):
    """One state of the body: outer and inner angle (rad), angular velocity in body axes (3,) (rad/s)."""

    outer: float
    inner: float
    velocity: Real


@cache
def states() -> tuple[Body, ...]:
    """Random ones, the same for every cell."""
    rng = np.random.default_rng(5)
    return tuple(Body(*rng.uniform(-np.pi, np.pi, 2), rng.normal(size=3)) for _ in range(STATES))


def scene(distance: float, hinge: float) -> Scene:
    """A body on a gimbal or a spherical hinge at its mass centre."""
    name = HINGES[round(hinge)]
    builder = SceneBuilder("gimbal lock").rigid_body("body", mass=1.0, inertia=INERTIA)
    if name == "quaternion":
        return builder.spherical("hinge", "ground", "body").marker("body", "body").scene()
    return (
        builder.gimbal("hinge", "ground", "body", sequence=name.split()[1], rotations=AWAY)
        .marker("body", "body")
        .scene()
    )


def measure(scene: Scene, distance: float, hinge: float) -> Measurement:
    """Largest relative error of the angular acceleration in body axes, against Euler's equations."""
    system, name = compile(scene), HINGES[round(hinge)]
    errors = []
    for body in states():
        q, u = _coordinates(name, distance, body)
        try:
            motion = system.evaluate(0.0, q, u).markers["body"]
        except DynamicsError as error:
            return Measurement(status="failed", message=str(error))
        spin, found = motion.rotation.T @ motion.velocity[:3], motion.rotation.T @ motion.acceleration[:3]
        exact = -np.linalg.solve(INERTIA, np.cross(spin, INERTIA @ spin))
        errors.append(np.linalg.norm(found - exact) / np.linalg.norm(exact))
    return Measurement(float(np.log10(max(max(errors), ROUNDING))))


def _coordinates(name: str, distance: float, body: Body) -> tuple[Real, Real]:
    """q and u; gimbal rates H^-1 w."""
    if name == "quaternion":
        turn = Rotation.from_euler("XYZ", [body.outer, 0.5 * np.pi - distance, body.inner])
        return turn.as_quat(scalar_first=True), body.velocity
    q = np.array([body.outer, LOCK[name] - distance, body.inner])
    return q, np.linalg.solve(hinge_map(name.split()[1], q), body.velocity)


def hinge_map(sequence: str, q: Real) -> Real:
    """H (3,3) of a gimbal in body axes: columns are its axes as the body sees them."""
    axes = np.eye(3)[["xyz".index(letter) for letter in sequence]]
    second, third = (Rotation.from_rotvec(-q[k] * axes[k]).as_matrix() for k in (1, 2))
    return np.array([third @ second @ axes[0], third @ axes[1], axes[2]]).T


def predicted(distance: Real, hinge: Real) -> Real:
    """log10 of the error of Cholesky's method, u cond(D) |udot|, as H shows it along the lost axis; least: rounding.

    D = H'JH has the condition 1/distance^2, udot grows as 1/distance^2, and H is of the size of the distance there. So
    three digits are lost for each factor of ten.
    """
    table = np.array([_error_at_one(name) for name in HINGES])
    power = np.array([0.0 if name == "quaternion" else 3.0 for name in HINGES])
    row = np.round(hinge).astype(int)
    return np.asarray(np.log10(ROUNDING * table[row]) - power[row] * np.log10(distance))


@cache
def _error_at_one(name: str) -> float:
    """Largest cond(D) |udot| s_min(H) distance^3 over |w rate| of the states, near lock."""
    if name == "quaternion":
        return 1.0
    distance, worst, h = 1e-3, 0.0, 1e-6
    for body in states():
        q, u = _coordinates(name, distance, body)
        H = hinge_map(name.split()[1], q)
        bias = (hinge_map(name.split()[1], q + h * u) - hinge_map(name.split()[1], q - h * u)) @ u / (2.0 * h)
        rate = -np.linalg.solve(INERTIA, np.cross(body.velocity, INERTIA @ body.velocity))
        size = np.linalg.norm(np.linalg.solve(H, rate - bias)) / np.linalg.norm(rate)
        worst = max(worst, float(np.linalg.cond(H.T @ INERTIA @ H) * size * np.linalg.svd(H)[1][-1]))
    return worst * distance**3


MAPS = (
    StabilityMap(
        name="gimbal_lock",
        title="Distance from gimbal lock: digits of the angular acceleration",
        quantity="log10 of the largest relative error",
        scene=scene,
        measure=measure,
        x=Axis("distance of the second angle from lock", "rad", 1e-9, 1.0, 18, log=True),
        y=Axis.of("hinge", *HINGES),
        thresholds=(-12.0, -8.0, -4.0),
        kinds=digit_kinds("12 digits and more", "8 to 12", "4 to 8", "fewer than 4"),
        overlay=Overlay(
            "u cond(D) |udot| along the lost axis",
            "error of Cholesky's method: Higham, Accuracy and Stability of Numerical Algorithms, 10.1",
            predicted,
            levels=(-12.0, -8.0, -4.0),
        ),
        shows="A three-axis gimbal loses three digits for each factor of ten nearer to lock, a quaternion none.",
        depth=1,
        failure=3,
    ),
)
