"""The drawing of a scene: every drawn point is a marker plus a fixed offset in the marker's axes.

A rigid body is drawn as the box of the same mass and inertia, or as a ball if it has no inertia; a beam as a bent bar
with the widths of its sections; another flexible body as a surface between its nodes with markers, or a line through
them; wheels as discs, fixed point masses as balls, springs as coils, bushings and springs of hinges as marks. Only
markers are recorded, so that drawing needs no mechanics; bodies without a marker are not drawn. `film.py` adds the
markers that each body needs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import assert_never

import msgspec
import numpy as np
from scipy.spatial import ConvexHull, Delaunay
from scipy.spatial.transform import Rotation

from flexmb.scene.bodies import ZERO, BeamBody, BeamStation, Body, ModalBody, RigidBody, SidBody, Vector
from flexmb.scene.check.profiles import start_of
from flexmb.scene.connectors import BetweenNodes, HingeSpring
from flexmb.scene.rest_curve import rest_sections
from flexmb.scene.schema import Marker, Scene, Wheel
from flexmb.scene.sections import ABOUT_Y, ABOUT_Z, EXTENSION
from flexmb.scene.tree import GROUND, ends, node_frame, nodes_along
from flexmb.typing import Real
from flexmb.view.drawing import CarriedPoint, Drawing, DrawnWheel, Line

LARGEST_ASPECT = 12.0
FLAT = 1e-3  # extent of points in a direction, over their largest, below which they span none
THINNEST_WHEEL = 0.1  # least drawn width of a wheel over its radius


def draw(scene: Scene, trails: Sequence[str] | None = None) -> Drawing:
    """Lines of every body and wheel with a marker; `trails` names markers, by default all."""
    lines: list[Line] = []
    wheels: list[DrawnWheel] = []
    for body in scene.bodies:
        markers = [marker for marker in scene.markers if marker.body == body.name]
        if not markers:
            continue
        match body:
            case RigidBody():
                lines += _rigid(scene, body, markers[0])
            case BeamBody():
                lines.append(_beam(scene, body, markers))
            case ModalBody() | SidBody():
                lines.append(_flexible(scene, body, markers))
            case _:
                assert_never(body)
        for wheel in scene.wheels:
            marker = next((marker for marker in markers if _turns_with(body, marker, wheel)), None)
            if wheel.body == body.name and marker is not None:
                wheels.append(_wheel(body, wheel, marker))
    lines += _masses(scene)
    lines += _connectors(scene)
    names = tuple(marker.name for marker in scene.markers) if trails is None else tuple(trails)
    return Drawing(lines=tuple(lines), trails=names, wheels=tuple(wheels), gravity=scene.gravity_m_s2)


def _rigid(scene: Scene, body: RigidBody, marker: Marker) -> list[Line]:
    """The box of equal inertia, and arms from the mass centre to the joints of the body."""
    position, rotation = _pose(body, marker)

    def fixed(point: Real) -> CarriedPoint:
        return CarriedPoint(marker.name, _vector(rotation.inv().apply(point - position)))

    com = np.array(body.com_m)
    if np.any(body.inertia_kg_m2):
        lines = [Line(body=body.name, kind="solid", points=tuple(map(fixed, _corners(body))))]
    else:
        lines = [Line(body=body.name, kind="ball", points=(fixed(com),))] if body.mass_kg else []
    for joint in _joints(scene, body):
        if np.any(joint != com):
            lines.append(Line(body=body.name, kind="arm", points=(fixed(com), fixed(joint))))
    return lines


def _masses(scene: Scene) -> list[Line]:
    """Fixed point masses; moving ones are bodies in a film."""
    lines = []
    for mass in scene.point_masses:
        point = None if mass.directions else carried(scene, mass.body, mass.node, mass.offset_m)
        if point is not None:
            lines.append(Line(body=mass.name, kind="ball", points=(point,)))
    return lines


def _connectors(scene: Scene) -> list[Line]:
    """Connectors between nodes, and springs along hinges at the hinge points."""
    lines = []
    for connector in scene.connectors:
        kind, points = "mount", []
        if isinstance(connector, BetweenNodes):
            kind = "mount" if hasattr(connector, "quaternion_a") else "spring"  # between frames or between points
            points = [carried(scene, end.body, end.node, end.position_m) for end in ends(connector)]
        elif isinstance(connector, HingeSpring):
            hinges = [hinge for hinge in scene.hinges if hinge.name == connector.hinge]
            points = [carried(scene, hinge.child, hinge.child_node, hinge.child_position_m) for hinge in hinges]
        seen = tuple(point for point in points if point is not None)
        if seen and len(seen) == len(points):
            lines.append(Line(body=connector.name, kind=kind, points=seen))
    return lines


def carried(scene: Scene, body: str, node: str, offset: Vector) -> CarriedPoint | None:
    """A point at a node of a body or of the ground; None if no marker moves with it."""
    if body == GROUND:
        return CarriedPoint("", offset)
    own = next(candidate for candidate in scene.bodies if candidate.name == body)
    markers = [marker for marker in scene.markers if marker.body == body]
    marker = next((marker for marker in markers if isinstance(own, RigidBody) or marker.node == node), None)
    if marker is None:
        return None
    position, rotation = _pose(own, marker)
    return CarriedPoint(marker.name, _vector(rotation.inv().apply(_node_point(own, node, offset) - position)))


def _beam(scene: Scene, body: BeamBody, markers: list[Marker]) -> Line:
    """A line through the beam's nodes with markers in their order along it, with the tangents of its axis and the
    rectangles of its sections."""
    nodes, along = _by_node(markers), nodes_along(body)
    placed = sorted(nodes.values(), key=lambda marker: along[marker.node])
    x = np.array([along[marker.node] for marker in placed])
    turns = rest_sections(body, x)[1]
    line = _bent(scene, body, placed, turns[:, :, 0])
    across = [_turned_back(body, marker, y) for marker, y in zip(placed, turns[:, :, 1], strict=True)]
    widths = [(float(y), float(z)) for y, z in _widths(body, x)]
    missing = len(line.points) - len(across)  # the inboard hinge, which has no marker of the beam
    return msgspec.structs.replace(
        line, across=(*across[:1] * missing, *across), widths=(*widths[:1] * missing, *widths)
    )


def _widths(body: BeamBody, x: Real) -> Real:
    """Widths (n,2) m along y and z of the homogeneous rectangles with the bending and axial stiffness of the sections:
    EIz/EA = b_y^2/12, EIy/EA = b_z^2/12."""
    stations = sorted(body.stations, key=lambda station: station.x_m)
    places = [station.x_m for station in stations]
    squares = np.array([12.0 * np.array(_bending_over_axial(station)) for station in stations])
    return np.sqrt(np.stack([np.interp(x, places, column) for column in squares.T], axis=1))


def _bending_over_axial(station: BeamStation) -> tuple[float, float]:
    """EIz/EA and EIy/EA (m^2) of a station."""
    if station.stiffness is None:
        return station.EIz_Nm2 / station.EA_N, station.EIy_Nm2 / station.EA_N  # type: ignore[operator]
    K = np.array(station.stiffness)
    return K[ABOUT_Z, ABOUT_Z] / K[EXTENSION, EXTENSION], K[ABOUT_Y, ABOUT_Y] / K[EXTENSION, EXTENSION]


def _flexible(scene: Scene, body: ModalBody | SidBody, markers: list[Marker]) -> Line:
    """The nodes of a body: a surface between them where they span one, else a line through them in the order of their
    distance from its origin."""
    nodes = _by_node(markers)
    placed = sorted(nodes.values(), key=lambda marker: float(np.linalg.norm(_node_point(body, marker.node, ZERO))))
    rest = np.array([_node_point(body, marker.node, ZERO) for marker in placed])
    faces = _faces(rest)
    if faces:
        points = tuple(CarriedPoint(marker.name, _vector(-np.array(marker.offset_m))) for marker in placed)
        return Line(body=body.name, kind="sheet", points=points, faces=faces)
    from_root = _root_point(scene, body) is not None and float(np.linalg.norm(rest[0])) > 0.0
    along = np.vstack([np.zeros(3), rest]) if from_root else rest
    return _bent(scene, body, placed, _directions(along)[-len(placed) :])


def _faces(points: Real) -> tuple[tuple[int, int, int], ...]:
    """Triangles between points (n,3): of their plane, or of their hull where they are in none; none on a line."""
    middle = points - points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(middle, full_matrices=False)
    spanned = int(np.sum(sizes > FLAT * sizes[0])) if len(points) > 2 else 1
    if spanned < 2:
        return ()
    found = Delaunay(middle @ axes[:2].T) if spanned == 2 else ConvexHull(points)
    return tuple((int(a), int(b), int(c)) for a, b, c in found.simplices)


def _by_node(markers: list[Marker]) -> dict[str, Marker]:
    """The first marker of each node."""
    return {marker.node: marker for marker in reversed(markers)}


def _bent(scene: Scene, body: Body, placed: list[Marker], tangents: Real) -> Line:
    """The line through markers, with tangents (n,3) in the body frame at rest; it begins at the inboard hinge if a
    marker carries that and no node is there."""
    root = _root_point(scene, body)
    from_root = float(np.linalg.norm(_node_point(body, placed[0].node, ZERO))) > 0.0
    points = [
        CarriedPoint(marker.name, _vector(-np.array(marker.offset_m)), _turned_back(body, marker, way))
        for marker, way in zip(placed, tangents, strict=True)
    ]
    return Line(body=body.name, kind="beam", points=(*([root] if root and from_root else []), *points))


def _turned_back(body: Body, marker: Marker, way: Real) -> Vector:
    """A direction in the body frame at rest, in the axes of a marker."""
    return _vector(_pose(body, marker)[1].inv().apply(way))


def _directions(points: Real) -> Real:
    """Unit tangents (n,3) of a line through points (n,3), by differences; zero for a single point."""
    if len(points) < 2:
        return np.zeros_like(points)
    ways = np.gradient(points, axis=0)
    return ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), np.finfo(float).tiny)


def _root_point(scene: Scene, body: Body) -> CarriedPoint | None:
    """The inboard hinge point of a flexible body, carried by the World or by a rigid parent's marker."""
    hinge = next(hinge for hinge in scene.hinges if hinge.child == body.name)
    if hinge.parent == GROUND:
        return CarriedPoint("", hinge.parent_position_m)
    if not isinstance(next(body for body in scene.bodies if body.name == hinge.parent), RigidBody):
        return None
    return carried(scene, hinge.parent, hinge.parent_node, hinge.parent_position_m)


