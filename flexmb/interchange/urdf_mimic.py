"""Mimic joints of a URDF file: q = multiplier q_other + offset, a coupling of the two hinges."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NoReturn
from xml.etree import ElementTree

from flexmb.interchange.imported import usable
from flexmb.scene.build import SceneBuilder
from flexmb.scene.problems import closest

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
        try:
            value = usual if text is None else float(text) if text.isascii() and "_" not in text else math.nan
        except ValueError:
            value = math.nan
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
