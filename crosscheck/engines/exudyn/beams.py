"""A planar beam of geometrically exact or absolute-nodal elements in World's x-y plane: large deflections, no modes.

Shear-rigid beams are cable elements of the absolute nodal coordinate formulation, shear-flexible ones quadratic
geometrically exact elements. The root is clamped to a massless hub whose coordinates carry the constraints, so that
their multipliers are the load across the hinge; a beam that moves freely in the plane has no hub.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, sin

import numpy as np

from crosscheck.engines.conventions import Frame, frame
from crosscheck.engines.exudyn.carriers import Workshop
from crosscheck.engines.functions_of_time import Profile, breaks, initial, profile
from flexmb.scene.freedoms import ScalarFreedom
from flexmb.scene.functions import Function
from flexmb.scene.hinges import Hinge, Planar, Revolute
from flexmb.scene.schema import BeamBody, Load, Scene
from flexmb.scene.tree import node_frame
from flexmb.typing import Real

SECTION_KEYS = ("EA_N", "EIz_Nm2", "mass_per_length_kg_m", "rotary_z_kg_m")
JUMP_WINDOW = 1e-9
"""Relative distance in time at which a step's end and a jump of a load are the same."""


@dataclass(frozen=True)
class PlanarBeam:
    """The assembled beam: `stations` (n,) m along it with their Exudyn `nodes`; `holds` the constraints on a hub.

    `sheared`: nodes hold [x, y, angle], else [x, y, slope x, slope y].
    """

    scene: Scene
    shop: Workshop
    sheared: bool
    stations: Real
    nodes: tuple[int, ...]
    holds: tuple[int, ...]
    prescribed: list[tuple[int, Callable[[float], Profile]]]
    height: float
    sampler: int

    def deflection_measures(self) -> list[tuple[slice, Real]]:
        """None: large deflections are permitted."""
        return []


def assemble_beam(scene: Scene, elements: int) -> PlanarBeam:
    """Build the one beam of a scene that the engine supports, with at least `elements` elements."""
    beam, hinge = scene.bodies[0], scene.hinges[0]
    shop = Workshop(np.array(scene.gravity_m_s2), explicit=False)
    root = _root(beam, hinge)
    sheared = beam.theory == "timoshenko"
    stations = _stations(scene, beam, elements)
    add = _geometrically_exact if sheared else _cable
    nodes = add(shop, beam, stations, root)
    holds, prescribed = ((), []) if floats(hinge) else _clamp(shop, nodes[0], root, hinge)
    for load in scene.loads:
        _load(shop, nodes[_nearest(stations, beam, load.node)], load)
    sampler = shop.mbs.AddSensor(
        shop.items.SensorUserFunction(
            sensorUserFunction=lambda mbs, t, sensors, factors, configuration: [0.0], storeInternal=True
        )
    )
    shop.mbs.Assemble()
    return PlanarBeam(scene, shop, sheared, stations, nodes, holds, prescribed, root.position[2], sampler)


def root_frame(beam: BeamBody, hinge: Hinge) -> Frame:
    """The beam's frame in World where the hinge coordinate vanishes."""
    outboard = frame(*node_frame(beam, hinge.child_node)) @ frame(hinge.child_position_m, hinge.child_quaternion)
    return frame(hinge.parent_position_m, hinge.parent_quaternion) @ outboard.inverse()


@dataclass(frozen=True)
class _Root:
    """The root at t = 0: position (3,) m, velocity (2,) m/s, angle (rad) of the axis against World x, its rate."""

    position: Real
    velocity: Real
    angle: float
    rate: float

    def moved(self, x: float) -> tuple[Real, Real, Real, Real]:
        """Position, velocity, axis and rate of the axis, each (2,), of the section at x (m) of the straight beam."""
        along, across = np.array([cos(self.angle), sin(self.angle)]), np.array([-sin(self.angle), cos(self.angle)])
        return (
            self.position[:2] + x * along, self.velocity + self.rate * x * across, along, self.rate * across,
        )  # fmt: skip