def _corners(body: RigidBody) -> list[Real]:
    """Corners of the uniform box with the body's mass and principal inertias, in the body frame.

    Sides from I_x = m (b^2 + c^2)/12 and so on: a^2 = 6 (I_y + I_z - I_x)/m. Their ratio is limited by
    `LARGEST_ASPECT`, so that a thin body is visible."""
    moments, axes = np.linalg.eigh(np.array(body.inertia_kg_m2))
    squares = 6.0 * (moments.sum() - 2.0 * moments) / max(body.mass_kg, np.finfo(float).tiny)
    sides = np.sqrt(np.maximum(squares, 0.0))
    sides = np.maximum(sides, sides.max(initial=0.0) / LARGEST_ASPECT)
    signs = [np.array(corner) * 2 - 1 for corner in np.ndindex(2, 2, 2)]
    return [np.array(body.com_m) + axes @ (0.5 * sides * sign) for sign in signs]


def _joints(scene: Scene, body: RigidBody) -> list[Real]:
    """Points at which hinges, closures and connectors join the body to others, in the body frame."""
    points = []
    for hinge in scene.hinges:
        if hinge.child == body.name:
            points.append(_node_point(body, hinge.child_node, hinge.child_position_m))
        elif hinge.parent == body.name:
            points.append(_node_point(body, hinge.parent_node, hinge.parent_position_m))
    for each in (
        *scene.closures,
        *(connector for connector in scene.connectors if isinstance(connector, BetweenNodes)),
    ):
        own = [_node_point(body, end.node, end.position_m) for end in ends(each) if end.body == body.name]
        points += own[:1]  # what joins two points of the body counts at its first
    return points


