"""Couplings: that they relate coordinates that exist, each once, and leave one free."""

from __future__ import annotations

from collections.abc import Iterator

from flexmb.scene.check.walk import sound
from flexmb.scene.problems import Defect, Place
from flexmb.scene.schema import Coupling, Scene
from flexmb.scene.tree import Coupled, coupled

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
