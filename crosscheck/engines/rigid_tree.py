"""What the adapters of peers for rigid trees have in common: slots of freedoms, loads at nodes, connectors, drives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar, assert_never

import numpy as np

from crosscheck.engines.connections import Along, Exerted, Moving, along_hinges, connections
from crosscheck.engines.conventions import Frame
from crosscheck.engines.functions_of_time import Profile, profile
from crosscheck.engines.links import Attachment, Freedom, Link, Scalar
from flexmb.scene.schema import Load, Scene
from flexmb.scene.tree import coupled
from flexmb.typing import Real


@dataclass(frozen=True)
class Slot:
    """A freedom, and where its coordinates start in `q` and its speeds in `v`."""

    freedom: Freedom
    link: Link
    q: int
    v: int

    @property
    def driven(self) -> bool:
        return isinstance(self.freedom, Scalar) and self.freedom.prescribed is not None


AnySlot = TypeVar("AnySlot", bound=Slot)


def scalars(slots: Sequence[AnySlot]) -> list[AnySlot]:
    """Those of joints of one coordinate."""
    return [slot for slot in slots if isinstance(slot.freedom, Scalar)]


def motors(slots: Sequence[Slot]) -> list[tuple[int, Callable[[float], Profile]]]:
    """The place in `v` of every coordinate with a motor, and the load of that as a function of time."""
    return [(slot.v, profile(slot.freedom.effort)) for slot in scalars(slots) if slot.freedom.effort is not None]


def scalar_start(freedom: Scalar) -> tuple[float, float]:
    """Value and rate of a scalar freedom at t = 0, those of its prescribed motion if it has one."""
    if freedom.prescribed is None:
        return freedom.value, freedom.rate
    return profile(freedom.prescribed)(0.0)[:2]


@dataclass(frozen=True)
class PlacedCoupling:
    """A coupling on the slots of a tree: sum of factors times their coordinates = `offset`, the led one first, by 1.

    Its load f acts as the generalised forces factor times f along the coordinates.
    """

    name: str
    slots: tuple[Slot, ...]
    factors: tuple[float, ...]
    offset: float

    def row(self, speeds: int) -> Real:
        """(nv,) of the Jacobian."""
        found = np.zeros(speeds)
        found[[slot.v for slot in self.slots]] = self.factors
        return found

    def load(self, size: float, axis: Real) -> Real:
        """[torque; force] (6,) of the load f along the axis of the coordinate that is led."""
        freedom, none = self.slots[0].freedom, np.zeros(3)
        if not isinstance(freedom, Scalar):
            raise TypeError(f'coupling "{self.name}" leads no scalar coordinate')
        along = size * axis
        match freedom.motion:
            case "turn" | "screw":
                return np.concatenate([along, none])
            case "slide":
                return np.concatenate([none, along])
            case _:
                assert_never(freedom.motion)


def placed_couplings(scene: Scene, slots: Sequence[Slot]) -> tuple[PlacedCoupling, ...]:
    """The couplings of a scene on the slots of its tree."""
    scalars: dict[str, list[Slot]] = {}
    for slot in slots:
        if isinstance(slot.freedom, Scalar):
            scalars.setdefault(slot.link.joint, []).append(slot)
    found = []
    for coupling in scene.couplings:
        related = coupled(scene, coupling)
        own = tuple(scalars[each.hinge.name][each.place] for each in related)
        found.append(PlacedCoupling(coupling.name, own, tuple(each.factor for each in related), coupling.offset))
    return tuple(found)


class PointLoad:
    """A force or torque at a `point` (3,) of a body; `at` is the load's frame in the axes that the engine uses."""

    def __init__(self, load: Load, at: Frame) -> None:
        self.point, self.is_force = at.position, load.type == "force"
        self.fixed_in_world = load.frame == "world"
        direction = np.array(load.direction, dtype=float)
        self._direction = direction if self.fixed_in_world else at.rotation @ direction
        self._size = profile(load.function)

    def vector(self, t: float) -> Real:
        """The load (3,) in the axes in which it is fixed: those of World or of the body."""
        return self._size(t).value * self._direction

    def in_world(self, t: float, R: Real) -> Real:
        """The load (3,) in World axes, for the body's rotation R (3, 3)."""
        return self._size(t).value * (self._direction if self.fixed_in_world else R @ self._direction)

    def in_body(self, t: float, R: Real) -> Real:
        """The load (3,) in the axes of the body."""
        return self._size(t).value * (R.T @ self._direction if self.fixed_in_world else self._direction)


class TreeConnectors:
    """The connectors of a scene on a tree of links: `between` nodes, and along scalar coordinates."""

    def __init__(self, scene: Scene, links: tuple[Link, ...], slots: Sequence[Slot]) -> None:
        self.between = connections(scene, links)
        self.along_hinges = []
        for name, item, number, load in along_hinges(scene):
            own = [slot for slot in scalars(slots) if slot.link.joint == item]
            self.along_hinges.append((name, own[number], load))

    def __bool__(self) -> bool:
        return bool(self.between or self.along_hinges)

    def exerted(self, t: float, frame: Callable[[Attachment], Moving]) -> dict[str, Exerted]:
        """What each connector between nodes does; `frame` gives the motion of a frame on a link."""
        return {each.name: each.exerted(t, frame(each.a), frame(each.b)) for each in self.between}

    def loads(self, exerted: dict[str, Exerted]) -> Iterable[tuple[Attachment, Real]]:
        """The frames on links on which they act, with [torque; force] (6,) about the frame in World axes."""
        for each in self.between:
            for at, load in ((each.a, exerted[each.name].on_a), (each.b, exerted[each.name].on_b)):
                if at.link >= 0:
                    yield at, load

    def along(self, t: float, q: Real, v: Real) -> dict[str, tuple[int, Along]]:
        """For each connector along a hinge the speed that it acts on, and what it does."""
        return {name: (slot.v, load(t, float(q[slot.q]), float(v[slot.v]))) for name, slot, load in self.along_hinges}


def by_joint(slots: Iterable[Slot], loads: Iterable[float]) -> dict[str, Real]:
    """Loads of scalar freedoms by the name of their joint."""
    named: dict[str, list[float]] = {}
    for slot, load in zip(slots, loads, strict=True):
        named.setdefault(slot.link.joint, []).append(float(load))
    return {name: np.array(values) for name, values in named.items()}


def of_kind(kind: str, wrenches: dict[tuple[str, str], Real]) -> dict[str, Real]:
    """The wrenches of one kind of link, "body" or "wheel", by the name of their joint."""
    return {name: wrench for (each, name), wrench in wrenches.items() if each == kind}
