"""Checks of beams of level exact, and that other levels are not given what only that level has."""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot
from typing import assert_never

from flexmb.scene.bodies import FINER, MOST_POINTS, MOST_POLYNOMIALS, BeamBody, ModalBody, Modes
from flexmb.scene.check.numbers import in_range
from flexmb.scene.convert import ROOT
from flexmb.scene.pieces import across, cut_itself, piece_count
from flexmb.scene.problems import Defect, Doubt, Place, closest
from flexmb.scene.rest_curve import MOST_TURN, is_bent, is_curved
from flexmb.scene.rest_turn import follow, turn_at_rest, turns_of_pieces
from flexmb.scene.schema import Scene
from flexmb.scene.sections import has_plain_sections
from flexmb.scene.sizes import MOST_MODES, counted
from flexmb.scene.strains import (
    BENDINGS,
    FEWEST_POINTS,
    MORE_POINTS,
    REST_LEFT_OUT,
    SHEARED,
    Strain,
    points_at_rest,
    points_of_part,
    points_of_piece,
    polynomials,
)
from flexmb.scene.taper import too_stiff

POINTS_DOUBTED, POLYNOMIALS_DOUBTED, POLYNOMIALS_ENOUGH = 1e-2, 1e-1, 1e-2
"""Of what turns at rest, left out: points that leave the first put the axis some 1e-4 of its length off; polynomials
that leave the second make the first frequency of a coil some 1 % too high, as two do that of a straight beam."""

TAPER_DOUBTED, TAPER_ENOUGH, TAPER_MOST = 1e-2, 2e-3, 20
"""Of the deflection under a load at the tip, left out. Where more polynomials were needed, pieces need fewer."""


def exact_beam(place: Place, body: BeamBody) -> Iterator[Defect]:
    """Strains, points and damping of a beam of level exact."""
    modes = place.key("modes")
    wrong = [*_strains(modes, body)]
    yield from wrong
    if (turn := turn_at_rest(body)) > MOST_TURN:
        worst = max(range(len(body.stations)), key=lambda i: hypot(*body.stations[i].curvature_1_m))
        what = f"at rest the beam turns by {turn:.6g} rad, and the limit is {MOST_TURN:g} rad"
        remedy = "correct the curvature (1/m), or divide the beam into several that are welded together"
        yield Defect(str(place.key("stations", worst, "curvature_1_m")), what, remedy)
    if body.modes.boundary != "clamped-free":
        remedy = "leave it out: the body frame is at the root, and a hinge may sit on any node of the beam"
        yield Defect(str(modes.key("boundary")), "strains have no boundary conditions to choose", remedy)
    if body.mass != "consistent":
        yield Defect(str(place.key("mass")), f'mass is "{body.mass}"', 'use "consistent": inertia is at Gauss points')
    if wrong or not all(in_range(mapping) for mapping in (body.modes, body.modes.polynomials) if mapping is not None):
        return  # nothing can be said of so many
    counts = polynomials(body)
    if not counts:
        remedy = 'give polynomials of a curvature, or make the level "rigid"'
        yield Defect(str(modes.key("count")), "the beam has no strain", remedy)
        return
    if body.modes.points is not None and (points := body.modes.points) <= (most := max(counts.values())):
        what = f"{points} points for {most} polynomials of one strain leave motions without inertia"
        remedy = f"use {most + 1} points at least; {max(FEWEST_POINTS, most + MORE_POINTS)} are the default"
        yield Defect(str(modes.key("points")), what, remedy)
    elif turn <= MOST_TURN:
        yield from _unfollowed(modes, body, counts)
    for shear, key in (("shear_y", "GAy_N"), ("shear_z", "GAz_N")):
        if shear in counts and any(
            station.stiffness is None and getattr(station, key) is None for station in body.stations
        ):
            spot = str(place.key("stations"))
            yield Defect(spot, f"{shear} has polynomials, and a station no {key}", f"give {key} at every station")
    yield from _still(modes, body, counts)
    if (count := sum(counts.values()) * max(piece_count(body), 1)) > MOST_MODES:
        numbers = f"{counted(count)} polynomials in all its pieces"
        what = f"{numbers}: one body with so many takes minutes and gigabytes to make"
        remedy = f"give {MOST_MODES} at most; several bodies that are welded together cost O(N)"
        yield Defect(str(modes.key("pieces")), what, remedy)
    yield from damping(modes, body.modes, count, or_whole(body))


