"""A rigid tree as URDF: links, inertia, joints. It says no gravity, no state and nothing that acts on the tree.

A hinge of several freedoms is as many joints with links without inertia between them; a wheel or a moving point mass is
a link of its own. A link's frame is the outboard frame of its hinge, as URDF has it. Ball joints and screws, which the
format does not know, are refused; three turns in their place would be other coordinates, with a singularity.
"""

from __future__ import annotations

from math import atan2, hypot
from typing import assert_never
from xml.etree import ElementTree

from crosscheck.engines.conventions import IDENTITY_FRAME, Frame
from crosscheck.engines.links import Ball, Floating, Freedom, Link, Scalar
from crosscheck.export.formats.written import Written, beside_the_tree, chain_of, number, springs, vector
from flexmb.scene.schema import Scene
from flexmb.typing import Real

WORLD = "world"
NOT_IN_URDF = ("gravity", "the initial state", "markers")


def urdf(scene: Scene, name: str) -> Written:
    """The scene as URDF, if it is a rigid tree of turns, slides and free flights."""
    chain, why = chain_of(scene, "URDF")
    for link in chain:
        if any(isinstance(freedom, Ball) for freedom in link.freedoms):
            why = why or f'hinge "{link.joint}" is a ball joint, which URDF does not know'
    if why:
        return Written(refused=why)
    robot = ElementTree.Element("robot", name=name)
    ElementTree.SubElement(robot, "link", name=WORLD)
    for link in chain:
        parent = link_name(chain[link.parent]) if link.parent >= 0 else WORLD
        _add(robot, link, parent)
    ElementTree.indent(robot)
    text = ElementTree.tostring(robot, encoding="unicode", xml_declaration=True) + "\n"
    return Written(text, left_out=(*NOT_IN_URDF, *springs(chain), *beside_the_tree(scene)))


def link_name(link: Link) -> str:
    """Names of bodies, wheels and point masses are kept apart."""
    return f"{link.kind} {link.name}"


def joint_name(link: Link, place: int) -> str:
    """The name of the joint of a link's freedom; of a weld the first and only one."""
    return f"{link.kind} {link.joint} {place}"


def _add(robot: ElementTree.Element, link: Link, parent: str) -> None:
    freedoms: tuple[Freedom | None, ...] = link.freedoms or (None,)
    for place, freedom in enumerate(freedoms):
        last = place == len(freedoms) - 1
        child = link_name(link) if last else f"{link_name(link)} between {place}"
        element = ElementTree.SubElement(robot, "link", name=child)
        if last and link.inertia.mass > 0.0:
            _inertial(element, link)
        kind, axis = _kind(freedom)
        joint = ElementTree.SubElement(robot, "joint", name=joint_name(link, place), type=kind)
        _origin(joint, link.inboard if place == 0 else IDENTITY_FRAME)
        ElementTree.SubElement(joint, "parent", link=parent)
        ElementTree.SubElement(joint, "child", link=child)
        if axis is not None:
            ElementTree.SubElement(joint, "axis", xyz=vector(axis))
        if kind == "prismatic":  # the format wants limits of a slide; these are far away
            ElementTree.SubElement(joint, "limit", lower="-1e9", upper="1e9", effort="1e9", velocity="1e9")
        parent = child


def _kind(freedom: Freedom | None) -> tuple[str, Real | None]:
    """URDF's type of joint, and its axis."""
    match freedom:
        case None:
            return "fixed", None
        case Scalar(motion="turn", axis=axis):
            return "continuous", axis
        case Scalar(motion="slide", axis=axis):
            return "prismatic", axis
        case Floating():
            return "floating", None
        case Scalar() | Ball():
            raise NotImplementedError("a screw or a ball joint, which `urdf` refuses, has reached the writer")
        case _:
            assert_never(freedom)


def _inertial(element: ElementTree.Element, link: Link) -> None:
    inertial = ElementTree.SubElement(element, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=vector(link.inertia.com), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=number(link.inertia.mass))
    J = link.inertia.inertia
    places = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ElementTree.SubElement(inertial, "inertia", {key: number(J[place]) for key, place in places.items()})


def _origin(joint: ElementTree.Element, frame: Frame) -> None:
    R = frame.rotation
    across = hypot(R[0, 0], R[1, 0])
    pitch = atan2(-R[2, 0], across)
    if across > 1e-9:
        roll, yaw = atan2(R[2, 1], R[2, 2]), atan2(R[1, 0], R[0, 0])
    else:  # x points up or down: roll and yaw turn about one axis
        roll, yaw = atan2(-R[1, 2], R[1, 1]), 0.0
    ElementTree.SubElement(joint, "origin", xyz=vector(frame.position), rpy=vector((roll, pitch, yaw)))
