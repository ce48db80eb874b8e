"""The strains of a beam of any level: the one place that says what it can do, how finely, and with what inertia.

Stiffness never depends on inertia. A beam that is to twist twists, whether or not its sections have inertia about its
axis: where they have none, the twist gets that of a homogeneous section (`twist_inertia`), so that its frequencies are
those of a bar rather than infinite.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import ceil
from typing import Literal, assert_never

import numpy as np

from flexmb.scene.bodies import FAMILIES, MOST_POINTS, BeamBody, BeamStation, Family, StrainPolynomials
from flexmb.scene.pieces import cuts, piece_count
from flexmb.scene.rest_turn import RestTurn, follow, turns_of_pieces
from flexmb.scene.sections import (
    ABOUT_Y,
    ABOUT_Z,
    EXTENSION,
    TWIST,
    inertia_on_axis,
    stiffness_on_axis,
    twists_with_inertia,
)
from flexmb.typing import Real

Strain = Literal["axial", "shear_y", "shear_z", "torsion", "bending_z", "bending_y"]
STRAINS: tuple[Strain, ...] = ("axial", "shear_y", "shear_z", "torsion", "bending_z", "bending_y")
"""In the order of the rows [stretch, shears; twist, curvatures about y and z]."""
CURVATURES: tuple[Strain, ...] = ("torsion", "bending_z", "bending_y")
BENDINGS: tuple[Strain, Strain] = ("bending_z", "bending_y")
SHEARED: tuple[tuple[Strain, Strain], ...] = (("shear_y", "bending_y"), ("shear_z", "bending_z"))
"""The shear of each bending plane, of theory "timoshenko"."""

LEAST_OF_PART, WHOLE_PIECE = 3, 1.0 - 1e-9
# Gauss points of a piece beyond its polynomials, and at least (docs/notation.md, section 5)
MORE_POINTS, FEWEST_POINTS = 3, 6
REST_LEFT_OUT = 1e-4
"""Of what turns at rest, by default points: the unloaded axis, an integral of it, is then right to 1e-5 of its length
(tests/flexmb/scene/test_rest_turn.py)."""


def families(body: BeamBody) -> tuple[Family, ...]:
    """The families of a beam: those that it lists, or for which it has polynomials; else all, at level exact all but
    stretch."""
    exact, modes = body.level == "exact", body.modes
    if exact and modes.polynomials is not None:
        return tuple(family for family in FAMILIES if getattr(modes.polynomials, family) > 0)
    if modes.families is not None:
        return modes.families
    return tuple(family for family in FAMILIES if not exact or family != "axial")


def strains(body: BeamBody) -> tuple[Strain, ...]:
    """The strains that a beam has, in the order of STRAINS; none at level rigid."""
    match body.level:
        case "rigid":
            return ()
        case "exact":
            return tuple(polynomials(body))
        case "ruthless" | "linear" | "full" | "stiffened":
            return _of_families(body, families(body))
        case _:
            assert_never(body.level)


def polynomials(body: BeamBody) -> dict[Strain, int]:
    """Number of polynomials of each strain that a beam of level exact has, along each of its pieces, in the order of
    STRAINS."""
    given = body.modes.polynomials
    if given is None:
        return _counts(_of_families(body, families(body)), body.modes.count)
    return {strain: count for strain in STRAINS if (count := getattr(given, strain)) > 0}


def as_fine(body: BeamBody, count: int) -> StrainPolynomials:
    """`count` polynomials of each curvature that the beam has, and of its other strains as many as belong to these."""
    return polynomials_of(strains(body), count)


def polynomials_of(own: Iterable[Strain], count: int) -> StrainPolynomials:
    """`count` polynomials of each curvature of these strains, and of the others as many as belong to these."""
    return StrainPolynomials(**_counts(tuple(own), count))


def _of_families(body: BeamBody, chosen: tuple[Family, ...]) -> tuple[Strain, ...]:
    """The strains of a beam with these families."""
    sheared = {shear for shear, bending in SHEARED if bending in chosen} if body.theory == "timoshenko" else set()
    return tuple(strain for strain in STRAINS if strain in chosen or strain in sheared)


def _counts(own: tuple[Strain, ...], count: int) -> dict[Strain, int]:
    """`count` polynomials of each curvature, and of stretch and shear beside bending two fewer, but one at least."""
    bends = any(strain.startswith("bending") for strain in own)
    fewer = min(count, max(1, count - 2)) if bends else count
    wanted = {strain: count if strain in CURVATURES else fewer for strain in own}
    return {strain: number for strain, number in wanted.items() if number > 0}


def strain_count(body: BeamBody) -> int:
    """Number of coordinates of a beam of level "exact"."""
    return sum(polynomials(body).values()) * piece_count(body)


def points_of_piece(body: BeamBody) -> int:
    """Gauss points along each piece, as many as its polynomials and its curvature at rest take if none are given."""
    if body.modes.points is not None:
        return body.modes.points
    at_rest = max((points_at_rest(part, REST_LEFT_OUT) for part in turns_of_pieces(body)), default=0)
    return max(FEWEST_POINTS, MORE_POINTS + max(polynomials(body).values(), default=0), at_rest)


def points_at_rest(part: RestTurn, left_out: float) -> int:
    """Points along a piece of which this part of it gets as many as its turn takes (`points_of_part`)."""
    needed = follow(part.turn, left_out)
    if part.share > WHOLE_PIECE or needed <= LEAST_OF_PART:
        return needed
    return min(MOST_POINTS, ceil((needed - 1) / part.share))


def points_of_part(points: int, share: float) -> int:
    """Points of a part of a piece with `points`: strains, whose polynomials are the piece's, vary less along it."""
    return points if share > WHOLE_PIECE else min(points, max(LEAST_OF_PART, ceil(points * share) + 1))


