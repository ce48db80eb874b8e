"""Hinges, wheel bearings and guides of point masses in Exudyn: chains of one-freedom joints between carriers.

A hinge of several scalar coordinates becomes as many revolute or prismatic joints with massless carriers between them,
so that springs, motors and prescribed motion act on each coordinate by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.engines.conventions import axes_with
from crosscheck.engines.exudyn.carriers import Carrier, Workshop
from crosscheck.engines.exudyn.motion import FrameMotion, across, across_quaternion
from crosscheck.engines.functions_of_time import Profile, initial, profile
from flexmb.scene.freedoms import Ball, Coordinate
from flexmb.scene.hinges import WITH_AXIS, ClosureKind
from flexmb.typing import Real


def along_axis(f: Callable[[float], Profile], axis: Sequence[float]) -> Callable[[Any, float, Any], list[float]]:
    """The user function of a load f(t) along an axis (3,). Exudyn takes a list in half the time of an array."""
    x, y, z = map(float, axis)

    def load(mbs: Any, t: float, unit: Any) -> list[float]:
        value = f(t).value
        return [value * x, value * y, value * z]

    return load


Outboard = Callable[[FrameMotion], Carrier]
"""Makes the carrier beyond a link, given the motion of the outboard hinge frame."""


@dataclass(frozen=True)
class HingePort:
    """An inboard hinge frame: `position` (3,) on its carrier in Exudyn axes, `zero` (3,3) hinge -> Exudyn axes."""

    carrier: Carrier
    position: Real
    zero: Real
    motion: FrameMotion


@dataclass(frozen=True)
class Stage:
    """One scalar coordinate: `axis` (3,) in Exudyn axes (the same on both sides), the carriers and points it joins.

    `constraint` is the Exudyn object that prescribes it, along `prescribed`; `motor` the load between both sides;
    `markers` are those of its joint, inboard and outboard.
    """

    axis: Real
    inboard: Carrier
    inboard_point: Real
    outboard: Carrier
    outboard_point: Real
    coordinate: Coordinate
    motor: Callable[[float], Profile] | None
    prescribed: Callable[[float], Profile] | None
    constraint: int | None
    markers: tuple[int, int]

    @property
    def angular(self) -> bool:
        return self.coordinate.ANGULAR

    @property
    def stiffness(self) -> float:
        return self.coordinate.spring[0]

    @property
    def rest(self) -> float:
        return self.coordinate.spring[2]


@dataclass(frozen=True)
class ExudynLink:
    """All that joins an outboard body to its inboard one, acting on its `marker` at the hinge point.

    `connectors`: Exudyn objects and whether each is a constraint (with multipliers) or a spring-damper.
    """

    name: str
    stages: tuple[Stage, ...]
    connectors: tuple[tuple[int, bool], ...]
    marker: int | None
    spherical: tuple[Ball, Carrier, Carrier] | None = None


def free(name: str) -> ExudynLink:
    """No connection."""
    return ExudynLink(name, (), (), None)


def weld(shop: Workshop, name: str, port: HingePort, make: Outboard, point: Real) -> tuple[ExudynLink, Carrier]:
    """Rigid connection; `point` (3,) is the hinge point on the outboard carrier, in Exudyn axes."""
    carrier = make(port.motion)
    markers = [shop.marker(port.carrier, port.position), shop.marker(carrier, point)]
    joint = shop.mbs.AddObject(shop.items.GenericJoint(markerNumbers=markers, constrainedAxes=[1] * 6))
    return ExudynLink(name, (), ((joint, True),), markers[1]), carrier


def spherical(
    shop: Workshop, name: str, ball: Ball, port: HingePort, make: Outboard, point: Real
) -> tuple[ExudynLink, Carrier]:
    """Ball joint, with the isotropic spring and damper of the scene."""
    carrier = make(across_quaternion(port.motion, ball))
    markers = [shop.marker(port.carrier, port.position), shop.marker(carrier, point)]
    connectors = [(shop.mbs.AddObject(shop.items.SphericalJoint(markerNumbers=markers)), True)]
    if ball.stiffness or ball.damping:
        turning = np.diag([0.0] * 3 + [1.0] * 3)
        spring = shop.items.RigidBodySpringDamper(
            markerNumbers=markers, stiffness=ball.stiffness * turning,
            damping=ball.damping * turning, useIntrinsicFormulation=True,
        )  # fmt: skip
        connectors.append((shop.mbs.AddObject(spring), False))
    return ExudynLink(name, (), tuple(connectors), markers[1], (ball, port.carrier, carrier)), carrier


CONSTRAINED: dict[ClosureKind, Sequence[int]] = {
    "weld": [1, 1, 1, 1, 1, 1],
    "revolute": [1, 1, 1, 1, 1, 0],
    "spherical": [1, 1, 1, 0, 0, 0],
    "prismatic": [1, 1, 0, 1, 1, 1],
    "cylindrical": [1, 1, 0, 1, 1, 0],
    "universal": [1, 1, 1, 0, 0, 1],
    "planar": [0, 0, 1, 1, 1, 0],
    "in_line": [1, 1, 0, 0, 0, 0],
    "in_plane": [0, 0, 1, 0, 0, 0],
}
"""Displacements along and turns about x, y, z of frame A that a closure's joint suppresses, z being its axis."""


