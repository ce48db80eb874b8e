"""Checks of beams: mesh, sections that cover the length, and modes that the elements can represent."""

from __future__ import annotations

from collections.abc import Iterator

from flexmb.scene.bodies import BeamBody
from flexmb.scene.check import inertia
from flexmb.scene.check.exact_beams import damping, exact_beam, without_strains
from flexmb.scene.check.numbers import in_range
from flexmb.scene.check.sections import stations
from flexmb.scene.check.walk import sound
from flexmb.scene.problems import Defect, Doubt, Place
from flexmb.scene.rounding import tensor_dust
from flexmb.scene.schema import Scene
from flexmb.scene.sections import twists_with_inertia
from flexmb.scene.sizes import MOST_BYTES, PER_MODE, PLENTY, beam_estimate, counted
from flexmb.scene.strains import families, strain_count


def beams(scene: Scene) -> Iterator[Defect]:
    """Problems of every beam body."""
    of_beams = [i for i, body in enumerate(scene.bodies) if isinstance(body, BeamBody)]
    for place, body in sound(scene, "bodies", of_beams):
        yield from _size(place.key("elements"), body)
        yield from _stations(place, body)
        yield from _along(place, body)
        if body.level == "exact":
            yield from exact_beam(place, body)
        else:
            yield from _modes(place.key("modes"), body)
            yield from without_strains(place, body)


def mode_count(body: BeamBody) -> int:
    """Modal coordinates of a beam: eigenmodes and attachment modes; at level exact the polynomials of all strains."""
    if body.level == "exact":
        return strain_count(body)
    return body.modes.count + (_attachments(body) if body.modes.static else 0)


def _size(place: Place, body: BeamBody) -> Iterator[Defect]:
    """The elements fit into memory, and are not many more than the modes need."""
    modes = max(0, mode_count(body))
    estimate, enough = beam_estimate(body, modes), max(PLENTY, PER_MODE * modes)
    if estimate.memory > MOST_BYTES:
        numbers = f"{counted(body.elements)} elements and {counted(modes)} modes"
        what = f"{numbers} would take {estimate.words} to make the modes of one beam"
        yield Defect(str(place), what, f"give {PLENTY} or fewer, and as few modes as the motion has")
    elif body.elements > enough:
        what = f"{body.elements} elements for {modes} modes take {estimate.words}, and change no digit of the motion"
        yield Doubt(str(place), what, f"give {enough} or fewer: {PER_MODE} for each mode are plenty", "many_elements")


def _stations(place: Place, body: BeamBody) -> Iterator[Defect]:
    positions = [station.x_m for station in body.stations]
    spot = place.key("stations")
    if any(left > right for left, right in zip(positions, positions[1:], strict=False)):
        yield Defect(str(spot), "the stations are not in order", "sort them by x_m")
    elif len(positions) < 2 or positions[0] != 0.0 or positions[-1] != body.length_m:
        covered = f"{positions[0]:g} m to {positions[-1]:g} m" if positions else "nothing"
        remedy = f"give the section at x_m = 0 and at x_m = {body.length_m!r}; a uniform beam has the same one twice"
        yield Defect(str(spot), f"the stations cover {covered}, the beam 0 m to {body.length_m:g} m", remedy)
    yield from stations(place, body)


def _along(place: Place, body: BeamBody) -> Iterator[Defect]:
    for key in ("nodes", "tip_masses"):
        for i, item in enumerate(getattr(body, key)):
            if not 0.0 <= item.x_m <= body.length_m:
                what = f"x_m = {item.x_m:g} m is not on the beam"
                yield Defect(str(place.key(key, i, "x_m")), what, f"choose 0 <= x_m <= {body.length_m:g}")
    for i, lump in enumerate(body.tip_masses):
        dust = tensor_dust(lump.mass_kg, body.length_m)
        yield from inertia.tensor(place.key("tip_masses", i, "inertia_kg_m2"), lump.inertia_kg_m2, dust)


def _modes(place: Place, body: BeamBody) -> Iterator[Defect]:
    modes = body.modes
    if not (own := families(body)) or len(set(own)) < len(own):
        yield Defect(str(place.key("families")), f"the families are {own}", "list each wanted family once")
    if not (in_range(body) and in_range(modes)):
        return
    if mode_count(body) < 1:
        remedy = 'give one at least, or "static" ones, or make the level "rigid"'
        yield Defect(str(place.key("count")), f"{counted(modes.count)} modes", remedy)
    elif mode_count(body) > (available := available_modes(body)):
        what = f"{counted(mode_count(body))} modes, but {body.elements} elements give {available} of these families"
        yield Defect(str(place.key("count")), what, "use more elements, more families, or fewer modes")
    yield from damping(place, modes, mode_count(body))


def _attachments(body: BeamBody) -> int:
    """Unit tip loads: one for axial and torsion, force and moment for each bending plane."""
    counts = {"axial": 1, "torsion": 1, "bending_y": 2, "bending_z": 2}
    return sum(counts[family] for family in families(body))


def available_modes(body: BeamBody) -> int:
    """Coordinates of the wanted families.

    A free-free beam has the root's coordinates in addition, but just as many rigid motions, which are not modes.
    """
    bending = body.elements if body.mass == "lumped" and not _has_rotary(body) else 2 * body.elements
    counts = {"axial": body.elements, "torsion": body.elements, "bending_y": bending, "bending_z": bending}
    return sum(counts[family] for family in families(body))


def _has_rotary(body: BeamBody) -> bool:
    return body.points != "line" and twists_with_inertia(body)