def _turns_with(body: Body, marker: Marker, wheel: Wheel) -> bool:
    """Whether a marker of the body moves with the node of a wheel on the body."""
    return isinstance(body, RigidBody) or marker.node == wheel.node


def _wheel(body: Body, wheel: Wheel, marker: Marker) -> DrawnWheel:
    """The disc with the wheel's mass and inertias: r^2 = 2 J/m, and width^2 = 12 (J_t - J/2)/m."""
    position, rotation = _pose(body, marker)
    axis = _rotation(node_frame(body, wheel.node).quaternion).apply(np.array(wheel.axis) / np.linalg.norm(wheel.axis))
    radius = float(np.sqrt(2.0 * wheel.axial_inertia_kg_m2 / wheel.mass_kg))
    spin = None if wheel.prescribed_rad is None else start_of(wheel.prescribed_rad)
    width = 12.0 * (wheel.transverse_inertia_kg_m2 - wheel.axial_inertia_kg_m2 / 2.0) / wheel.mass_kg
    return DrawnWheel(
        name=wheel.name,
        marker=marker.name,
        centre=_vector(rotation.inv().apply(_node_point(body, wheel.node, wheel.offset_m) - position)),
        axis=_vector(rotation.inv().apply(axis)),
        radius_m=radius,
        width_m=max(float(np.sqrt(max(width, 0.0))), THINNEST_WHEEL * radius),
        axial_inertia_kg_m2=wheel.axial_inertia_kg_m2,
        speed_rad_s=wheel.speed_rad_s if spin is None else spin[1],
        angle_rad=wheel.angle_rad if spin is None else spin[0],
    )


def _node_point(body: Body, node: str, offset: Vector) -> Real:
    """A node plus an offset in node axes, in the body frame at rest."""
    frame = node_frame(body, node)
    return np.array(frame.position) + _rotation(frame.quaternion).apply(np.array(offset))


def _pose(body: Body, marker: Marker) -> tuple[Real, Rotation]:
    """Rest position and rotation of a marker in its body's frame."""
    return _node_point(body, marker.node, marker.offset_m), _rotation(node_frame(body, marker.node).quaternion)


def _rotation(quaternion: tuple[float, float, float, float]) -> Rotation:
    return Rotation.from_quat(np.array(quaternion)[[1, 2, 3, 0]])


def _vector(values: Real) -> Vector:
    return (float(values[0]), float(values[1]), float(values[2]))
