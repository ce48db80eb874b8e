"""A scene as an assembled Exudyn system, with tables from names in the scene to Exudyn items."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TypeGuard, assert_never

import numpy as np

from crosscheck.engines.connections import along_hinges
from crosscheck.engines.conventions import Frame, frame, rotation_matrix
from crosscheck.engines.exudyn import joints, springs
from crosscheck.engines.exudyn.carriers import Carrier, Workshop
from crosscheck.engines.exudyn.joints import ExudynLink, HingePort, along_axis
from crosscheck.engines.exudyn.modal import NodeShape, integrals, node_shape
from crosscheck.engines.exudyn.motion import AT_REST, FrameMotion, across_quaternion
from crosscheck.engines.exudyn.sections import BeamElement, BeamSection, SpatialBeam, spatial_beam
from crosscheck.engines.functions_of_time import Profile, profile
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.freedoms import Ball, Floating, ScalarFreedom
from flexmb.scene.hinges import Free, Hinge
from flexmb.scene.modal_data import modal_arrays
from flexmb.scene.rigid_equivalent import Inertia, rest_inertia, wheel_inertia
from flexmb.scene.schema import BeamBody, Body, Closure, Load, ModalBody, PointMass, Scene, Wheel
from flexmb.scene.tree import GROUND, ends, node_frame, ordered
from flexmb.typing import Real

_, Y, Z = np.eye(3)
CROSS_ARM = 0.01
"""Arm (m) of the massless crosses: displacements are linear in it, so its length does not matter."""


@dataclass(frozen=True)
class Placed:
    """A scene body in the system: its carrier, its motion at t = 0 and, if it is flexible, modal state and mesh
    crosses.

    `reach` (m,): largest displacement of an inertia point for a unit modal coordinate, in units of the body's length.
    A `beam` of elements has a carrier at every section; `at` is one of them, which is its `section`.
    """

    body: Body
    carrier: Carrier
    motion: FrameMotion
    eta: Real = field(default_factory=lambda: np.zeros(0))
    rate: Real = field(default_factory=lambda: np.zeros(0))
    crosses: dict[str, list[int]] = field(default_factory=dict)
    reach: Real = field(default_factory=lambda: np.zeros(0))
    beam: SpatialBeam | None = None
    section: BeamSection | None = None

    def at(self, node: str) -> Placed:
        """What carries a node: a section of a beam of elements, or the body itself."""
        if self.beam is None:
            return self
        section = self.beam.sections[node]
        return replace(self, carrier=section.carrier, motion=section.motion, beam=None, section=section)

    def shape(self, node: str) -> NodeShape:
        """A node in Exudyn axes."""
        if self.section is not None:
            return NodeShape(np.zeros(3), self.section.rotation, *np.zeros((2, 3, 0)))
        if self.carrier.flexible is not None:
            return node_shape(self.body, node, self.carrier.zero)
        rest = node_frame(self.body, node)
        none = np.zeros((3, 0))
        zero = self.carrier.zero
        return NodeShape(zero @ np.array(rest.position), zero @ rotation_matrix(rest.quaternion), none, none)


@dataclass(frozen=True)
class Assembly:
    """The assembled system. `links` holds hinges, wheel bearings, point masses' guides and closures by scene names."""

    scene: Scene
    shop: Workshop
    bodies: dict[str, Placed]
    hinges: dict[str, ExudynLink]
    wheels: dict[str, ExudynLink]
    guides: dict[str, ExudynLink]
    closures: dict[str, ExudynLink]
    carriers: tuple[Carrier, ...]
    sampler: int

    @property
    def elements(self) -> tuple[BeamElement, ...]:
        """Those of all beams."""
        beams = (placed.beam for placed in self.bodies.values())
        return tuple(element for beam in beams if beam is not None for element in beam.elements)

    @property
    def links(self) -> dict[str, ExudynLink]:
        return self.hinges | self.wheels | self.guides | self.closures

    @property
    def prescribed(self) -> list[tuple[int, Callable[[float], Profile]]]:
        """Every prescribing constraint with its function of time."""
        stages = [stage for link in self.links.values() for stage in link.stages]
        return [(stage.constraint, stage.prescribed) for stage in stages if stage.constraint is not None]

    def deflection_measures(self) -> list[tuple[slice, Real]]:
        """The places of the modal coordinates, and their reach, for every flexible body."""
        measures = []
        for placed in self.bodies.values():
            if placed.carrier.modes is not None:
                first = self.shop.mbs.GetNodeODE2Index(placed.carrier.modes)
                measures.append((slice(first, first + len(placed.eta)), placed.reach))
        return measures


def unconstrained(scene: Scene) -> bool:
    """Whether the scene is one free-flying body, for which Exudyn's explicit integrators can be used."""
    single = len(scene.bodies) == 1 and isinstance(scene.hinges[0], Free) and not bends(scene.bodies[0])
    return single and not scene.wheels and not scene.point_masses and not scene.connectors


