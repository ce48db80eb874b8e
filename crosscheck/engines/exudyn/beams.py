"""A planar beam of geometrically exact or absolute-nodal elements, turning about World z: large deflections, no modes.

Shear-rigid beams are cable elements of the absolute nodal coordinate formulation, shear-flexible ones quadratic
geometrically exact elements. The root is clamped to a massless hub whose coordinates carry the constraints, so that
their multipliers are the load across the hinge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, sin

import numpy as np

from crosscheck.engines.contract import Array
from crosscheck.engines.conventions import Frame, frame
from crosscheck.engines.exudyn.carriers import Workshop
from crosscheck.engines.exudyn.motion import initial
from crosscheck.engines.functions_of_time import Profile, profile
from flexmb.scene.hinges import Hinge, Revolute
from flexmb.scene.schema import BeamBody, Scene
from flexmb.scene.tree import node_frame

SECTION_KEYS = ("EA_N", "EIz_Nm2", "mass_per_length_kg_m", "rotary_z_kg_m")


@dataclass(frozen=True)
class PlanarBeam:
    """The assembled beam: `stations` (n,) m along it with their Exudyn `nodes`; `holds` the constraints on the hub.

    `sheared`: nodes hold [x, y, angle], else [x, y, slope x, slope y].
    """

    scene: Scene
    shop: Workshop
    sheared: bool
    stations: Array
    nodes: tuple[int, ...]
    holds: tuple[int, ...]
    prescribed: list[tuple[int, Callable[[float], Profile]]]
    height: float
    sampler: int

    def deflection_measures(self) -> list[tuple[slice, Array]]:
        """Large deflections are what these elements are for."""
        return []


def assemble_beam(scene: Scene, elements: int) -> PlanarBeam:
    """Build the one beam of a scene that the engine supports, with at least `elements` elements."""
    beam, hinge = scene.bodies[0], scene.hinges[0]
    shop = Workshop(np.zeros(3), explicit=False)
    base, angle, rate = _pose(beam, hinge)
    hub = _hub(shop, base.position, angle, rate)
    holds, prescribed = _hold(shop, hub, hinge)
    sheared = beam.theory == "timoshenko"
    stations = _stations(scene, beam, elements)
    add = _geometrically_exact if sheared else _cable
    nodes = add(shop, beam, stations, base.position, angle, rate)
    markers = [shop.mbs.AddMarker(shop.items.MarkerNodeRigid(nodeNumber=node)) for node in (hub, nodes[0])]
    shop.mbs.AddObject(shop.items.GenericJoint(markerNumbers=markers, constrainedAxes=[1, 1, 0, 0, 0, 1]))
    sampler = shop.mbs.AddSensor(
        shop.items.SensorUserFunction(
            sensorUserFunction=lambda mbs, t, sensors, factors, configuration: [0.0], storeInternal=True
        )
    )
    shop.mbs.Assemble()
    return PlanarBeam(scene, shop, sheared, stations, nodes, holds, prescribed, base.position[2], sampler)


def root_frame(beam: BeamBody, hinge: Hinge) -> Frame:
    """The beam's frame in World where the hinge coordinate vanishes."""
    outboard = frame(*node_frame(beam, hinge.child_node)) @ frame(hinge.child_position_m, hinge.child_quaternion)
    return frame(hinge.parent_position_m, hinge.parent_quaternion) @ outboard.inverse()


def _pose(beam: BeamBody, hinge: Hinge) -> tuple[Frame, float, float]:
    """Root frame, and the angle (rad) of the beam axis against World x and its rate at t = 0."""
    base = root_frame(beam, hinge)
    angle, rate = initial(hinge.rotation) if isinstance(hinge, Revolute) else (0.0, 0.0)
    sign = axis_sign(hinge)
    rest = np.arctan2(base.rotation[1, 0], base.rotation[0, 0])
    return base, rest + sign * angle, sign * rate


def axis_sign(hinge: Hinge) -> float:
    """+1 where the hinge axis is World +z, -1 where it is -z."""
    return float(np.sign(hinge.axis[2])) if isinstance(hinge, Revolute) else 1.0


def _hub(shop: Workshop, position: Array, angle: float, rate: float) -> int:
    node = shop.mbs.AddNode(
        shop.items.NodeRigidBody2D(referenceCoordinates=[*position[:2], angle], initialVelocities=[0.0, 0.0, rate])
    )
    shop.mbs.AddObject(shop.items.ObjectRigidBody2D(nodeNumber=node, mass=0.0, inertia=0.0))
    return node


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
    return shop.mbs.AddObject(
        shop.items.CoordinateConstraint(markerNumbers=[shop.fixed_coordinate, marker], **motion)
    )


def _stations(scene: Scene, beam: BeamBody, elements: int) -> Array:
    """Ends of the elements: a uniform grid, and wherever a marker is."""
    marked = [node_frame(beam, marker.node).position[0] for marker in scene.markers]
    grid = np.linspace(0.0, beam.length_m, elements + 1)
    extra = [x for x in marked if np.min(np.abs(grid - x)) > 1e-9 * beam.length_m]
    return np.sort(np.concatenate([grid, extra]))


def section(beam: BeamBody, x: float, key: str) -> float:
    """A section property at x: linear between stations."""
    return float(np.interp(x, [s.x_m for s in beam.stations], [getattr(s, key) for s in beam.stations]))


def _cable(shop: Workshop, beam: BeamBody, stations: Array, base: Array, angle: float, rate: float) -> tuple[int, ...]:
    along, across = np.array([cos(angle), sin(angle)]), np.array([-sin(angle), cos(angle)])
    nodes = [
        shop.mbs.AddNode(
            shop.items.NodePoint2DSlope1(
                referenceCoordinates=[*(base[:2] + x * along), *along],
                initialVelocities=[*(rate * x * across), *(rate * across)],
            )
        )
        for x in stations
    ]
    for k, (left, right) in enumerate(zip(stations, stations[1:], strict=False)):
        EA, EI, mass, _ = (section(beam, (left + right) / 2.0, key) for key in SECTION_KEYS)
        shop.mbs.AddObject(
            shop.items.ObjectANCFCable2D(
                nodeNumbers=nodes[k : k + 2], length=right - left, massPerLength=mass, bendingStiffness=EI,
                axialStiffness=EA, useReducedOrderIntegration=1,
            )
        )  # fmt: skip
    return tuple(nodes)


def _geometrically_exact(
    shop: Workshop, beam: BeamBody, stations: Array, base: Array, angle: float, rate: float
) -> tuple[int, ...]:
    along, across = np.array([cos(angle), sin(angle)]), np.array([-sin(angle), cos(angle)])

    def node(x: float) -> int:
        return shop.mbs.AddNode(
            shop.items.NodeRigidBody2D(
                referenceCoordinates=[*(base[:2] + x * along), angle], initialVelocities=[*(rate * x * across), rate]
            )
        )

    nodes = [node(x) for x in stations]
    for k, (left, right) in enumerate(zip(stations, stations[1:], strict=False)):
        middle = (left + right) / 2.0
        EA, EI, mass, rotary = (section(beam, middle, key) for key in SECTION_KEYS)
        shop.mbs.AddObject(
            shop.items.ObjectBeamGeometricallyExact2D(
                nodeNumbers=[nodes[k], node(middle), nodes[k + 1]], length=right - left, massPerLength=mass,
                crossSectionInertia=rotary, bendingStiffness=EI, axialStiffness=EA,
                shearStiffness=section(beam, middle, "GAy_N"), includeReferenceRotations=True,
            )
        )  # fmt: skip
    return tuple(nodes)