def _root(beam: BeamBody, hinge: Hinge) -> _Root:
    base = root_frame(beam, hinge)
    rest = float(np.arctan2(base.rotation[1, 0], base.rotation[0, 0]))
    position, velocity, angle, rate = base.position, np.zeros(2), 0.0, 0.0
    if isinstance(hinge, Revolute | Planar):
        angle, rate = initial(hinge.rotation)
    if isinstance(hinge, Planar):
        inboard = frame(hinge.parent_position_m, hinge.parent_quaternion).rotation[:, :2]
        (x, x_rate), (y, y_rate) = initial(hinge.x), initial(hinge.y)
        position, velocity = position + inboard @ [x, y], inboard[:2] @ [x_rate, y_rate]
    sign = axis_sign(hinge)
    return _Root(position, velocity, rest + sign * angle, sign * rate)


def axis_sign(hinge: Hinge) -> float:
    """+1 where the hinge axis is World +z, or there is none, -1 where it is -z."""
    axes = [freedom.axis for freedom in hinge.freedoms if isinstance(freedom, ScalarFreedom) and freedom.turns]
    return float(np.sign(axes[0][2])) if axes else 1.0


def floats(hinge: Hinge) -> bool:
    """Whether the root moves freely in the plane, and is not held in a place as by a weld or a revolute hinge."""
    return len(hinge.freedoms) == 3


def _clamp(
    shop: Workshop, node: int, root: _Root, hinge: Hinge
) -> tuple[tuple[int, ...], list[tuple[int, Callable[[float], Profile]]]]:
    """Clamp the beam's first node to a massless hub, and hold that as the hinge says."""
    hub = shop.mbs.AddNode(
        shop.items.NodeRigidBody2D(
            referenceCoordinates=[*root.position[:2], root.angle], initialVelocities=[0.0, 0.0, root.rate]
        )
    )
    shop.mbs.AddObject(shop.items.ObjectRigidBody2D(nodeNumber=hub, mass=0.0, inertia=0.0))
    markers = [shop.mbs.AddMarker(shop.items.MarkerNodeRigid(nodeNumber=number)) for number in (hub, node)]
    shop.mbs.AddObject(shop.items.GenericJoint(markerNumbers=markers, constrainedAxes=[1, 1, 0, 0, 0, 1]))
    return _hold(shop, hub, hinge)


def _hold(
    shop: Workshop, hub: int, hinge: Hinge
) -> tuple[tuple[int, ...], list[tuple[int, Callable[[float], Profile]]]]:
    """Constraints on the hub's x, y and, unless it turns freely, its angle beyond the one at t = 0."""
    function = hinge.rotation.prescribed_rad if isinstance(hinge, Revolute) else None
    turns_freely = isinstance(hinge, Revolute) and function is None
    holds = [_constrain(shop, hub, coordinate) for coordinate in (0, 1)]
    if turns_freely:
        return tuple(holds), []
    if function is None:
        return (*holds, _constrain(shop, hub, 2)), []
    sign, f = axis_sign(hinge), profile(function)
    start = f(0.0).value
    holds.append(
        _constrain(
            shop, hub, 2,
            offsetUserFunction=lambda mbs, t, item, offset: sign * (f(t).value - start),
            offsetUserFunction_t=lambda mbs, t, item, offset: sign * f(t).rate,
        )
    )  # fmt: skip
    return tuple(holds), [(holds[2], lambda t: Profile(*(sign * np.array(f(t)))))]


def _constrain(shop: Workshop, node: int, coordinate: int, **motion: Callable) -> int:
    marker = shop.mbs.AddMarker(shop.items.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))
    return shop.mbs.AddObject(shop.items.CoordinateConstraint(markerNumbers=[shop.fixed_coordinate, marker], **motion))


