"""The sections of a beam of level exact as jets: rotations and positions alone, whose derivatives follow by jets."""

from __future__ import annotations

import numpy as np

from flexmb.dense.jets import Jet, MovingFrame, constant, product, rotation_exponential, turn
from flexmb.modal.strain_field import FIRST, MEAN, SECOND, STRETCH, StrainField


def section_frames(field: StrainField, eta: Jet) -> MovingFrame:
    """All sections of a beam with strains eta (B,m): position (B,n,3), rotation (B,n,3,3) from the section at rest."""

    def sums(row: int) -> Jet:
        return eta.map(lambda x: np.einsum("jam,bm->bja", field.rows[:, row], x))

    k1, k2, mean, stretch = (sums(row) for row in (FIRST, SECOND, MEAN, STRETCH))
    commutator = product(np.cross, k1, k2).map(lambda x: field.commutator[:, None] * x)
    step = rotation_exponential(mean + commutator)
    rotations = list[Jet]()
    for j, before in enumerate(field.before):
        rotations.append(step[:, j] if before < 0 else rotations[before] @ step[:, j])
    rotation = Jet(*(np.stack([getattr(R, part) for R in rotations], axis=1) for part in _PARTS))
    tangent = turn(rotation[:, field.gauss], constant(field.tangent[field.gauss]) + stretch[:, field.gauss])
    change = tangent + constant(-field.tangent[field.gauss])
    moved = change.map(lambda x: np.einsum("jg,bga->bja", field.weight, x))
    return MovingFrame(constant(field.position) + moved, rotation)


_PARTS = ("value", "rate", "acceleration")
