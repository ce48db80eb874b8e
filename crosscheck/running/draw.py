"""How to draw a scene from its markers: every drawn point is a marker plus a fixed offset in the marker's axes.

Rigid bodies become the box with the same mass and inertia, carried by any marker on the body; flexible bodies a line
through their markers in order along the body; wheels become circles. Markers are all that runs record, so that drawing
needs no mechanics; bodies without a marker are not drawn.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.records.drawing import CarriedPoint, Drawing, Line
from flexmb.scene.bodies import Body, RigidBody, Vector
from flexmb.scene.schema import Marker, Scene, Wheel
from flexmb.scene.tree import GROUND, node_frame
from flexmb.typing import Real

LARGEST_ASPECT = 12.0
RIM_POINTS = 24


def draw(scene: Scene) -> Drawing:
    """Lines of every body and wheel that has a marker to carry it."""
    lines: list[Line] = []
    for body in scene.bodies:
        markers = [marker for marker in scene.markers if marker.body == body.name]
        if not markers:
            continue
        if isinstance(body, RigidBody):
            lines += _rigid(scene, body, markers[0])
        else:
            lines.append(_flexible(scene, body, markers))
    return Drawing(lines=tuple(lines), trails=tuple(marker.name for marker in scene.markers))


def _rigid(scene: Scene, body: RigidBody, marker: Marker) -> list[Line]:
    """Box of equal inertia, arms from the mass centre to the hinges, wheels as circles."""
    position, rotation = _pose(body, marker)

    def carried(point: Real) -> CarriedPoint:
        return CarriedPoint(marker.name, _vector(rotation.inv().apply(point - position)))

    com = np.array(body.com_m)
    lines = [Line(body=body.name, kind="box", points=tuple(map(carried, edge))) for edge in _box_edges(body)]
    for joint in _hinge_points(scene, body):
        lines.append(Line(body=body.name, kind="arm", points=(carried(com), carried(joint))))
    for wheel in scene.wheels:
        if wheel.body == body.name:
            lines.append(Line(body=body.name, kind="wheel", points=tuple(map(carried, _rim(body, wheel)))))
    return lines


def _flexible(scene: Scene, body: Body, markers: list[Marker]) -> Line:
    """Line through the body's markers by distance from its origin, starting at the inboard hinge if that is carried."""
    placed = sorted(markers, key=lambda marker: float(np.linalg.norm(_pose(body, marker)[0])))
    points = [CarriedPoint(marker.name, (0.0, 0.0, 0.0)) for marker in placed]
    root = _root_point(scene, body)
    if root is not None and np.linalg.norm(_pose(body, placed[0])[0]) > 0.0:
        points.insert(0, root)
    return Line(body=body.name, kind="beam", points=tuple(points))


def _root_point(scene: Scene, body: Body) -> CarriedPoint | None:
    """The inboard hinge point of a flexible body, carried by the World or by a rigid parent's marker."""
    hinge = next(hinge for hinge in scene.hinges if hinge.child == body.name)
    if hinge.parent == GROUND:
        return CarriedPoint("", hinge.parent_position_m)
    parent = next(each for each in scene.bodies if each.name == hinge.parent)
    marker = next((each for each in scene.markers if each.body == hinge.parent), None)
    if marker is None or not isinstance(parent, RigidBody):
        return None
    position, rotation = _pose(parent, marker)
    point = _node_point(parent, hinge.parent_node, hinge.parent_position_m)
    return CarriedPoint(marker.name, _vector(rotation.inv().apply(point - position)))


def _box_edges(body: RigidBody) -> list[tuple[Real, Real]]:
    """Twelve edges of the uniform box with the body's mass and principal inertias, in the body frame.

    Sides from I_x = m (b^2 + c^2)/12 and so on: a^2 = 6 (I_y + I_z - I_x)/m. Sides are kept within `LARGEST_ASPECT` so
    that a body of no width is still seen.
    """
    moments, axes = np.linalg.eigh(np.array(body.inertia_kg_m2))
    squares = 6.0 * (moments.sum() - 2.0 * moments) / max(body.mass_kg, np.finfo(float).tiny)
    sides = np.sqrt(np.maximum(squares, 0.0))
    sides = np.maximum(sides, sides.max(initial=0.0) / LARGEST_ASPECT)
    signs = [np.array(each) * 2 - 1 for each in np.ndindex(2, 2, 2)]
    corners = [np.array(body.com_m) + axes @ (0.5 * sides * sign) for sign in signs]
    neighbours = [(i, j) for i in range(8) for j in range(i + 1, 8) if np.sum(signs[i] != signs[j]) == 1]
    return [(corners[i], corners[j]) for i, j in neighbours]


def _hinge_points(scene: Scene, body: RigidBody) -> list[Real]:
    """Hinge points of the body, in the body frame."""
    points = []
    for hinge in scene.hinges:
        if hinge.child == body.name:
            points.append(_node_point(body, hinge.child_node, hinge.child_position_m))
        elif hinge.parent == body.name:
            points.append(_node_point(body, hinge.parent_node, hinge.parent_position_m))
    return points


def _rim(body: RigidBody, wheel: Wheel) -> list[Real]:
    """Closed circle of the disc with the wheel's mass and axial inertia, r^2 = 2 J/m, in the body frame."""
    frame = node_frame(body, wheel.node)
    turn = _rotation(frame.quaternion)
    axis = turn.apply(np.array(wheel.axis) / np.linalg.norm(wheel.axis))
    centre = _node_point(body, wheel.node, wheel.offset_m)
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first *= np.sqrt(2.0 * wheel.axial_inertia_kg_m2 / wheel.mass_kg) / np.linalg.norm(first)
    second = np.cross(axis, first)
    angles = np.linspace(0.0, 2.0 * np.pi, RIM_POINTS + 1)
    return [centre + np.cos(angle) * first + np.sin(angle) * second for angle in angles]


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


