"""A scene as a robot of URDF, the format that both codes read: links, each on a joint of at most one freedom.

A link's frame is the outboard frame of its hinge, as `crosscheck.engines.links` has it, and as URDF wants it.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.engines.conventions import Frame
from crosscheck.engines.functions_of_time import profile
from crosscheck.engines.links import Link, Scalar, attachment, links, obstacle
from flexmb.scene.schema import Scene

WORLD = "world"


@dataclass(frozen=True)
class Moving:
    """A joint that moves: the number of its link and its freedom."""

    link: int
    freedom: Scalar


class Robot:
    """The links of a scene, the joints that move, in the order of their links, and the file."""

    def __init__(self, scene: Scene) -> None:
        self.links = links(scene)
        self.moving = [Moving(k, each) for k, link in enumerate(self.links) for each in link.freedoms]
        self.start = np.array([[each.freedom.value, each.freedom.rate] for each in self.moving]).reshape(-1, 2).T
        self.gravity = np.array(scene.gravity_m_s2, dtype=float)
        self.markers = {marker.name: attachment(scene, self.links, marker) for marker in scene.markers}
        self.urdf = _written(self.links)
        freedoms = [each.freedom for each in self.moving]
        self._springs = np.array([(f.stiffness, f.damping, f.rest) for f in freedoms]).reshape(-1, 3).T
        self._motors = [None if f.effort is None else profile(f.effort) for f in freedoms]

    def efforts(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """What springs, dampers and motors do along the joints (Nm, N)."""
        stiffness, damping, rest = self._springs
        motors = np.array([0.0 if motor is None else motor(t).value for motor in self._motors])
        return motors - stiffness * (q - rest) - damping * v

    def stored(self, q: np.ndarray) -> float:
        """The energy of springs (J)."""
        stiffness, _, rest = self._springs
        return float(0.5 * np.sum(stiffness * (q - rest) ** 2))


def beyond(scene: Scene, code: str) -> str:
    """Why a robot of URDF cannot represent the scene, "" if it can."""
    reason = obstacle(scene, code, ())
    if reason or scene.loads:
        return reason or f'load "{scene.loads[0].name}": this adapter of {code} has no loads at nodes'
    for link in links(scene):
        if len(link.freedoms) > 1 or not all(isinstance(each, Scalar) for each in link.freedoms):
            return f'"{link.joint}": this adapter of {code} has hinges of one freedom, revolute or prismatic'
        if any(each.prescribed is not None for each in link.freedoms):
            return f'"{link.joint}" is prescribed: this adapter of {code} drives no coordinate'
        if link.kind == "point mass" or link.inertia.mass <= 0.0:
            return f'"{link.name}": this adapter of {code} needs links with mass and extent'
    return ""


def joint_name(link: int) -> str:
    return f"joint {link}"


def link_name(link: int) -> str:
    return WORLD if link < 0 else f"link {link}"


def _written(chain: tuple[Link, ...]) -> str:
    """The text of the file. Inertias are given along their principal axes, which every reader takes alike."""
    robot = ElementTree.Element("robot", name="scene")
    ElementTree.SubElement(robot, "link", name=WORLD)
    for k, link in enumerate(chain):
        body = ElementTree.SubElement(robot, "link", name=link_name(k))
        inertial = ElementTree.SubElement(body, "inertial")
        moments, axes = np.linalg.eigh(link.inertia.inertia)
        axes = axes * np.linalg.det(axes)  # right-handed
        _place(inertial, Frame(link.inertia.com, axes))
        ElementTree.SubElement(inertial, "mass", value=_number(link.inertia.mass))
        products = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
        own = dict(zip(("ixx", "iyy", "izz"), map(_number, moments), strict=True))
        ElementTree.SubElement(inertial, "inertia", own | products)
        sort = {"turn": "continuous", "slide": "prismatic"}[link.freedoms[0].motion] if link.freedoms else "fixed"
        joint = ElementTree.SubElement(robot, "joint", name=joint_name(k), type=sort)
        _place(joint, link.inboard)
        ElementTree.SubElement(joint, "parent", link=link_name(link.parent))
        ElementTree.SubElement(joint, "child", link=link_name(k))
        for freedom in link.freedoms:
            ElementTree.SubElement(joint, "axis", xyz=_vector(freedom.axis))
        if sort == "prismatic":
            ElementTree.SubElement(joint, "limit", lower="-1e9", upper="1e9", effort="1e9", velocity="1e9")
    return ElementTree.tostring(robot, encoding="unicode")


def _place(element: ElementTree.Element, at: Frame) -> None:
    """The pose, with the angles about fixed x, y, z that URDF takes."""
    angles = Rotation.from_matrix(at.rotation).as_euler("xyz")
    ElementTree.SubElement(element, "origin", xyz=_vector(at.position), rpy=_vector(angles))


def _vector(values: np.ndarray) -> str:
    return " ".join(map(_number, values))


def _number(value: float) -> str:
    return repr(float(value))
