"""Connectors evaluated for the peers: loads on both ends, energy and power.

This is independent of flexmb's compiled evaluation, so that the two check each other.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from math import hypot, inf, sqrt
from typing import Any, NamedTuple, assert_never, get_args

import numpy as np

from crosscheck.engines.conventions import Frame, cross, cross_matrix, quaternion_of, rotation_vector
from crosscheck.engines.functions_of_time import profile
from crosscheck.engines.links import Link, closed_frames
from flexmb.scene.connectors import (
    AngularFriction,
    AngularSpring,
    Bushing,
    HingeSpring,
    LinearFriction,
    LinearSpring,
    SpringDamper,
    actuator,
    by_stem,
)
from flexmb.scene.schema import Scene
from flexmb.scene.tree import coordinate_of
from flexmb.typing import Real

PeerLine = SpringDamper | Bushing
PeerAlong = AngularSpring | LinearSpring | AngularFriction | LinearFriction
KNOWN = (*get_args(PeerLine), *get_args(PeerAlong))
"""The connectors that adapters know; a scene with another is refused by `crosscheck.engines.links.obstacle`."""

Law = Callable[[float], tuple[float, float]]
"""The resisting load and the stored energy as functions of the displacement."""


class Moving(NamedTuple):
    """Motion of a frame in World axes: position (3,), rotation (3,3), angular velocity (3,), velocity (3,)."""

    position: Real
    rotation: Real
    angular: Real
    linear: Real

    def carrying(self, inner: Frame) -> Moving:
        """The motion of a frame fixed in this one."""
        arm = self.rotation @ inner.position
        velocity = self.linear + cross(self.angular, arm)
        return Moving(self.position + arm, self.rotation @ inner.rotation, self.angular, velocity)


WORLD = Moving(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))


class Exerted(NamedTuple):
    """[torque; force] (6,) on A about A and on B about B, World axes; stored energy (J); power of inelastic parts
    (W)."""

    on_a: Real
    on_b: Real
    energy: float
    power: float


class Along(NamedTuple):
    """Load along a coordinate, or tension of a line; stored energy (J), power of inelastic parts (W)."""

    load: float
    energy: float
    power: float


class Connection:
    """A connector between two frames on links, -1 being the ground; `exerted(t, a, b)` is what it does."""

    def __init__(self, scene: Scene, chain: tuple[Link, ...], connector: PeerLine) -> None:
        self.name = connector.name
        self.a, self.b = closed_frames(scene, chain, connector)
        self.exerted = exerts(connector)


def exerts(connector: PeerLine) -> Callable[[float, Moving, Moving], Exerted]:
    """The function of time and of the motion of frames A and B that gives the connector's loads."""
    on = _law(connector)

    def exerted(t: float, a: Moving, b: Moving) -> Exerted:
        on_b, energy, power = on(t, a, b)
        arm = b.position - a.position
        on_a = -np.concatenate([on_b[:3] + cross(arm, on_b[3:]), on_b[3:]])
        return Exerted(on_a, on_b, energy, power)

    return exerted


def _law(connector: PeerLine) -> Callable[[float, Moving, Moving], tuple[Real, float, float]]:
    match connector:
        case SpringDamper():
            return _line(connector)
        case Bushing():
            return _bushing(connector)
        case _:
            assert_never(connector)


def connections(scene: Scene, chain: tuple[Link, ...]) -> tuple[Connection, ...]:
    return tuple(
        Connection(scene, chain, connector) for connector in scene.connectors if isinstance(connector, PeerLine)
    )


def along_hinges(scene: Scene) -> list[tuple[str, str, int, Callable[[float, float, float], Along]]]:
    """For each connector along a hinge: its name, the hinge, wheel or point mass, the number of the coordinate, and the
    load as a function of time, value and rate."""
    loads = []
    for connector in scene.connectors:
        if isinstance(connector, PeerAlong):
            item, number = coordinate_of(scene, connector)
            loads.append((connector.name, item.name, number, _along(connector)))
    return loads


def law_of(stems: dict[str, Any]) -> Law:
    """The law of a spring, given its parameters by their names without units."""
    if stems["table"]:
        return _by_table(stems["table"], stems["loads"])
    powers = [stems["preload"], stems["stiffness"], *stems["stiffening"]]

    def by_powers(x: float) -> tuple[float, float]:
        load = sum(power * x**n for n, power in enumerate(powers))
        return load, sum(power * x ** (n + 1) / (n + 1) for n, power in enumerate(powers))

    return by_powers


def _by_table(places: tuple[float, ...], given: tuple[float, ...]) -> Law:
    """Cubics between the knots, straight lines beyond; evaluated in plain Python, which is faster than a SciPy
    spline."""
    from scipy.interpolate import PchipInterpolator  # slow to import, and few springs have a table

    spline = PchipInterpolator(places, given)
    knots, pieces = spline.x.tolist(), spline.c.T.tolist()
    levels, slopes = spline.antiderivative()(spline.x).tolist(), spline.derivative()(spline.x).tolist()
    loads = spline(spline.x).tolist()

    def at(x: float) -> tuple[float, float]:
        i = bisect_right(knots, x) - 1
        if i < 0 or i >= len(pieces):
            i = max(i, 0)
            d = x - knots[i]
            return loads[i] + slopes[i] * d, levels[i] + d * (loads[i] + 0.5 * slopes[i] * d)
        (a, b, c, e), d = pieces[i], x - knots[i]
        return ((a * d + b) * d + c) * d + e, levels[i] + d * (e + d * (c / 2.0 + d * (b / 3.0 + d * a / 4.0)))

    zero = at(0.0)[1]

    def by_table(x: float) -> tuple[float, float]:
        load, energy = at(x)
        return load, energy - zero

    return by_table