def closure(
    shop: Workshop, name: str, kind: ClosureKind, ports: Sequence[HingePort], axis: Real,
    kept: Sequence[int] | None = None,
) -> ExudynLink:  # fmt: skip
    """A joint of some kind between two ports; `axis` (3,) has the same components in both frames.

    `kept`: which of the kind's `CONSTRAINED` it suppresses, where others would do it twice. Of two turns either may be
    left out: Exudyn's equation for the other is that of a joint that is free about z.
    """
    turn = axes_with(axis, 2) if kind in WITH_AXIS else np.eye(3)
    markers = [shop.marker(port.carrier, port.position, port.zero @ turn) for port in ports]
    if kept is None and kind == "revolute":
        joint = shop.items.RevoluteJointZ(markerNumbers=markers)
    elif kept is None and kind == "spherical":
        joint = shop.items.SphericalJoint(markerNumbers=markers)
    else:
        axes = list(CONSTRAINED[kind] if kept is None else kept)
        joint = shop.items.GenericJoint(markerNumbers=markers, constrainedAxes=axes)
    return ExudynLink(name, (), ((shop.mbs.AddObject(joint), True),), markers[1])


def chain(
    shop: Workshop, name: str, port: HingePort, steps: Sequence[tuple[Real, Coordinate]], make: Outboard, point: Real
) -> tuple[ExudynLink, Carrier]:
    """One joint for each (axis in the hinge frame, coordinate), in order from the inboard side."""
    stages, connectors, markers = [], [], [0, 0]
    inboard, position, motion = port.carrier, port.position, port.motion
    for k, (axis, coordinate) in enumerate(steps):
        motion = across(motion, axis, coordinate)
        last = k == len(steps) - 1
        outboard = make(motion) if last else shop.rigid(motion, port.zero, None)
        arrival = point if last else np.zeros(3)
        markers = _markers(shop, inboard, position, outboard, arrival, port.zero @ axis, coordinate)
        connectors = [(_joint(shop, markers, coordinate), True)]
        connectors += [(spring, False) for spring in _spring(shop, markers, coordinate)]
        motor = _motor(shop, markers, coordinate)
        prescribed, constraint = _prescribed(shop, inboard, position, outboard, arrival, port.zero @ axis, coordinate)
        connectors += [] if constraint is None else [(constraint, True)]
        stages.append(
            Stage(
                port.zero @ axis, inboard, position, outboard, arrival, coordinate, motor, prescribed, constraint,
                (markers[0], markers[1]),
            )
        )  # fmt: skip
        inboard, position = outboard, arrival
    return ExudynLink(name, tuple(stages), tuple(connectors), markers[1]), inboard


def _markers(shop: Workshop, a: Carrier, p: Real, b: Carrier, q: Real, axis: Real, coordinate: Coordinate) -> list:
    """Markers on both sides with the axis along z (revolute) or x (prismatic), as Exudyn's joints want it."""
    axes = axes_with(axis, 2 if coordinate.ANGULAR else 0)
    return [shop.marker(a, p, axes), shop.marker(b, q, axes)]


def _joint(shop: Workshop, markers: list[int], coordinate: Coordinate) -> int:
    kind = shop.items.RevoluteJointZ if coordinate.ANGULAR else shop.items.PrismaticJointX
    return shop.mbs.AddObject(kind(markerNumbers=markers))


def _spring(shop: Workshop, markers: list[int], coordinate: Coordinate) -> list[int]:
    k, d, rest = coordinate.spring
    if not (k or d):
        return []
    law: dict[str, Any] = dict(markerNumbers=markers, stiffness=k, damping=d, offset=rest)
    if coordinate.ANGULAR:
        memory = shop.angle_memory(initial(coordinate)[0])
        return [shop.mbs.AddObject(shop.items.TorsionalSpringDamper(nodeNumber=memory, **law))]
    return [shop.mbs.AddObject(shop.items.LinearSpringDamper(**law))]


def _motor(shop: Workshop, markers: list[int], coordinate: Coordinate) -> Callable[[float], Profile] | None:
    """A pair of loads along the joint axis, turning with the bodies: + on the outboard side, - on the inboard one."""
    angular, function = coordinate.ANGULAR, coordinate.effort
    if function is None:
        return None
    load = shop.items.LoadTorqueVector if angular else shop.items.LoadForceVector
    f, axis = profile(function), np.eye(3)[2 if angular else 0]
    for marker, sign in zip(markers, (-1.0, 1.0), strict=True):
        along = (sign * axis).tolist()
        shop.mbs.AddLoad(
            load(markerNumber=marker, loadVector=along, bodyFixed=True, loadVectorUserFunction=along_axis(f, along))
        )
    return f


def _prescribed(
    shop: Workshop, a: Carrier, p: Real, b: Carrier, q: Real, axis: Real, coordinate: Coordinate
) -> tuple[Callable[[float], Profile] | None, int | None]:
    """A constraint that makes the relative coordinate follow its function of time."""
    angular, function = coordinate.ANGULAR, coordinate.prescribed
    if function is None:
        return None, None
    f = profile(function)
    ends = dict(bodyNumbers=[a.item, b.item], localPosition0=list(p), localPosition1=list(q), axis0=list(axis))
    if angular:
        relative = shop.items.MarkerBodiesRelativeRotationCoordinate(nodeNumber=shop.angle_memory(f(0.0).value), **ends)
    else:
        relative = shop.items.MarkerBodiesRelativeTranslationCoordinate(**ends)
    constraint = shop.items.CoordinateConstraint(
        markerNumbers=[shop.fixed_coordinate, shop.mbs.AddMarker(relative)],
        offsetUserFunction=lambda mbs, t, item, offset: f(t).value,
        offsetUserFunction_t=lambda mbs, t, item, offset: f(t).rate,
    )
    return f, shop.mbs.AddObject(constraint)
