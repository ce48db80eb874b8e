"""The sections of a beam of level exact as jets: rotations and positions alone, whose derivatives follow by jets."""

from __future__ import annotations

import numpy as np

from flexmb.dense.jets import Jet, MovingFrame, constant, product, rotation_exponential, turn
from flexmb.modal.strain_field import LINEAR, SQUARE, STRETCH, WHOLE, StrainField


def section_frames(field: StrainField, eta: Jet) -> MovingFrame:
    """All sections of a beam with strains eta (B,m): position (B,n,3), rotation (B,n,3,3) from the section at rest."""

    def sums(row: int) -> Jet:
        return eta.map(lambda x: np.einsum("jam,bm->bja", field.rows[:, row], x))

    whole, linear, square, stretch = (sums(row) for row in (WHOLE, LINEAR, SQUARE, STRETCH))
    step = rotation_exponential(_magnus(whole, linear, square))
    rotations = list[Jet]()
    for j, before in enumerate(field.before):
        rotations.append(step[:, j] if before < 0 else rotations[before] @ step[:, j])
    rotation = Jet(*(np.stack([getattr(R, part) for R in rotations], axis=1) for part in _PARTS))
    tangent = turn(rotation[:, field.gauss], constant(field.tangent[field.gauss]) + stretch[:, field.gauss])
    change = tangent + constant(-field.tangent[field.gauss])
    moved = change.map(lambda x: np.einsum("jg,bga->bja", field.weight, x))
    return MovingFrame(constant(field.position) + moved, rotation)


def _magnus(whole: Jet, linear: Jet, square: Jet) -> Jet:
    """The rotation vectors (B,n,3) of the intervals: the sixth-order expansion of Blanes, Casas and Ros (2000).

    Theirs is of Y' = A Y, here with Y = R' and A = -k~; alpha are its three sums.
    """
    alpha1, alpha2, alpha3 = -(whole + square.map(lambda x: -x / 12.0)), -linear, -square
    C1 = product(np.cross, alpha1, alpha2)
    C2 = product(np.cross, alpha1, alpha3.map(lambda x: 2.0 * x) + C1).map(lambda x: -x / 60.0)
    outer = alpha1.map(lambda x: -20.0 * x) + -alpha3 + C1
    omega = alpha1 + alpha3.map(lambda x: x / 12.0) + product(np.cross, outer, alpha2 + C2).map(lambda x: x / 240.0)
    return -omega


_PARTS = ("value", "rate", "acceleration")