def tension_of(connector: SpringDamper) -> Callable[[float, float, float], Along]:
    """Tension, energy and power as functions of time, elongation and its rate."""
    law, push = law_of(by_stem(connector)), connector.force_N and profile(connector.force_N)
    sign = {"both": 0.0, "tension": 1.0, "compression": -1.0}[connector.acts]
    slack = 0.5 * connector.preload_N**2 / connector.stiffness_N_m if sign else 0.0

    def tension_at(t: float, x: float, rate: float) -> Along:
        elastic, energy = law(x)
        tension, energy = elastic + connector.damping_Ns_m * rate, energy + slack
        if sign and sign * elastic <= 0.0:
            elastic, tension, energy = 0.0, 0.0, 0.0
        elif sign:
            tension = sign * max(0.0, sign * tension)
        tension -= push(t).value if push else 0.0
        return Along(tension, energy, (elastic - tension) * rate)

    return tension_at


def _line(connector: SpringDamper) -> Callable[[float, Moving, Moving], tuple[Real, float, float]]:
    tension = tension_of(connector)

    def exert(t: float, a: Moving, b: Moving) -> tuple[Real, float, float]:
        arm = b.position - a.position
        length = sqrt(arm @ arm)
        along = arm / length
        pulled = tension(t, length - connector.free_length_m, float(along @ (b.linear - a.linear)))
        return np.concatenate([np.zeros(3), -pulled.load * along]), pulled.energy, pulled.power

    return exert


def _bushing(connector: Bushing) -> Callable[[float, Moving, Moving], tuple[Real, float, float]]:
    K, D = np.array(connector.stiffness), np.array(connector.damping)

    def exert(t: float, a: Moving, b: Moving) -> tuple[Real, float, float]:
        to_a, arm = a.rotation.T, b.position - a.position
        theta = rotation_vector(quaternion_of(to_a @ b.rotation))
        inverse = _inverse_jacobian(theta)
        xi = np.concatenate([theta, to_a @ arm])
        moving = to_a @ (b.linear - a.linear - cross(a.angular, arm))
        rate = np.concatenate([inverse @ (to_a @ (b.angular - a.angular)), moving])
        elastic, lost = K @ xi, D @ rate
        g = elastic + lost
        on_b = -np.concatenate([a.rotation @ (inverse.T @ g[:3]), a.rotation @ g[3:]])
        return on_b, 0.5 * float(elastic @ xi), -float(lost @ rate)

    return exert


def _inverse_jacobian(theta: Real) -> Real:
    """(3,3) inverse left Jacobian of the exponential."""
    angle, turn = float(np.linalg.norm(theta)), cross_matrix(theta)
    if angle < 1e-4:
        return np.asarray(np.eye(3) - 0.5 * turn + turn @ turn / 12.0)
    b = (1.0 - 0.5 * angle / np.tan(0.5 * angle)) / angle**2
    return np.asarray(np.eye(3) - 0.5 * turn + b * turn @ turn)


def _along(connector: PeerAlong) -> Callable[[float, float, float], Along]:
    match connector:
        case AngularFriction() | LinearFriction():
            stems = by_stem(connector)
            return lambda t, q, v: _friction(stems, v)
        case AngularSpring() | LinearSpring():
            return _spring(connector)
        case _:
            assert_never(connector)


def _spring(connector: HingeSpring) -> Callable[[float, float, float], Along]:
    stems = by_stem(connector)
    law = law_of(stems)
    lower, upper = (
        (-inf if stems["lower"] is None else stems["lower"]),
        (inf if stems["upper"] is None else stems["upper"]),
    )
    k, e = stems["stop_stiffness"], stems["stop_dissipation"]
    push = actuator(connector)
    pushed_by = push and profile(push)

    def load(t: float, q: float, v: float) -> Along:
        elastic, energy = law(q - stems["rest"])
        deep, side = (q - upper, 1.0) if q > upper else (lower - q, -1.0) if q < lower else (0.0, 1.0)
        pushed = side * k * deep * max(0.0, 1.0 + e * side * v)
        lost = stems["damping"] * v + pushed - side * k * deep
        driven = pushed_by(t).value if pushed_by else 0.0
        load = driven - (elastic + side * k * deep + lost)
        return Along(load, energy + 0.5 * k * deep**2, (driven - lost) * v)

    return load


def _friction(stems: dict[str, Any], v: float) -> Along:
    rising = 0.0 if stems["static"] is None else stems["static"] - stems["sliding"]
    level = stems["sliding"] + rising / (1.0 + (v / (stems["stribeck"] or 1.0)) ** 2)
    load = -level * v / hypot(v, stems["smoothing"])
    return Along(load, 0.0, load * v)
