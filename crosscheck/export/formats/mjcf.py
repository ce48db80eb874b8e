"""A rigid tree as MJCF: links, inertia, joints with their springs and dampers, gravity, markers and the initial state.

One body a link, with its elementary joints at its origin; free flight is three slides and a ball, which serve on any
parent. Closures are refused: MuJoCo's equality constraints are soft. So are bodies whose inertia MuJoCo does not take
(`LEAST`): raising it would be another body.
"""

from __future__ import annotations

from typing import assert_never
from xml.etree import ElementTree

import numpy as np

from crosscheck.engines.conventions import Frame, quaternion_of, rotation_matrix
from crosscheck.engines.links import Ball, Floating, Freedom, Link, Scalar, attachment
from crosscheck.export.formats.urdf import joint_name, link_name
from crosscheck.export.formats.written import Written, beside_the_tree, chain_of, number, vector
from flexmb.scene.schema import Scene
from flexmb.typing import Real

DEEPEST = 400
"""Bodies are nested, and MuJoCo's XML parser gives up at a depth of 500 elements."""
LEAST = 1e-14
"""MuJoCo refuses masses and principal moments of inertia of moving bodies below 1e-15 (kg, kg m^2)."""


def mjcf(scene: Scene, name: str) -> Written:
    """The scene as MJCF, if it is a rigid tree without screws whose bodies MuJoCo takes."""
    chain, why = chain_of(scene, "MJCF")
    why = why or _too_small(chain) or _too_deep(chain)
    if why:
        return Written(refused=why)
    root = ElementTree.Element("mujoco", model=name)
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="false", inertiafromgeom="false")
    option = ElementTree.SubElement(root, "option", gravity=vector(scene.gravity_m_s2), integrator="RK4")
    ElementTree.SubElement(option, "flag", contact="disable", autoreset="disable")
    elements = [ElementTree.SubElement(root, "worldbody")]
    for link in chain:  # parents come before children
        elements.append(_body(elements[link.parent + 1], link))
    for marker in scene.markers:
        at = attachment(scene, chain, marker)
        _placed(ElementTree.SubElement(elements[at.link + 1], "site", name=marker.name), at.frame)
    freedoms = [freedom for link in chain for freedom in link.freedoms]
    if freedoms:
        key = ElementTree.SubElement(ElementTree.SubElement(root, "keyframe"), "key", name="start")
        key.set("qpos", vector(np.concatenate([_start(freedom)[0] for freedom in freedoms])))
        key.set("qvel", vector(np.concatenate([_start(freedom)[1] for freedom in freedoms])))
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
    return Written(text, left_out=beside_the_tree(scene))


def _too_small(chain: tuple[Link, ...]) -> str:
    """Why MuJoCo would not take one of the bodies that move."""
    moves: list[bool] = []
    for link in chain:
        moves.append(bool(link.freedoms) or (link.parent >= 0 and moves[link.parent]))
        least = min(float(np.linalg.eigvalsh(link.inertia.inertia)[0]), link.inertia.mass)
        if moves[-1] and least < LEAST:
            return f'{link.kind} "{link.name}" has no mass, or no inertia about one of its axes, which MuJoCo refuses'
    return ""


def _too_deep(chain: tuple[Link, ...]) -> str:
    """Why MuJoCo could not read the nested elements."""
    depths: list[int] = []
    for link in chain:
        depths.append(1 if link.parent < 0 else depths[link.parent] + 1)
    deepest = max(depths, default=0)
    return f"{deepest} bodies hang on each other, and MuJoCo's reader takes no {DEEPEST}" if deepest >= DEEPEST else ""


def _body(parent: ElementTree.Element, link: Link) -> ElementTree.Element:
    body = ElementTree.SubElement(parent, "body", name=link_name(link))
    _placed(body, link.inboard)
    moments, axes = principal(link.inertia.inertia)
    inertial = ElementTree.SubElement(body, "inertial", mass=number(link.inertia.mass), pos=vector(link.inertia.com))
    inertial.set("diaginertia", vector(moments))
    inertial.set("quat", vector(quaternion_of(axes)))
    for place, freedom in enumerate(link.freedoms):
        _joints(body, freedom, joint_name(link, place))
    return body


def principal(inertia: Real) -> tuple[Real, Real]:
    """Principal moments (3,) and right-handed axes (3,3) as columns. A flat body's moments miss the triangle inequality
    by rounding, for which MuJoCo would refuse them: the largest is at most the sum of the others."""
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    if moments[0] + moments[1] < moments[2] < (moments[0] + moments[1]) * (1.0 + 1e-12):
        moments[2] = moments[0] + moments[1]
    return moments, axes


def _placed(element: ElementTree.Element, frame: Frame) -> None:
    element.set("pos", vector(frame.position))
    element.set("quat", vector(frame.quaternion))


def _joints(body: ElementTree.Element, freedom: Freedom, name: str) -> None:
    match freedom:
        case Scalar(motion="turn"):
            _scalar(body, freedom, name, "hinge")
        case Scalar(motion="slide"):
            _scalar(body, freedom, name, "slide")
        case Scalar():
            raise NotImplementedError("a screw joint, which `chain_of` refuses, has reached the writer")
        case Ball():
            joint = ElementTree.SubElement(body, "joint", name=name, type="ball", stiffness=number(freedom.stiffness))
            joint.set("damping", number(freedom.damping))
        case Floating():
            for axis, letter in zip(np.eye(3), "xyz", strict=True):
                ElementTree.SubElement(body, "joint", name=f"{name} {letter}", type="slide", axis=vector(axis))
            ElementTree.SubElement(body, "joint", name=name, type="ball")
        case _:
            assert_never(freedom)


def _scalar(body: ElementTree.Element, freedom: Scalar, name: str, kind: str) -> None:
    joint = ElementTree.SubElement(body, "joint", name=name, type=kind, axis=vector(freedom.axis))
    joint.set("stiffness", number(freedom.stiffness))
    joint.set("springref", number(freedom.rest))
    joint.set("damping", number(freedom.damping))


def _start(freedom: Freedom) -> tuple[list[float], list[float]]:
    """qpos and qvel of a freedom at the start."""
    match freedom:
        case Scalar():
            return [freedom.value], [freedom.rate]
        case Ball():
            return list(freedom.quaternion), list(freedom.angular_velocity)
        case Floating():
            linear = rotation_matrix(freedom.quaternion) @ freedom.velocity
            return [*freedom.position, *freedom.quaternion], [*linear, *freedom.angular_velocity]
        case _:
            assert_never(freedom)
