"""Checks of coordinates (counts, springs, motors, prescribed motions), wheels, point masses, axes of closures, and
couplings: that they relate coordinates that exist, each once, and leave one free.
"""

from __future__ import annotations

from collections.abc import Iterator
from operator import attrgetter
from typing import Any

import numpy as np

from flexmb.scene.check.numbers import UNIT_LENGTH, in_range
from flexmb.scene.check.profiles import MOTIONS, initial_motion
from flexmb.scene.check.walk import sound
from flexmb.scene.columns import alike
from flexmb.scene.events import Release
from flexmb.scene.freedoms import Coordinate
from flexmb.scene.hinges import WITH_AXIS, Z_AXIS, Gimbal
from flexmb.scene.problems import Defect, Place
from flexmb.scene.rounding import PRINTED
from flexmb.scene.schema import Coupling, Scene, Wheel
from flexmb.scene.tree import Coupled, coordinates, coupled


def hinges(scene: Scene) -> Iterator[Defect]:
    """Motors that can act, motions that start where they are, gimbal sequences that exist."""
    for place, hinge in sound(scene, "hinges", _to_examine(scene)):
        yield from _coordinates(place, hinge, _let_go(scene))
        if isinstance(hinge, Gimbal):
            yield from _gimbal(place, hinge)


def _to_examine(scene: Scene) -> set[int]:
    """Numbers of the gimbals, and of hinges with a prescribed motion."""
    bodies: set[int] = set()
    for kind, owners, structs in alike(scene.hinges):
        if kind is Gimbal:
            bodies.update(owners)
        for key in kind.__struct_fields__:
            if key in MOTIONS and any(profiles := list(map(attrgetter(key), structs))):
                bodies.update(owner for owner, profile in zip(owners, profiles, strict=True) if profile is not None)
    return bodies


def closures(scene: Scene) -> Iterator[Defect]:
    """A closure of a kind without an axis must not be given one."""
    given = [
        i
        for i, closure in enumerate(scene.closures)
        if closure.type not in WITH_AXIS
        and max(abs(a - b) for a, b in zip(closure.axis, Z_AXIS, strict=True)) > UNIT_LENGTH
    ]
    for place, closure in sound(scene, "closures", given):
        what = f"a {closure.type} closure has no axis of its own"
        yield Defect(str(place.key("axis")), what, "leave the axis out, or turn quaternion_a and quaternion_b")


def wheels(scene: Scene) -> Iterator[Defect]:
    """A wheel has a possible inertia, and either a motor or a prescribed spin."""
    for place, wheel in sound(scene, "wheels"):
        yield from _wheel_inertia(place, wheel)
        yield from _drive(place, wheel, f"{wheel.name}.angle" in _let_go(scene))


def point_masses(scene: Scene) -> Iterator[Defect]:
    """A point mass has mass, at most three orthogonal directions, and a coordinate for each if any."""
    for place, item in sound(scene, "point_masses"):
        count = len(item.directions)
        if count > 3:
            yield Defect(str(place.key("directions")), f"{count} directions in space", "give three at most")
        product = np.array(item.directions).reshape(-1, 3) @ np.array(item.directions).reshape(-1, 3).T
        skew = np.abs(np.triu(product, 1)) > UNIT_LENGTH
        for i, j in np.argwhere(skew):
            what = f"directions {i} and {j} are not orthogonal: their product is {product[i, j]:.3g}"
            yield Defect(str(place.key("directions")), what, "give orthonormal directions")
        if count == 3 and np.linalg.det(item.directions) < 0.0:
            remedy = "swap two of them, and their coordinates"
            yield Defect(str(place.key("directions")), "the three directions are left-handed", remedy)
        if item.coordinates and len(item.coordinates) != count:
            what = f"{len(item.coordinates)} coordinates for {count} directions"
            yield Defect(str(place.key("coordinates")), what, "give one coordinate for each direction, or none")
        yield from _coordinates(place, item, _let_go(scene))


