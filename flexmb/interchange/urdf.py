"""Import of URDF files: links become bodies, and joints become hinges with the same names.

They are read by Python's XML parser, with checks of all mechanical elements. The usual URDF parsers replace invalid
data by defaults, and the best maintained one depends on twenty packages for meshes, which scenes do not have.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np
from numpy.typing import ArrayLike

from flexmb.interchange.imported import (
    SMOOTH,
    STOPS,
    ImportedScene,
    JointConnectors,
    ModelError,
    listed,
    naming,
    possible_inertia,
    usable,
)
from flexmb.scene.build import SceneBuilder
from flexmb.scene.collecting import Placement
from flexmb.scene.problems import Defect, SceneError, closest
from flexmb.scene.quaternions import about, quaternion_of
from flexmb.scene.reading import Unreadable, read_text
from flexmb.scene.rounding import PRINTED, ROUNDING
from flexmb.scene.tree import GROUND
from flexmb.typing import Real

SCALAR = ("revolute", "continuous", "prismatic")
"""Types of joints that have one coordinate."""

Fail = Callable[[str, str, str], NoReturn]
"""Raises the error for a place, what is wrong there and the remedy."""


@dataclass(frozen=True)
class Mimic:
    """What a joint mimics; in rad or m of the joint itself, and of the other one."""

    joint: str
    other: str
    multiplier: float
    offset: float


class Mimics:
    """The mimic joints of a robot, by name."""

    def __init__(self, joints: Mapping[str, ElementTree.Element], fail: Fail) -> None:
        self._joints, self._fail = joints, fail
        self._of: dict[str, Mimic] = {}
        for name, joint in joints.items():
            element = joint.find("mimic")
            if element is not None and joint.get("type") != "fixed":
                self._of[name] = self._mimic(name, element)
        self._values = {name: self._value(name) for name in self._of}

    @property
    def on_fixed(self) -> list[str]:
        """Fixed joints that are said to mimic others: they have no coordinate that could."""
        return [name for name, joint in self._joints.items()
                if joint.find("mimic") is not None and joint.get("type") == "fixed"]  # fmt: skip

    def value(self, joint: str) -> float:
        """The coordinate of a joint where those that mimic none are zero."""
        return self._values.get(joint, 0.0)

    def couple(self, builder: SceneBuilder) -> None:
        """Add the couplings, named after the joints that they lead."""
        taken = set(self._joints)
        for relation in self._of.values():
            name = next(
                name for name in (f"{relation.joint}.mimic{end}" for end in ("", *range(99))) if name not in taken
            )
            builder.coupling(name, relation.joint, {relation.other: relation.multiplier}, offset=relation.offset)

    def _mimic(self, name: str, element: ElementTree.Element) -> Mimic:
        place, other = f'joint "{name}"', element.get("joint", "")
        if other not in self._joints:
            self._fail(place, f'it mimics "{other}", which is not a joint', closest(other, self._joints))
        for joint in (name, other):
            kind = self._joints[joint].get("type", "")
            if kind not in SCALAR:
                what = f'it mimics "{other}", and "{joint}" of type "{kind}" has no single coordinate'
                self._fail(place, what, f"mimic joints are {', '.join(SCALAR)}")
        numbers = {
            key: self._number(place, element, key, usual) for key, usual in (("multiplier", 1.0), ("offset", 0.0))
        }
        if numbers["multiplier"] == 0.0:
            what = "its multiplier is zero: it follows no joint"
            self._fail(place, what, "make the joint fixed, at its offset")
        return Mimic(name, other, numbers["multiplier"], numbers["offset"])

    def _number(self, place: str, element: ElementTree.Element, key: str, usual: float) -> float:
        text = element.get(key)
        value = usual if text is None else _real(text)
        if not usable(value):
            self._fail(place, f"{key} of its mimic element is {text!r}", "give a number in SI units")
        return value

    def _value(self, name: str) -> float:
        chain = [self._of[name]]
        while chain[-1].other in self._of:
            chain.append(self._of[chain[-1].other])
            if chain[-1].joint in {relation.joint for relation in chain[:-1]} | {name}:
                self._fail(f'joint "{name}"', "it mimics itself, by way of others", "let one of them mimic none")
        value = 0.0
        for relation in reversed(chain):
            value = relation.multiplier * value + relation.offset
        return value


MOVING = ("revolute", "continuous", "prismatic", "floating", "planar")
ONCE = {
    "link": ("inertial",), "joint": ("parent", "child", "origin", "axis", "mimic", "dynamics"),
    "inertial": ("origin", "mass", "inertia"),
}  # fmt: skip
"""What an element has at most once: of several, no reader could tell which one is meant."""
SAFETY, LIMITS, BEYOND = "safety_controller", "limits", "beyond their limits"
FRICTION, DAMPING = "dry friction", "damping of floating and planar joints"
NO_MECHANICS = ("material", "transmission", "gazebo", "sensor", "ros2_control")
Z = np.array([0.0, 0.0, 1.0])


def read_urdf(
    path: str | os.PathLike[str], *, gravity: ArrayLike = (0.0, 0.0, -9.81), free_base: bool = False,
    repair: bool = False, stop_stiffness: float | None = None, smoothing: float | None = None,
) -> ImportedScene:  # fmt: skip
    """The rigid tree of a URDF file, at its zero position and at rest, under `gravity` (m/s², World axes).

    The root link is welded to the ground, or free with `free_base`; its initial frame is that of the World. Many
    published robots have inertia tensors that no body can have. They raise a SceneError, or with `repair` are changed
    by the least amount that makes them possible, and a note lists them; a link with a mass alone is a point mass.
    Damping is that of the hinges. With
    `stop_stiffness` (N m/rad or N/m) limits of angles and displacements become stops, with `smoothing` (rad/s or m/s)
    dry friction becomes a connector that is smooth below that rate; without, notes list them. Shapes, transmissions,
    and limits of efforts and rates are omitted. Mimic joints become couplings, and start where the joints that they
    mimic are at zero. Raises ModelError for a file that is not URDF or has no unique root; SceneError for impossible
    inertia; ValueError for options that are not positive; OSError.
    """
    with naming(str(path)):
        robot = _Robot(str(path), _parsed(Path(path)), repair, stop_stiffness, smoothing)
        try:
            return robot.scene(gravity, free_base)
        except SceneError as error:
            raise SceneError(error.scene, [_with_repair(problem) for problem in error.problems]) from None


def _with_repair(problem: Defect) -> Defect:
    """A problem of the inertia of a link, which the option of the import can remove too."""
    if not (problem.where.startswith("$.bodies") and "inertia" in problem.what):
        return problem
    return replace(problem, remedy=f"{problem.remedy}; flexmb import --repair makes the least change")


def _parsed(path: Path) -> ElementTree.Element:
    try:
        text = read_text(path)
        if "<!ENTITY" in text:
            raise ModelError(f"{path}: it declares entities, which no URDF needs: remove them")
        root = _elements(text.lstrip())  # other readers take blank lines before the declaration too
    except Unreadable as error:
        raise ModelError(f"{path}: {error}") from None
    except expat.ExpatError as error:
        raise ModelError(f"{path}: not XML ({error}): correct it there") from None
    if any(element.tag.startswith("xacro:") for element in root.iter()):
        raise ModelError(f"{path}: it has xacro macros: expand them first, by the command xacro")
    if root.tag != "robot":
        raise ModelError(f'{path}: the outermost element is "{root.tag}", not "robot": is it a URDF file?')
    return root


def _elements(text: str) -> ElementTree.Element:
    """The outermost element. Names keep their prefixes: many files have extensions whose prefix they do not declare."""
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.Parse(text, True)
    return builder.close()


class _Robot:
    """One robot; `place` in errors is the name of a link or joint."""

    def __init__(
        self, file: str, robot: ElementTree.Element, repair: bool, stop_stiffness: float | None, smoothing: float | None
    ) -> None:
        self.file, self.robot, self.repair = file, robot, repair
        self.links = self._named("link")
        self.joints = self._named("joint")
        self._refuse_doubles()
        self.mimics = Mimics(self.joints, self._fail)
        self.extras = JointConnectors(stop_stiffness, smoothing, self.joints)
        self.ignored: dict[str, list[str]] = {}
        self.repaired, self.points, self.commas = list[str](), list[str](), list[str]()

    def scene(self, gravity: ArrayLike, free_base: bool) -> ImportedScene:
        root = self._root()
        builder = SceneBuilder(self.robot.get("name") or Path(self.file).stem, gravity=gravity)
        for name, link in self.links.items():
            self._body(builder, name, link)
        taken = set(self.joints)
        base = next(
            name for name in ("base", "base_joint", f"{root}_to_ground", *map(str, range(9))) if name not in taken
        )
        (builder.free if free_base else builder.weld)(base, GROUND, self._body_of(root))
        for name, joint in self.joints.items():
            self._hinge(builder, name, joint)
        self.mimics.couple(builder)
        for name, joint in self.joints.items():
            self._connect(builder, name, joint)
        return ImportedScene(builder.scene(), tuple(self._notes()))

    def _named(self, tag: str) -> dict[str, ElementTree.Element]:
        elements: dict[str, ElementTree.Element] = {}
        for element in self.robot.findall(tag):
            name = element.get("name")
            if not name or name in elements:
                self._fail(f'{tag} "{name}"', "it has no name, or one that is taken", "rename it")
            elements[name] = element
        return elements

    def _refuse_doubles(self) -> None:
        """ModelError for a link, a joint or an inertial that has twice what it may have once."""
        places = [(f'link "{name}"', link) for name, link in self.links.items()]
        places += [(f'joint "{name}"', joint) for name, joint in self.joints.items()]
        places += [(place, inertial) for place, link in places for inertial in link.findall("inertial")]
        for place, element in places:
            for tag in ONCE[element.tag]:
                if (count := len(element.findall(tag))) > 1:
                    self._fail(place, f"its {element.tag} has {count} elements {tag}", "keep one of them")

    def _root(self) -> str:
        """The only link that is not a child of a joint. ModelError if the joints do not form a tree."""
        children: dict[str, str] = {}
        for name, joint in self.joints.items():
            parent, child = self._link_of(name, joint, "parent"), self._link_of(name, joint, "child")
            if child in children or parent == child:
                other = children.get(child, name)
                self._fail(f'joint "{name}"', f'link "{child}" is also the child of "{other}"', "a URDF is a tree")
            children[child] = name
        if not self.links:
            self._fail("robot", "it has no links", "expand its macros once more, with all files that they include")
        roots = [name for name in self.links if name not in children]
        if len(roots) != 1:
            what = f"{len(roots)} links are not the child of a joint ({listed(roots) or 'none'})"
            self._fail("robot", what, "join all links to one tree")
        return roots[0]

    def _link_of(self, name: str, joint: ElementTree.Element, end: str) -> str:
        element = joint.find(end)
        link = "" if element is None else element.get("link", "")
        if link not in self.links:
            self._fail(f'joint "{name}"', f'its {end} is "{link}", which is not a link', "give the name of a link")
        return link

    def _body_of(self, link: str) -> str:
        """The name of a link's body, another one if the link is called "ground", the name of the inertial frame."""
        return (
            link if link != GROUND else next(name for name in ("ground link", "link ground") if name not in self.links)
        )

    def _body(self, builder: SceneBuilder, name: str, link: ElementTree.Element) -> None:
        place, inertial = f'link "{name}"', link.find("inertial")
        if inertial is None:
            builder.rigid_body(self._body_of(name), mass=0.0, inertia=np.zeros((3, 3)))
            return
        R, com = self._origin(place, inertial)
        mass = self._number(place, inertial, "mass", "value")
        tensor = self._tensor(place, name, inertial)
        if self.repair:
            possible = possible_inertia(mass, tensor)
            changed, size = _largest(possible - tensor), _largest(tensor)
            if changed > PRINTED * size + ROUNDING * mass * float(com @ com):  # less is rounding, which needs no note
                self.repaired.append(f"{name} (by {changed:.3g} of {size:.3g} kg m²)")
            tensor = possible
        turned = R @ tensor @ R.T
        builder.rigid_body(self._body_of(name), mass=mass, com=com, inertia=0.5 * (turned + turned.T))

    def _tensor(self, place: str, name: str, inertial: ElementTree.Element) -> Real:
        """The inertia (3,3) about the mass centre; that of a point, with a note, where the link has a mass alone."""
        if inertial.find("inertia") is None:
            self.points.append(name)
            return np.zeros((3, 3))
        xx, yy, zz, xy, xz, yz = (
            self._number(place, inertial, "inertia", f"i{k}") for k in ("xx", "yy", "zz", "xy", "xz", "yz")
        )
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def _hinge(self, builder: SceneBuilder, name: str, joint: ElementTree.Element) -> None:
        place, kind = f'joint "{name}"', joint.get("type", "")
        parent, child = (self._body_of(self._link_of(name, joint, end)) for end in ("parent", "child"))
        R, p = self._origin(place, joint)
        at: Placement = {"parent_position": p, "parent_quaternion": quaternion_of(R)}
        axis = self._axis(place, joint) if kind in ("revolute", "continuous", "prismatic", "planar") else Z
        damping = self._losses(name, joint) if kind != "fixed" else 0.0
        match kind:
            case "fixed":
                builder.weld(name, parent, child, **at)
            case "revolute" | "continuous":
                value = self.mimics.value(name)
                builder.revolute(name, parent, child, axis=axis, angle=value, damping=damping, **at)
            case "prismatic":
                value = self.mimics.value(name)
                builder.prismatic(name, parent, child, axis=axis, position=value, damping=damping, **at)
            case "floating":
                builder.free(name, parent, child, **at)
            case "planar":  # in the plane across the axis: z of turned frames on both sides
                across = _upright(axis)
                inner, outer = quaternion_of(R @ across), quaternion_of(across)
                builder.planar(name, parent, child, parent_position=p, parent_quaternion=inner, child_quaternion=outer)
            case _:
                self._fail(place, f'its type is "{kind}"', f"types are fixed, {', '.join(MOVING)}")
        if joint.find(SAFETY) is not None and kind != "fixed":
            self.ignored.setdefault(SAFETY, []).append(name)

    def _connect(self, builder: SceneBuilder, name: str, joint: ElementTree.Element) -> None:
        """Stops at the limits of a joint that moves, and its dry friction; or a note on them."""
        kind, limit, dynamics = joint.get("type", ""), joint.find("limit"), joint.find("dynamics")
        turns, single = kind != "prismatic", kind in SCALAR
        sliding = 0.0 if dynamics is None or kind == "fixed" else _real(dynamics.get("friction", "0"))
        if sliding and single and self.extras.smoothing is not None:
            self.extras.rub(builder, name, turns, sliding)
        elif sliding:
            self.ignored.setdefault(FRICTION, []).append(name)
        if limit is None or kind == "fixed":
            return
        if self.extras.stop_stiffness is None or not single:
            self.ignored.setdefault(LIMITS, []).append(name)
        elif kind != "continuous":
            lower, upper = (_real(limit.get(key, "0")) for key in ("lower", "upper"))
            if not (usable(lower) and usable(upper) and lower <= upper):
                what = f"its limits are {limit.get('lower')!r} and {limit.get('upper')!r}"
                self._fail(f'joint "{name}"', what, "give numbers in SI units, lower first")
            self.extras.stop(builder, name, turns, lower, upper)
            if not lower <= self.mimics.value(name) <= upper:
                self.ignored.setdefault(BEYOND, []).append(name)

    def _losses(self, name: str, joint: ElementTree.Element) -> float:
        """The damping of a joint that moves; damping that no coordinate has is noted."""
        element = joint.find("dynamics")
        losses = {"damping": 0.0, "friction": 0.0}
        for key in losses if element is not None else ():
            assert element is not None
            losses[key] = _real(text := element.get(key, "0"))
            if not (usable(losses[key]) and losses[key] >= 0.0):
                self._fail(f'joint "{name}"', f"{key} is {text!r}", "give a number in SI units, zero or more")
        if losses["damping"] and joint.get("type") in ("floating", "planar"):
            self.ignored.setdefault(DAMPING, []).append(name)
        return losses["damping"]

    def _origin(self, place: str, element: ElementTree.Element) -> tuple[Real, Real]:
        """Rotation (3,3) and position (3,) m of a frame; the rotation is about the fixed axes x, then y, then z."""
        origin = element.find("origin")
        if origin is None:
            return np.eye(3), np.zeros(3)
        roll, pitch, yaw = self._vector(place, origin, "rpy")
        return about("z", yaw) @ about("y", pitch) @ about("x", roll), self._vector(place, origin, "xyz")

    def _axis(self, place: str, joint: ElementTree.Element) -> Real:
        element = joint.find("axis")
        axis = np.array([1.0, 0.0, 0.0]) if element is None else self._vector(place, element, "xyz")
        length = float(np.linalg.norm(axis))
        if length == 0.0:
            self._fail(place, "its axis has no length", "give a unit vector")
        return axis / length

    def _vector(self, place: str, element: ElementTree.Element, key: str) -> Real:
        text = element.get(key, "0 0 0")
        words = re.sub(r",(?=\s)", " ", text)  # other readers stop a number at a comma that ends its word
        numbers = [_real(word) for word in words.split()]
        if len(numbers) != 3 or not all(map(usable, numbers)):
            self._fail(place, f'{key} is "{text}"', "give three numbers, with blanks between them")
        if words != text:
            self.commas.append(place)
        return np.array(numbers)

    def _number(self, place: str, inertial: ElementTree.Element, tag: str, key: str) -> float:
        element = inertial.find(tag)
        text = None if element is None else element.get(key)
        value = math.nan if text is None else _real(text)
        if not usable(value):
            self._fail(
                place, f"{tag} {key} is {'missing' if text is None else repr(text)}", "give a number in SI units"
            )
        return value

    def _notes(self) -> Iterable[str]:
        if names := self.ignored.get(LIMITS):
            yield f"{LIMITS} of joints are left out: {listed(names)}{_without(self.extras.stop_stiffness, STOPS)}"
        if names := self.ignored.get(SAFETY):
            yield f"safety limits of joints are left out: {listed(names)}"
        if names := self.ignored.get(FRICTION):
            yield f"{FRICTION} of joints is left out: {listed(names)}{_without(self.extras.smoothing, SMOOTH)}"
        if names := self.ignored.get(BEYOND):
            yield f"joints begin {BEYOND}, and are pushed back: {listed(names)}"
        if names := self.ignored.get(DAMPING):
            yield f"{DAMPING} is left out: {listed(names)}"
        others = sorted({element.tag for element in self.robot} - {"link", "joint", *NO_MECHANICS})
        if others:
            yield f"elements that URDF does not define are left out: {listed(others)}"
        if self.repaired:
            yield f"impossible inertia tensors were changed by the least amount: {listed(self.repaired)}"
        if self.points:
            yield f"links with a mass and no inertia tensor are point masses: {listed(self.points)}"
        if commas := list(dict.fromkeys(self.commas)):
            yield f"commas behind numbers are taken for blanks: {listed(commas)}"
        if fixed := self.mimics.on_fixed:
            yield f"fixed joints mimic nothing: {listed(fixed)}"
        if empty := [name for name, link in self.links.items() if link.find("inertial") is None]:
            yield f"links without inertia are bodies without mass: {listed(empty)}"

    def _fail(self, place: str, what: str, remedy: str) -> NoReturn:
        raise ModelError(f"{self.file}: {place}: {what}: {remedy}")


def _without(given: float | None, remedy: str) -> str:
    """The remedy, where it was not taken; joints of several coordinates have none."""
    return f" ({remedy})" if given is None else ""


def _largest(a: Real) -> float:
    return float(np.max(np.abs(a)))


def _upright(axis: Real) -> Real:
    """A rotation whose z axis is the unit vector `axis`; its x axis is as near as possible to x (or y, if parallel)."""
    along = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    y = np.cross(axis, along)
    y /= np.linalg.norm(y)
    return np.column_stack([np.cross(y, axis), y, axis])


def _real(word: str) -> float:
    """A number in XML notation; NaN for others, also those that only Python accepts (1_0, digits of other scripts)."""
    try:
        return float(word) if word.isascii() and "_" not in word else math.nan
    except ValueError:
        return math.nan
