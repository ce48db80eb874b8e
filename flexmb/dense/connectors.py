"""Connectors in the dense route: loads on both ends, loads along coordinates, and stored energy.

Directly from the definitions in the schema, with rotations and table interpolation by SciPy. A line of zero length,
which the compiled connectors smooth, is not defined here.
"""

from __future__ import annotations

from typing import Any, NamedTuple, assert_never

import numpy as np

from flexmb.dense.jets import MovingFrame, profile, skew
from flexmb.dense.members import DenseTree
from flexmb.scene import schema as s
from flexmb.scene.connectors import AlongHinge, BetweenNodes, actuator, by_stem, sticks
from flexmb.scene.sticking import realised
from flexmb.scene.tree import coordinate_of
from flexmb.typing import Real


class Grip(NamedTuple):
    """Loads of a connector at one instant: [torque; force] (6,) on A about A, on B about B, World axes; energy (J)."""

    on_a: Real
    on_b: Real
    energy: float


class Hold(NamedTuple):
    """Load of a connector along the coordinate whose speed has the index u, and its energy (J)."""

    u: int
    load: float
    energy: float


def grip(connector: BetweenNodes, a: MovingFrame, b: MovingFrame, t: float) -> Grip:
    """Loads of a connector between two frames in World at time t."""
    arm = b.position.value - a.position.value
    match connector:
        case s.SpringDamper():
            on_b, energy = _line(connector, a, b, t)
        case s.Bushing():
            on_b, energy = _bushing(connector, a, b)
        case _:
            assert_never(connector)
    on_a = -np.concatenate([on_b[:3] + np.cross(arm, on_b[3:]), on_b[3:]])
    return Grip(on_a, on_b, energy)


def hold(scene: s.Scene, tree: DenseTree, connector: AlongHinge, q: Real, u: Real, t: float) -> Hold:
    """Load of a connector along a coordinate of a hinge, point mass or wheel at time t."""
    item, number = coordinate_of(scene, connector)
    x = [scalar for scalar in tree.scalars if scalar.owner == item.name][number]
    match connector:
        case s.AngularFriction() | s.LinearFriction():
            if not sticks(connector):
                return Hold(x.u, _friction(by_stem(connector), u[x.u]), 0.0)
            parts = realised(connector)
            return Hold(x.u, parts.constant.value + _friction(by_stem(parts.law), u[x.u]), 0.0)
        case s.AngularSpring() | s.LinearSpring():
            load, energy = _spring(by_stem(connector), q[x.q], u[x.u])
            push = actuator(connector)
            return Hold(x.u, (0.0 if push is None else float(profile(push, t).value)) - load, energy)
        case _:
            assert_never(connector)


def _friction(law: dict[str, Any], rate: float) -> float:
    rising = 0.0 if law["static"] is None else law["static"] - law["sliding"]
    level = law["sliding"] + rising / (1.0 + (rate / (law["stribeck"] or 1.0)) ** 2)
    return -level * rate / float(np.hypot(rate, law["smoothing"]))


def _spring(law: dict[str, Any], value: float, rate: float) -> tuple[float, float]:
    """What resists, and the energy stored, of a spring along a coordinate with its damper and stops."""
    load, energy = resistance(law, value - law["rest"])
    load += law["damping"] * rate
    for stop, side in ((law["lower"], -1.0), (law["upper"], 1.0)):
        depth = 0.0 if stop is None else max(0.0, side * (value - stop))
        pressed = max(0.0, 1.0 + law["stop_dissipation"] * side * rate)
        load += side * law["stop_stiffness"] * depth * pressed
        energy += 0.5 * law["stop_stiffness"] * depth**2
    return load, energy


def resistance(law: dict[str, Any], x: float) -> tuple[float, float]:
    """The load of a law at x, and its energy relative to x = 0."""
    if law["table"]:
        from scipy.integrate import quad  # slow to import, as is the interpolator

        points = [knot for knot in law["table"] if min(0.0, x) < knot < max(0.0, x)]
        energy = quad(lambda length: _table(law, length), 0.0, x, points=points or None, epsabs=1e-13, limit=200)[0]
        return _table(law, x), float(energy)
    powers = np.array([law["preload"], law["stiffness"], *law["stiffening"]])
    n = np.arange(len(powers))
    return float(powers @ x**n), float(powers @ (x ** (n + 1) / (n + 1)))


def _table(law: dict[str, Any], x: float) -> float:
    from scipy.interpolate import PchipInterpolator

    spline = PchipInterpolator(law["table"], law["loads"])
    inside = float(np.clip(x, law["table"][0], law["table"][-1]))
    return float(spline(inside) + spline.derivative()(inside) * (x - inside))


def _line(connector: s.SpringDamper, a: MovingFrame, b: MovingFrame, t: float) -> tuple[Real, float]:
    arm = b.position.value - a.position.value
    length = float(np.linalg.norm(arm))
    direction = arm / length
    rate = float(direction @ (b.position.rate - a.position.rate))
    law = by_stem(connector)
    elastic, energy = resistance(law, length - connector.free_length_m)
    sign = {"both": 0.0, "tension": 1.0, "compression": -1.0}[connector.acts]
    tension = elastic + connector.damping_Ns_m * rate
    if sign:  # the energy is relative to the length at which the spring becomes slack
        energy += 0.5 * connector.preload_N**2 / connector.stiffness_N_m
        if sign * elastic <= 0.0:
            elastic, energy, tension = 0.0, 0.0, 0.0
        tension = sign * max(0.0, sign * tension)
    if connector.force_N is not None:
        tension -= float(profile(connector.force_N, t).value)
    return np.concatenate([np.zeros(3), -tension * direction]), energy


def _bushing(connector: s.Bushing, a: MovingFrame, b: MovingFrame) -> tuple[Real, float]:
    from scipy.spatial.transform import Rotation

    R_A = a.rotation.value
    theta = Rotation.from_matrix(R_A.T @ b.rotation.value).as_rotvec()
    J = _left_jacobian(theta)
    w_A = a.angular_velocity()
    arm = b.position.value - a.position.value
    rates = np.concatenate(
        [
            np.linalg.solve(J, R_A.T @ (b.angular_velocity() - w_A)),
            R_A.T @ (b.position.rate - a.position.rate - np.cross(w_A, arm)),
        ]
    )
    xi = np.concatenate([theta, R_A.T @ arm])
    K, D = np.array(connector.stiffness), np.array(connector.damping)
    g = K @ xi + D @ rates
    on_b = -np.concatenate([R_A @ np.linalg.solve(J.T, g[:3]), R_A @ g[3:]])
    return on_b, 0.5 * float(xi @ K @ xi)


def _left_jacobian(theta: Real) -> Real:
    """(3,3): the sum of skew(theta)^n / (n+1)!; 48 terms are exact to round-off for |theta| < 2 pi."""
    term = total = np.eye(3)
    for n in range(1, 48):
        term = term @ skew(theta) / (n + 1)
        total = total + term
    return np.asarray(total)