def _unfollowed(place: Place, body: BeamBody, found: dict[Strain, int]) -> Iterator[Doubt]:
    """Points and polynomials that cannot follow the axis at rest, along the piece that needs most of them."""
    parts, points = turns_of_pieces(body), points_of_piece(body)
    if not parts:
        return
    worst = max(parts, key=lambda part: follow(part.turn, POINTS_DOUBTED) / points_of_part(points, part.share))
    if points_of_part(points, worst.share) < follow(worst.turn, POINTS_DOUBTED):
        enough = max(points_at_rest(worst, REST_LEFT_OUT), 1 + max(found.values()))
        what = f"at rest the beam turns by {worst.turn:.3g} rad along a piece, which {points} points do not follow"
        yield Doubt(str(place.key("points")), what, _more("points", enough, MOST_POINTS), "few_points")
    turn = max(sum(part.turn for part in parts if part.piece == piece) for piece in {part.piece for part in parts})
    least = min((found[strain] for strain in BENDINGS if strain in found), default=MOST_POLYNOMIALS)
    if least < follow(turn, POLYNOMIALS_DOUBTED):
        what = f"at rest the beam turns by {turn:.3g} rad along a piece, and its strains with it: {least} polynomials"
        key = "count" if body.modes.polynomials is None else "polynomials"
        remedy = _more(key, follow(turn, POLYNOMIALS_ENOUGH), MOST_POLYNOMIALS)
        yield Doubt(str(place.key(key)), f"{what} make it too stiff", remedy, "few_polynomials")


def _more(key: str, enough: int, most: int) -> str:
    return f"give its modes {key} = {enough}" if enough < most else "cut it into more `pieces`"


def _still(place: Place, body: BeamBody, found: dict[Strain, int]) -> Iterator[Defect]:
    """Shear undoes a slope from its second polynomial on; without rotary inertia nothing moves then."""
    if body.tip_masses or is_curved(body) or not has_plain_sections(body):
        return  # `compile` sees what moves
    for (shear, bending), key in zip(SHEARED, ("rotary_z_kg_m", "rotary_y_kg_m"), strict=True):
        turns = body.points != "line" and any(getattr(station, key) for station in body.stations)
        if not turns and min(found.get(shear, 0) - 1, found.get(bending, 0)) > 0:
            what = f"{shear} and {bending} can be combined so that no inertia moves"
            remedy = f'give the sections {key} and points = "section", or {shear} one polynomial in modes.polynomials'
            yield Defect(str(place.key("polynomials")), what, remedy)


def _strains(place: Place, body: BeamBody) -> Iterator[Defect]:
    modes = body.modes
    if modes.polynomials is None and modes.count > MOST_POLYNOMIALS:
        yield Defect(str(place.key("count")), f"{counted(modes.count)} polynomials", FINER)
    places = {node.name: node.x_m for node in body.nodes}
    for i, name in enumerate(modes.cuts or ()):
        spot = str(place.key("cuts", i))
        if name not in places:
            yield Defect(spot, f'the beam lists no node "{name}"', closest(name, places))
        elif not 0.0 < places[name] < body.length_m:
            yield Defect(spot, f'node "{name}" is at the end of the beam', "leave it out: the beam ends there anyway")
        elif any(places.get(other) == places[name] for other in (modes.cuts or ())[:i]):
            yield Defect(spot, f'the beam is already cut where node "{name}" is', "leave one of them out")