def _load(shop: Workshop, node: int, load: Load) -> None:
    """A force or torque in World axes at a node of the mesh."""
    marker = shop.mbs.AddMarker(shop.items.MarkerNodeRigid(nodeNumber=node))
    kind = shop.items.LoadForceVector if load.type == "force" else shop.items.LoadTorqueVector
    f, direction = _halved_at_jumps(load.function), np.array(load.direction)
    shop.mbs.AddLoad(
        kind(
            markerNumber=marker, loadVector=list(direction),
            loadVectorUserFunction=lambda mbs, t, unit: f(t) * direction,
        )
    )  # fmt: skip


def _halved_at_jumps(function: Function) -> Callable[[float], float]:
    """The function, with the mean of both sides where it jumps inside a run.

    Fixed steps use only the values at their ends: with the mean, a jump at the end of a step does not reduce their
    order."""
    f, jumps = profile(function), [t for t in breaks(function) if t > 0.0]

    def value(t: float) -> float:
        for jump in jumps:
            if abs(t - jump) < JUMP_WINDOW * jump:
                return 0.5 * (f(jump * (1.0 - JUMP_WINDOW)).value + f(jump * (1.0 + JUMP_WINDOW)).value)
        return f(t).value

    return value


def _nearest(stations: Real, beam: BeamBody, node: str) -> int:
    """The station (number) of a node of the beam."""
    return int(np.argmin(np.abs(stations - node_frame(beam, node).position[0])))


def _stations(scene: Scene, beam: BeamBody, elements: int) -> Real:
    """Ends of the elements: a uniform grid, and wherever a marker or a load is."""
    marked = [node_frame(beam, item.node).position[0] for item in (*scene.markers, *scene.loads)]
    grid = np.linspace(0.0, beam.length_m, elements + 1)
    extra = {x for x in marked if np.min(np.abs(grid - x)) > 1e-9 * beam.length_m}
    return np.sort(np.concatenate([grid, sorted(extra)]))


def section(beam: BeamBody, x: float, key: str) -> float:
    """A section property at x: linear between stations."""
    return float(np.interp(x, [s.x_m for s in beam.stations], [getattr(s, key) for s in beam.stations]))


def _cable(shop: Workshop, beam: BeamBody, stations: Real, root: _Root) -> tuple[int, ...]:
    nodes = []
    for x in stations:
        position, velocity, along, turning = root.moved(x)
        nodes.append(
            shop.mbs.AddNode(
                shop.items.NodePoint2DSlope1(
                    referenceCoordinates=[*position, *along], initialVelocities=[*velocity, *turning]
                )
            )
        )
    for k, (left, right) in enumerate(zip(stations, stations[1:], strict=False)):
        EA, EI, mass, _ = (section(beam, (left + right) / 2.0, key) for key in SECTION_KEYS)
        element = shop.mbs.AddObject(
            shop.items.ObjectANCFCable2D(
                nodeNumbers=nodes[k : k + 2], length=right - left, massPerLength=mass, bendingStiffness=EI,
                axialStiffness=EA, useReducedOrderIntegration=1,
            )
        )  # fmt: skip
        shop.weigh(element)
    return tuple(nodes)


def _geometrically_exact(shop: Workshop, beam: BeamBody, stations: Real, root: _Root) -> tuple[int, ...]:
    def node(x: float) -> int:
        position, velocity, _, _ = root.moved(x)
        return shop.mbs.AddNode(
            shop.items.NodeRigidBody2D(
                referenceCoordinates=[*position, root.angle], initialVelocities=[*velocity, root.rate]
            )
        )

    nodes = [node(x) for x in stations]
    for k, (left, right) in enumerate(zip(stations, stations[1:], strict=False)):
        middle = (left + right) / 2.0
        EA, EI, mass, rotary = (section(beam, middle, key) for key in SECTION_KEYS)
        element = shop.mbs.AddObject(
            shop.items.ObjectBeamGeometricallyExact2D(
                nodeNumbers=[nodes[k], node(middle), nodes[k + 1]], length=right - left, massPerLength=mass,
                crossSectionInertia=rotary, bendingStiffness=EI, axialStiffness=EA,
                shearStiffness=section(beam, middle, "GAy_N"), includeReferenceRotations=True,
            )
        )  # fmt: skip
        shop.weigh(element)
    return tuple(nodes)