def flexible(body: Body) -> bool:
    """Whether the body has modal coordinates here."""
    return isinstance(body, ModalBody) and body.level != "rigid"


def bends(body: Body) -> TypeGuard[BeamBody]:
    """Whether the body is a beam of elements here."""
    return isinstance(body, BeamBody) and body.level != "rigid"


def deforming(body: Body, node: str) -> bool:
    """Whether the node moves relative to its body's frame."""
    return flexible(body) and node_shape(body, node, np.eye(3)).deforms


def assemble(scene: Scene, kept: Mapping[str, Sequence[int]] = MappingProxyType({})) -> Assembly:
    """Build the Exudyn system of a scene that `supports` accepted; `kept`: axes that closures suppress, if not all."""
    shop = Workshop(np.array(scene.gravity_m_s2), unconstrained(scene))
    held = _held_nodes(scene)
    placed: dict[str, Placed] = {}
    hinges = {}
    carriers: list[Carrier] = []
    for body, hinge in ordered(scene):
        hinges[hinge.name], placed[body.name] = _attach(shop, scene, placed, body, hinge, held[body.name])
        beam = placed[body.name].beam
        carriers += [placed[body.name].carrier] if beam is None else beam.carriers
    wheels, guides = {}, {}
    for wheel in scene.wheels:
        wheels[wheel.name], carrier = _wheel(shop, placed[wheel.body].at(wheel.node), wheel)
        carriers.append(carrier)
    for mass in scene.point_masses:
        guides[mass.name], carrier = _point_mass(shop, placed[mass.body].at(mass.node), mass)
        carriers.append(carrier)
    closures = {closure.name: _closure(shop, placed, closure, kept.get(closure.name)) for closure in scene.closures}
    for connector in scene.connectors:
        if isinstance(connector, BetweenNodes):
            _connect(shop, placed, connector)
    _connect_along(shop, scene, (hinges, wheels, guides))
    for load in scene.loads:
        _load(shop, placed[load.body].at(load.node), load)
    sampler = shop.mbs.AddSensor(shop.items.SensorUserFunction(sensorUserFunction=_nothing, storeInternal=True))
    shop.mbs.Assemble()
    return Assembly(scene, shop, placed, hinges, wheels, guides, closures, tuple(carriers), sampler)


def _nothing(mbs, t, sensors, factors, configuration) -> list[float]:
    return [0.0]


def _held_nodes(scene: Scene) -> dict[str, set[str]]:
    """Nodes of each flexible body that need mesh points: those that carry something and deform, or take a load."""
    held: dict[str, set[str]] = {body.name: set() for body in scene.bodies}
    bodies = {body.name: body for body in scene.bodies}
    users = [(hinge.parent, hinge.parent_node) for hinge in scene.hinges if hinge.parent != GROUND]
    users += [(item.body, item.node) for item in (*scene.wheels, *scene.point_masses)]
    users += [(end.body, end.node) for closure in scene.closures for end in ends(closure) if end.body != GROUND]
    for name, node in users:
        if deforming(bodies[name], node):
            held[name].add(node)
    for load in scene.loads:
        if flexible(bodies[load.body]):
            held[load.body].add(load.node)
    return held


def _attach(
    shop: Workshop, scene: Scene, placed: dict[str, Placed], body: Body, hinge: Hinge, held: set[str]
) -> tuple[ExudynLink, Placed]:
    own = frame(hinge.parent_position_m, hinge.parent_quaternion)
    port = _end(shop, placed, hinge.parent, hinge.parent_node, own)
    outboard = frame(*node_frame(body, hinge.child_node)) @ frame(hinge.child_position_m, hinge.child_quaternion)
    zero = port.zero @ outboard.rotation.T
    point = np.zeros(3) if bends(body) else zero @ outboard.position  # a beam is held by its hub
    found: list[Placed] = []

    def make(hinge_motion: FrameMotion) -> Carrier:
        if bends(body):
            found.append(_beam(shop, body, hinge, hinge_motion))
            return _hub(shop, found[0], hinge, hinge_motion, port.zero)
        found.append(_place(shop, scene, body, hinge, hinge_motion, zero, held))
        return found[0].carrier

    first = next(iter(hinge.freedoms), None)
    match first:
        case Floating():
            make(across_quaternion(port.motion, first))
            link = joints.free(hinge.name)
        case None:
            link, _ = joints.weld(shop, hinge.name, port, make, point)
        case Ball():
            link, _ = joints.spherical(shop, hinge.name, first, port, make, point)
        case ScalarFreedom():
            link, _ = joints.chain(shop, hinge.name, port, _steps(hinge), make, point)
        case _:
            assert_never(first)
    return link, found[0]