def jumps(scene: Scene) -> Iterator[Doubt]:
    """Where strains jump inside the pieces of beams of level exact, of a scene that has no defects."""
    for i, body in enumerate(scene.bodies):
        if isinstance(body, BeamBody) and body.level == "exact" and (found := across(scene, body)):
            x, what = next(iter(found.items()))
            more = f" and {len(found) - 1} more" if len(found) > 1 else ""
            yield Doubt(
                str(ROOT.key("bodies", i, "modes", "cuts").named(f'body "{body.name}"')),
                f"strains jump at x = {x:g} m ({what}){more}, where one polynomial goes on: it converges slowly there",
                "cut the beam there: cuts = [its node] or flexmb.surrogate.cut_where_loaded, or at many places by "
                "flexmb.surrogate.substructured",
                "uncut_beam",
            )


def tapers(scene: Scene) -> Iterator[Doubt]:
    """Polynomials of beams of level exact that cannot follow how the stiffness varies, of a scene without defects."""
    for i, body in enumerate(scene.bodies):
        if isinstance(body, BeamBody) and body.level == "exact" and len(body.stations) > 1:
            yield from _tapered(ROOT.key("bodies", i, "modes").named(f'body "{body.name}"'), body)


def _tapered(place: Place, body: BeamBody) -> Iterator[Doubt]:
    """The same of one beam and of the strain that is worst."""
    found = polynomials(body)
    parts = {
        strain: next(too_stiff(body, strain, range(count, count + 1)), (count, 0.0))[1]
        for strain, count in found.items()
    }
    worst = max(parts, key=lambda strain: parts[strain])
    if parts[worst] <= TAPER_DOUBTED:
        return
    more = too_stiff(body, worst, range(found[worst] + 1, TAPER_MOST))
    enough = next((count for count, left in more if left <= TAPER_ENOUGH), TAPER_MOST)
    what = f"{found[worst]} polynomials of {worst} do not follow how the stiffness varies along the beam"
    key = "count" if body.modes.polynomials is None else "polynomials"
    remedy = f"{_more(key, enough, TAPER_MOST)}, or cut it at a station where the stiffness has a kink"
    yield Doubt(
        str(place.key(key)),
        f"{what}, and leave out {parts[worst]:.2g} of its deflection at rest",
        remedy,
        "few_polynomials",
    )


def without_strains(place: Place, body: BeamBody) -> Iterator[Defect]:
    """A beam of another level is not given what only level exact has."""
    standard = Modes(count=1)
    for key in ("polynomials", "pieces", "cuts", "points"):
        if body.level != "rigid" and getattr(body.modes, key) != getattr(standard, key):
            what = f'{key} is for strains, which level "{body.level}" does not have'
            yield Defect(str(place.key("modes", key)), what, 'leave it out, or make the level "exact"')
    for i, station in enumerate(body.stations):
        if is_bent(station, body.length_m):
            what = f'level "{body.level}" has straight beams only'
            spot = place.key("stations", i, "curvature_1_m")
            yield Defect(str(spot), what, 'make the level "exact", or join straight beams by welds')


def or_whole(body: BeamBody | ModalBody) -> str:
    """The other remedy where a number of modes is not that of a beam which was cut by itself."""
    match body:
        case BeamBody():
            return "; cuts = [] leaves the beam in one piece" if body.level == "exact" and cut_itself(body) else ""
        case ModalBody():
            return ""
        case _:
            assert_never(body)


def damping(place: Place, modes: Modes, count: int, whole: str = "") -> Iterator[Defect]:
    """Damping ratios of a beam with `count` modes; `whole`: see `or_whole`."""
    ratios = modes.damping_ratio
    if isinstance(ratios, tuple) and len(ratios) != count:
        what = f"{len(ratios)} damping ratios for {count} modes"
        yield Defect(str(place.key("damping_ratio")), what, f"give one ratio for all modes, or one for each{whole}")
