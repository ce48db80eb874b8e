"""The strains of a beam of level "exact": how many polynomials each has, and at how many Gauss points they are seen."""

from __future__ import annotations

from typing import Literal

from flexmb.scene.bodies import BeamBody
from flexmb.scene.pieces import piece_count
from flexmb.scene.sections import twists_with_inertia

Strain = Literal["axial", "shear_y", "shear_z", "torsion", "bending_z", "bending_y"]
STRAINS: tuple[Strain, ...] = ("axial", "shear_y", "shear_z", "torsion", "bending_z", "bending_y")
"""In the order of the rows [stretch, shears; twist, curvatures about y and z]."""
CURVATURES: tuple[Strain, ...] = ("torsion", "bending_z", "bending_y")

# Gauss points of a piece beyond its polynomials, and at least (docs/notation.md, section 5)
MORE_POINTS, FEWEST_POINTS = 3, 6


def polynomials(body: BeamBody) -> dict[Strain, int]:
    """Number of polynomials of each strain that the beam has, along each of its pieces, in the order of STRAINS."""
    given, count = body.modes.polynomials, body.modes.count
    if given is not None:
        wanted = {strain: int(getattr(given, strain)) for strain in STRAINS}
    else:
        wanted = {strain: count if strain in body.modes.families else 0 for strain in CURVATURES}
        if not twists(body):
            wanted["torsion"] = 0
        if body.theory == "timoshenko":
            pairs: tuple[tuple[Strain, Strain], ...] = (("shear_y", "bending_y"), ("shear_z", "bending_z"))
            for shear, bending in pairs:
                wanted[shear] = max(1, wanted[bending] - 2) if wanted[bending] else 0
    return {strain: wanted[strain] for strain in STRAINS if wanted.get(strain, 0) > 0}


def strain_count(body: BeamBody) -> int:
    """Number of coordinates of a beam of level "exact"."""
    return sum(polynomials(body).values()) * piece_count(body)


def points_of_piece(body: BeamBody) -> int:
    """Gauss points along each piece."""
    if body.modes.points is not None:
        return body.modes.points
    return max(FEWEST_POINTS, MORE_POINTS + max(polynomials(body).values(), default=0))


def twists(body: BeamBody) -> bool:
    """Whether something of the beam has an inertia about its axis, without which a straight beam has no torsion."""
    lumps = any(lump.inertia_kg_m2[0][0] > 0.0 or any(lump.com_m[1:]) for lump in body.tip_masses)
    return lumps or twists_with_inertia(body)