def borrows_inertia(body: BeamBody) -> bool:
    """Whether a beam twists although its sections have no inertia about its axis, as `points` has it."""
    return "torsion" in strains(body) and not twists_with_inertia(body)


def twist_inertia(body: BeamBody, stations: list[BeamStation]) -> Real:
    """Inertia per length (n,) kg m of the twist at stations of a beam that `borrows_inertia`; zero for others.

    That which the section states and `points = "line"` leaves out, else m (EIy + EIz) / EA of a homogeneous section.
    ValueError for a station without mass or stiffness.
    """
    if not borrows_inertia(body):
        return np.zeros(len(stations))
    return np.array([_polar(station) for station in stations])


def in_words(body: BeamBody) -> str:
    """What a flexible beam does, what is held, and whose inertia its twist has."""
    own = polynomials(body) if body.level == "exact" else dict.fromkeys(strains(body), 0)
    words = ", ".join(f"{count} {strain}" if count else strain for strain, count in own.items())
    possible = _of_families(body, FAMILIES)
    if held := ", ".join(strain for strain in possible if strain not in own):
        words += f"; held: {held}"
    if body.level == "exact" and (pieces := piece_count(body)) > 1:
        at = ", cut at x = " + ", ".join(f"{x:g}" for x in places) + " m" if (places := cuts(body)) else ""
        words += f"; in each of {pieces} pieces{at}"
    if borrows_inertia(body):
        values = twist_inertia(body, list(body.stations))
        size = " to ".join(dict.fromkeys(f"{value:.3g}" for value in (values.min(), values.max())))
        words += f"; its sections have no inertia about the axis, and the twist has {size} kg m"
    return words


def _polar(station: BeamStation) -> float:
    M, K = inertia_on_axis(station), stiffness_on_axis(station)
    homogeneous = M[0, 0] * (K[ABOUT_Y, ABOUT_Y] + K[ABOUT_Z, ABOUT_Z]) / K[EXTENSION, EXTENSION]
    return float(M[TWIST, TWIST] or homogeneous)
