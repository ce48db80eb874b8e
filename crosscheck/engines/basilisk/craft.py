"""A scene as a spacecraft of Basilisk: a free hub, wheels in it, and chains of parts on it. It needs no Basilisk.

Welded bodies form one part with their carrier; wheels are balanced and included in the hub's mass and inertia.
"""

from __future__ import annotations

from dataclasses import dataclass

from crosscheck.engines.conventions import IDENTITY_FRAME, Frame
from crosscheck.engines.links import Floating, Link, Scalar, links, placed
from flexmb.scene.rigid_equivalent import Inertia, combine
from flexmb.scene.schema import Scene
from flexmb.typing import Real

HUB = -1  # where the number of a part stands for the hub


class NoCraft(ValueError):
    """The scene is no such spacecraft; the message says why."""


@dataclass(frozen=True)
class CraftPart:
    """A part on a scalar joint, whose frame in the part or hub `parent` is `inboard`; `inertia` is the part's own."""

    parent: int
    inboard: Frame
    freedom: Scalar
    inertia: Inertia


@dataclass(frozen=True)
class CraftWheel:
    """A wheel's motor, friction and state, its axis (3,) in hub axes, and its inertia about the axis (kg m^2)."""

    spin: Scalar
    axis: Real
    inertia: float


@dataclass(frozen=True)
class Craft:
    """`base` is the inboard frame of the hub's free hinge in World; `where[i]` is the part of link i and its frame in
    it.

    `chains` are the numbers of the parts of each chain on the hub; a chain has only rotations or only translations.
    """

    base: Frame
    flight: Floating
    hub: Inertia
    wheels: tuple[CraftWheel, ...]
    parts: tuple[CraftPart, ...]
    chains: tuple[tuple[int, ...], ...]
    where: tuple[tuple[int, Frame], ...]
    links: tuple[Link, ...]


def craft_of(scene: Scene) -> Craft:
    """Raises NoCraft if the scene cannot be represented."""
    if any(scene.gravity_m_s2):
        raise NoCraft("Basilisk's gravity is that of planets: none that is uniform")
    chain = links(scene)
    first = chain[0]
    if not (len(first.freedoms) == 1 and isinstance(first.freedoms[0], Floating)):
        raise NoCraft(f'Basilisk needs a free hub: "{first.joint}" is not a free hinge')
    where: list[tuple[int, Frame]] = [(HUB, IDENTITY_FRAME)]
    masses: dict[int, list[Inertia]] = {HUB: [first.inertia]}
    joints: list[tuple[int, Frame, Scalar]] = []
    wheels: list[CraftWheel] = []
    for link in chain[1:]:
        if link.parent < 0:
            raise NoCraft(f'Basilisk has one spacecraft: "{link.joint}" hangs on nothing of it')
        part, frame = where[link.parent]
        frame = frame @ link.inboard
        if link.kind == "wheel":
            wheels.append(_wheel(link, part, frame))
        else:
            for freedom in link.freedoms:
                joints.append((part, frame, _simple(link, freedom)))
                part, frame = len(joints) - 1, IDENTITY_FRAME
        where.append((part, frame))
        masses.setdefault(part, []).append(placed(link.inertia, frame))
    parts = tuple(CraftPart(*joint, combine(masses.get(k, []))) for k, joint in enumerate(joints))
    hub = combine(masses[HUB])
    for load in scene.loads:
        if where[next(i for i, link in enumerate(chain) if link.kind == "body" and link.name == load.body)][0] != HUB:
            raise NoCraft(f'load "{load.name}" does not act on the hub: Basilisk takes those on the hub only')
    return Craft(first.inboard, first.freedoms[0], hub, tuple(wheels), parts, _chains(parts), tuple(where), chain)


def _wheel(link: Link, part: int, frame: Frame) -> CraftWheel:
    (spin,) = link.freedoms
    if part != HUB:
        raise NoCraft(f'wheel "{link.name}" is not in the hub, where Basilisk has its wheels')
    spin = _simple(link, spin)
    return CraftWheel(spin, frame.rotation @ spin.axis, float(spin.axis @ link.inertia.inertia @ spin.axis))


def _simple(link: Link, freedom: object) -> Scalar:
    if not isinstance(freedom, Scalar):
        raise NoCraft(f'"{link.joint}": on Basilisk\'s hub parts turn or slide about axes')
    if freedom.prescribed is not None:
        raise NoCraft(f'"{link.joint}" is prescribed: this adapter takes loads and motors only')
    return freedom


def _chains(parts: tuple[CraftPart, ...]) -> tuple[tuple[int, ...], ...]:
    chains: dict[int, list[int]] = {}
    for number, part in enumerate(parts):
        if part.parent == HUB:
            chains[number] = [number]
            continue
        own = next((chain for chain in chains.values() if chain[-1] == part.parent), None)
        if own is None:
            raise NoCraft("a part carries two others: Basilisk's effectors are chains without branches")
        if parts[own[0]].freedom.motion != part.freedom.motion:
            raise NoCraft("a chain both turns and slides: Basilisk's effectors do one of them")
        own.append(number)
    return tuple(map(tuple, chains.values()))
