"""Scenes that are symmetric under reflection: motion that starts in the plane of symmetry stays in it.

The plane is normal to an axis that World and all frames of the scene share. Bodies move in the plane, turn about its
normal only, and bend within it: of their inertia the part about the normal matters, and a torque along it is the same
in World and in body axes.
"""

from __future__ import annotations

from typing import assert_never

from flexmb.scene.bodies import BeamBody, Body, Matrix3, ModalBody, Quaternion, RigidBody, SidBody, Vector
from flexmb.scene.freedoms import Ball, Floating, Freedom, ScalarFreedom
from flexmb.scene.hinges import Closure, Hinge
from flexmb.scene.schema import Load, Scene, Wheel
from flexmb.scene.tree import ends

X, Y, Z = AXES = (0, 1, 2)
EPS = 1e-12
KNOWN = frozenset(
    ("name", "description", "allow", "gravity_m_s2", "bodies", "hinges", "closures", "wheels", "loads", "markers")
)


def mirrors(scene: Scene) -> tuple[int, ...]:
    """The axes (0, 1, 2 for x, y, z) of reflections under which the scene is symmetric, as far as the rules can
    tell."""
    if not only_known(scene):
        return ()
    return tuple(axis for axis in AXES if _is_own_image(scene, axis))


def only_known(scene: Scene) -> bool:
    """Whether the scene contains only items that the rules of symmetry and rest cover."""
    return not any(getattr(scene, key) for key in scene.__struct_fields__ if key not in KNOWN)


def within(vector: Vector, axis: int) -> bool:
    """Whether the vector has no component along the axis."""
    return abs(vector[axis]) <= EPS * max(map(abs, vector))


def along(vector: Vector, axis: int) -> bool:
    """Whether the vector has only a component along the axis."""
    return all(abs(vector[other]) <= EPS * max(map(abs, vector)) for other in AXES if other != axis)


def _is_own_image(scene: Scene, axis: int) -> bool:
    return (
        within(scene.gravity_m_s2, axis)
        and all(_body(body, axis, _mounted(scene, body.name)) for body in scene.bodies)
        and all(_hinge(hinge, axis) for hinge in scene.hinges)
        and all(_closure(closure, axis) for closure in scene.closures)
        and all(_wheel(wheel, axis) for wheel in scene.wheels)
        and all(_load(load, axis) for load in scene.loads)
    )


def _mounted(scene: Scene, body: str) -> set[str]:
    """The nodes of a body at which more than markers are."""
    carried: tuple[Wheel | Load, ...] = (*scene.wheels, *scene.loads)
    used = [(item.body, item.node) for item in carried]
    used += [
        end for hinge in scene.hinges for end in ((hinge.parent, hinge.parent_node), (hinge.child, hinge.child_node))
    ]
    used += [(end.body, end.node) for closure in scene.closures for end in ends(closure)]
    return {node for name, node in used if name == body}


def _body(body: Body, axis: int, mounted: set[str]) -> bool:
    """A beam is along x, symmetric about its section's axes."""
    match body:
        case RigidBody():
            nodes = [node for node in body.nodes if node.name in mounted]
            frames = all(within(node.position_m, axis) and _turned(node.quaternion, axis) for node in nodes)
            return frames and within(body.com_m, axis) and _inertia(body.inertia_kg_m2, axis)
        case BeamBody():
            lumps = all(within(mass.com_m, axis) and _inertia(mass.inertia_kg_m2, axis) for mass in body.tip_masses)
            return axis != X and lumps and all(_turned(node.quaternion, axis) for node in body.nodes)
        case ModalBody() | SidBody():
            return False
        case _:
            assert_never(body)


def _hinge(hinge: Hinge, axis: int) -> bool:
    frames = (
        within(hinge.parent_position_m, axis)
        and within(hinge.child_position_m, axis)
        and _turned(hinge.parent_quaternion, axis)
        and _turned(hinge.child_quaternion, axis)
    )
    return frames and all(_freedom(freedom, axis) for freedom in hinge.freedoms)


def _freedom(freedom: Freedom, axis: int) -> bool:
    """Turns about the mirror's normal and shifts across it stay in the plane; no screw does both."""
    match freedom:
        case ScalarFreedom():
            turns = not freedom.turns or along(freedom.axis, axis)
            return turns and (not freedom.shifts or within(freedom.axis, axis))
        case Ball():
            return _turned(freedom.quaternion, axis) and along(freedom.angular_velocity, axis)
        case Floating():
            place = within(freedom.position, axis) and _turned(freedom.quaternion, axis)
            return place and within(freedom.velocity, axis) and along(freedom.angular_velocity, axis)
        case _:
            assert_never(freedom)


def _closure(closure: Closure, axis: int) -> bool:
    frames = (
        within(closure.position_a_m, axis)
        and within(closure.position_b_m, axis)
        and _turned(closure.quaternion_a, axis)
        and _turned(closure.quaternion_b, axis)
    )
    match closure.type:
        case "weld" | "spherical":
            return frames
        case "revolute":
            return frames and along(closure.axis, axis)
        case "prismatic":
            return frames and within(closure.axis, axis)
        case "in_line" | "in_plane":
            return frames and (along(closure.axis, axis) or within(closure.axis, axis))
        case "cylindrical" | "universal" | "planar":
            return False
        case _:
            assert_never(closure.type)


def _wheel(wheel: Wheel, axis: int) -> bool:
    return along(wheel.axis, axis) and within(wheel.offset_m, axis)


def _load(load: Load, axis: int) -> bool:
    return within(load.direction, axis) if load.type == "force" else along(load.direction, axis)


def _turned(quaternion: Quaternion, axis: int) -> bool:
    """Whether a rotation is about the axis, or none at all."""
    return all(abs(quaternion[1 + other]) <= EPS for other in AXES if other != axis)


def _inertia(matrix: Matrix3, axis: int) -> bool:
    """Whether the axis is a principal axis of inertia."""
    return along(matrix[axis], axis)