def _steps(item: Hinge | Wheel | PointMass) -> list[tuple[Real, joints.Coordinate]]:
    """(axis in the carried hinge frame, coordinate) of every freedom, from the inboard side."""
    return [
        (_unit(freedom.axis), freedom.coordinate) for freedom in item.freedoms if isinstance(freedom, ScalarFreedom)
    ]


def _place(
    shop: Workshop, scene: Scene, body: Body, hinge: Hinge, hinge_motion: FrameMotion, zero: Real, held: set[str]
) -> Placed:
    """The carrier of a body, from the motion of its outboard hinge frame."""
    fixed = frame(hinge.child_position_m, hinge.child_quaternion).inverse()
    node_motion = hinge_motion.offset(fixed.position, fixed.rotation)
    if not flexible(body):
        node = frame(*node_frame(body, hinge.child_node)).inverse()
        motion = node_motion.offset(node.position, node.rotation)
        inertia = rest_inertia(body)
        return Placed(body, shop.rigid(motion, zero, inertia), motion)
    eta, rate = _modal_state(scene, body)
    motion = node_motion.body_of(AT_REST.node(node_shape(body, hinge.child_node, np.eye(3)), eta, rate))
    crosses, rows = {}, []
    for node in sorted(held):
        crosses[node] = list(range(4 * len(crosses), 4 * len(crosses) + 4))
        rows += _cross(node_shape(body, node, zero))
    rows = rows or _cross(NodeShape(np.zeros(3), np.eye(3), *np.zeros((2, 3, len(eta)))))
    carrier = shop.flexible(motion, zero, integrals(body, zero), eta, rate, rows)
    return Placed(body, carrier, motion, eta, rate, crosses, _reach(body))


def _beam(shop: Workshop, body: BeamBody, hinge: Hinge, hinge_motion: FrameMotion) -> Placed:
    """A beam of elements, unloaded, from the motion of its outboard hinge frame."""
    fixed = frame(*node_frame(body, hinge.child_node)) @ frame(hinge.child_position_m, hinge.child_quaternion)
    back = fixed.inverse()
    motion = hinge_motion.offset(back.position, back.rotation)
    beam = spatial_beam(shop, body, motion)
    return Placed(body, beam.carriers[0], motion, beam=beam)


def _hub(shop: Workshop, beam: Placed, hinge: Hinge, motion: FrameMotion, zero: Real) -> Carrier:
    """The outboard hinge frame as a massless carrier, welded to the beam's section: angles of hinges are measured
    between Exudyn axes, which are parallel where the coordinates vanish, and sections have axes of their own."""
    hub = shop.rigid(motion, zero, None)
    section = beam.at(hinge.child_node)
    shape, own = section.shape(hinge.child_node), frame(hinge.child_position_m, hinge.child_quaternion)
    markers = [
        shop.marker(section.carrier, shape.rotation @ own.position, shape.rotation @ own.rotation),
        shop.marker(hub, np.zeros(3), zero),
    ]
    shop.mbs.AddObject(shop.items.GenericJoint(markerNumbers=markers, constrainedAxes=[1] * 6))
    return hub


def _reach(body: ModalBody) -> Real:
    arrays = modal_arrays(body)
    length = np.linalg.norm(np.ptp(arrays.position, axis=0))
    return np.linalg.norm(arrays.translation_modes, axis=1).max(axis=0) / length


def _modal_state(scene: Scene, body: ModalBody) -> tuple[Real, Real]:
    count = modal_arrays(body).translation_modes.shape[2]
    for state in scene.modal_states:
        if state.body == body.name:
            return np.array(state.coordinates), np.array(state.rates or (0.0,) * count)
    return np.zeros(count), np.zeros(count)


def _cross(shape: NodeShape) -> list[Real]:
    """Four mesh points [position, modes] (3, 1+m) about a node, in its y-z plane, moving as its section does."""
    points = []
    for arm in (Y, Z, -Y, -Z):
        p = CROSS_ARM * (shape.rotation @ arm)
        moved = shape.translation + np.cross(shape.rotation_modes.T, p).T
        points.append(np.column_stack([shape.position + p, moved]))
    return points


def _port(shop: Workshop, parent: Placed, node: str, offset: Frame) -> HingePort:
    """An inboard hinge frame at a node of a placed body plus an offset; on a section carrier where the node deforms."""
    shape = parent.shape(node)
    zero = shape.rotation @ offset.rotation
    at_node = _exudyn_motion(parent).node(shape, parent.eta, parent.rate)
    motion = at_node.offset(offset.position, offset.rotation)
    if not shape.deforms:
        return HingePort(parent.carrier, shape.position + shape.rotation @ offset.position, zero, motion)
    section = shop.rigid(at_node, shape.rotation, None)
    markers = [_section_marker(shop, parent, node), shop.marker(section, np.zeros(3))]
    shop.mbs.AddObject(shop.items.GenericJoint(markerNumbers=markers, constrainedAxes=[1] * 6))
    return HingePort(section, shape.rotation @ offset.position, zero, motion)