def _let_go(scene: Scene) -> set[str]:
    """Coordinates that an event releases: their motors move them from then on."""
    actions = [action for event in scene.events for action in event.actions]
    return {action.coordinate for action in actions if isinstance(action, Release)}


def _coordinates(place: Place, item: Any, released: set[str]) -> Iterator[Defect]:
    for name, coordinate in coordinates(item):
        spot = Place(f"{place.path}.{name}", place.names)
        yield from _drive(spot, coordinate, f"{item.name}.{name}" in released)


def _drive(place: Place, item: Coordinate | Wheel, released: bool) -> Iterator[Defect]:
    """A prescribed coordinate starts at its profile, and has no motor unless an event releases it."""
    keys = item.KEYS
    profile = getattr(item, keys.prescribed)
    if profile is None:
        return
    if not released and getattr(item, keys.effort) is not None:
        what = f"{keys.effort} on a prescribed coordinate cannot change the motion"
        remedy = f"leave out {keys.effort} or {keys.prescribed}; the drive load is an output"
        yield Defect(str(place.key(keys.effort)), what, remedy)
    yield from initial_motion(place, item, (keys.value, keys.rate), profile)


def _gimbal(place: Place, hinge: Gimbal) -> Iterator[Defect]:
    sequence = hinge.sequence
    if len(sequence) not in (2, 3) or set(sequence) - set("xyz"):
        what = f'"{sequence}" is not a sequence of two or three axes'
        yield Defect(str(place.key("sequence")), what, 'write two or three of x, y, z, for example "zxz"')
    elif any(first == second for first, second in zip(sequence, sequence[1:], strict=False)):
        what = f'"{sequence}" repeats an axis: two successive rotations about it are one'
        yield Defect(str(place.key("sequence")), what, "let neighbouring axes differ")
    if len(hinge.rotations) != len(sequence):
        what = f'{len(hinge.rotations)} rotations for the {len(sequence)} axes of "{sequence}"'
        yield Defect(str(place.key("rotations")), what, "give one rotation for each axis")


def _wheel_inertia(place: Place, wheel: Wheel) -> Iterator[Defect]:
    axial, transverse = wheel.axial_inertia_kg_m2, wheel.transverse_inertia_kg_m2
    if in_range(wheel) and axial > 2.0 * transverse * (1.0 + PRINTED):
        what = f"the axial inertia {axial:g} exceeds twice the transverse inertia {transverse:g} kg m²"
        remedy = f"no wheel has this: the transverse inertia is {axial / 2.0:g} kg m² at least (a flat disc)"
        yield Defect(str(place.key("transverse_inertia_kg_m2")), what, remedy)


NAME_IT = "name a hinge with angles or displacements, and the coordinate as the hinge does"


def couplings(scene: Scene) -> Iterator[Defect]:
    """Every coupling by itself. Redundant ones are allowed, as redundant closures are."""
    for place, item in sound(scene, "couplings"):
        coupling: Coupling = item
        if not coupling.terms:
            remedy = "name the coordinates that lead this one; a coordinate that is constant is prescribed, or a weld"
            yield Defect(str(place.key("terms")), "no coordinate leads this one", remedy)
            continue
        try:
            related = coupled(scene, coupling)
        except ValueError as error:
            yield Defect(str(place), str(error), NAME_IT)
            continue
        yield from _once(place, related)
        if all(member.named.coordinate.prescribed is not None for member in related):
            what = "all its coordinates are prescribed, and nothing is left that it could lead"
            yield Defect(str(place), what, "leave the coupling out, or one of the prescribed motions")


def _once(place: Place, related: tuple[Coupled, ...]) -> Iterator[Defect]:
    seen: set[tuple[str, int]] = set()
    for member in related:
        if (member.hinge.name, member.place) in seen:
            what = f'coordinate "{member.named.name}" of hinge "{member.hinge.name}" is named twice'
            yield Defect(str(place), what, "name each coordinate once, with the sum of its ratios")
        seen.add((member.hinge.name, member.place))