def _exudyn_motion(parent: Placed) -> FrameMotion:
    return parent.motion.offset(np.zeros(3), parent.carrier.zero.T)


def _section_marker(shop: Workshop, parent: Placed, node: str) -> int:
    return shop.mbs.AddMarker(
        shop.items.MarkerSuperElementRigid(
            bodyNumber=parent.carrier.flexible, meshNodeNumbers=parent.crosses[node], weightingFactors=[0.25] * 4
        )
    )


def _closure(shop: Workshop, placed: dict[str, Placed], closure: Closure, kept: Sequence[int] | None) -> ExudynLink:
    """A joint between two frames that exist already."""
    ports = [_end(shop, placed, end.body, end.node, frame(end.position_m, end.quaternion)) for end in ends(closure)]
    return joints.closure(shop, closure.name, closure.type, ports, _unit(closure.axis), kept)


def _end(shop: Workshop, placed: dict[str, Placed], body: str, node: str, own: Frame) -> HingePort:
    """A frame `own` on the ground or at a node of a body."""
    if body == GROUND:
        return HingePort(shop.ground, own.position, own.rotation, AT_REST.offset(own.position, own.rotation))
    return _port(shop, placed[body].at(node), node, own)


def _connect(shop: Workshop, placed: dict[str, Placed], connector: BetweenNodes) -> None:
    """A connector between two frames that exist already."""
    still = NodeShape(np.zeros(3), np.eye(3), *np.zeros((2, 3, 0)))
    held = []
    for end in ends(connector):
        own = frame(end.position_m, end.quaternion)
        if end.body == GROUND:
            held.append(springs.ConnectorEnd(shop.ground, still, own))
        else:
            section = placed[end.body].at(end.node)
            held.append(springs.ConnectorEnd(section.carrier, section.shape(end.node), own))
    springs.between(shop, connector, held)


def _connect_along(shop: Workshop, scene: Scene, kinds: Sequence[dict[str, ExudynLink]]) -> None:
    """Connect along hinges; connectors on a link's last coordinate contribute to the load on its outboard body."""
    for _, item, number, load in along_hinges(scene):
        links = next(kind for kind in kinds if item in kind)
        link = links[item]
        spring = springs.along(shop, link.stages[number], load)
        if number == len(link.stages) - 1:
            links[item] = replace(link, connectors=(*link.connectors, (spring, False)))


def _wheel(shop: Workshop, parent: Placed, wheel: Wheel) -> tuple[ExudynLink, Carrier]:
    """A wheel as a body of its own on a revolute joint; friction and motor between it and its node."""
    port = _port(shop, parent, wheel.node, Frame(np.array(wheel.offset_m), np.eye(3)))
    inertia = Inertia(wheel.mass_kg, np.zeros(3), wheel_inertia(wheel))
    return joints.chain(
        shop, wheel.name, port, _steps(wheel), lambda motion: shop.rigid(motion, port.zero, inertia), np.zeros(3)
    )


def _point_mass(shop: Workshop, parent: Placed, mass: PointMass) -> tuple[ExudynLink, Carrier]:
    """A rigid body without rotary inertia, guided along the point mass's directions."""
    port = _port(shop, parent, mass.node, Frame(np.array(mass.offset_m), np.eye(3)))
    inertia = Inertia(mass.mass_kg, np.zeros(3), np.zeros((3, 3)))
    steps = _steps(mass)

    def make(motion: FrameMotion) -> Carrier:
        return shop.rigid(motion, port.zero, inertia)

    if not steps:
        return joints.weld(shop, mass.name, port, make, np.zeros(3))
    return joints.chain(shop, mass.name, port, steps, make, np.zeros(3))


def _load(shop: Workshop, parent: Placed, load: Load) -> None:
    f, direction = profile(load.function), np.array(load.direction)
    shape = parent.shape(load.node)
    turning = load.frame == "node"
    along = shape.rotation @ direction if turning else direction
    if load.node in parent.crosses:
        marker = _section_marker(shop, parent, load.node)
    else:
        marker = shop.marker(parent.carrier, shape.position)
    kind = shop.items.LoadForceVector if load.type == "force" else shop.items.LoadTorqueVector
    shop.mbs.AddLoad(
        kind(
            markerNumber=marker, loadVector=list(along), bodyFixed=turning,
            loadVectorUserFunction=along_axis(f, along),
        )
    )  # fmt: skip


def _unit(axis: tuple[float, float, float]) -> Real:
    vector = np.array(axis)
    return vector / np.linalg.norm(vector)
