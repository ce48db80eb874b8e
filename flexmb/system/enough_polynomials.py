"""Whether a motion bent beams of level exact more finely than their polynomials can describe.

The coefficients of each curvature in Legendre's polynomials fall geometrically where a strain is smooth. From the
largest and the last two of them follows that of the first polynomial left out, and from it how far sections are off:
P_n of a piece of length L, integrated twice, is L^2 / (2n + 1)^2 at most. Of a single polynomial nothing can be said.
Of two, the second one times theta^2 / 9 is left out, with the turn theta along the piece, as of a beam under a force on
its tip.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flexmb.modal.strain_field import StrainField
from flexmb.scene.bodies import BeamBody
from flexmb.scene.pieces import edges
from flexmb.scene.rest_turn import turns_of_pieces
from flexmb.scene.strains import CURVATURES, Strain, polynomials
from flexmb.system.scene_arrays import SceneArrays
from flexmb.typing import Real

ALLOWED = 3e-3
"""Parts of the beam's length: what four polynomials leave, by this measure, of a beam that a force bends by 83 degrees;
its tip is then off by 1e-4 of the length at most (tests/flexmb/levels/test_watches.py)."""
BEGIN_WITH, MOST = 4, 40
"""Polynomials that a piece should have where it bends far, and can have."""


class Unresolved(NamedTuple):
    """At t (s), the `given` polynomials of a strain along a piece leave out some `position` (m); `enough`: how many
    would do, None where only more pieces help."""

    body: str
    t: float
    strain: Strain
    given: int
    position: float
    enough: int | None

    @property
    def size(self) -> float:
        return self.position

    @property
    def what(self) -> str:
        return (
            f'beam "{self.body}" bends more finely than its polynomials can describe: at t = {self.t:g} s the last of '
            f"the {self.given} of {self.strain} are so large that about {self.position:.1e} m of its shape is left out"
        )

    @property
    def remedy(self) -> str:
        if self.enough is None:
            return "cut it into more `pieces`"
        return f"give its modes {self.enough} polynomials of {self.strain}, or cut it where its strains jump"


def unresolved(arrays: SceneArrays, t: Real, q: Real) -> Iterator[Unresolved]:
    """The beams of level exact whose strains in the states q (T,nq) at t (T,) s are beyond their polynomials."""
    bodies = {body.name: body for body in arrays.scene.bodies if isinstance(body, BeamBody)}
    for link in arrays.links:
        body = bodies.get(link.name)
        field = None if link.is_rigid else link.model.field
        if body is None or field is None or field.columns is None:
            continue
        eta = q[:, arrays.coordinate(f"{body.name}.modes")]
        found = max(_worst(body, t, np.abs(eta @ field.columns.T)), key=lambda finding: finding.position, default=None)
        if found is not None and found.position > ALLOWED * body.length_m:
            yield found


def weights(body: BeamBody, field: StrainField) -> Real:
    """(m,) Of the sizes of modes in a sum that is below 1 where nothing is said: no coefficient left out is larger than
    those that there are."""
    assert field.columns is not None  # of a beam whose strains are polynomials
    lengths, found, column = np.diff(edges(body)), np.zeros(field.columns.shape[1]), 0
    for strain, count in polynomials(body).items():
        for length in lengths:
            left = (length / (2 * count + 1)) ** 2 / (ALLOWED * body.length_m) if strain in CURVATURES else 0.0
            rows = left * np.abs(field.columns[column : column + count])
            found, column = np.max([found, *rows], axis=0), column + count
    return found


def _worst(body: BeamBody, t: Real, size: Real) -> Iterator[Unresolved]:
    """Of each strain and piece the state in which most is left out, by sizes (T,m) of the coefficients."""
    lengths = np.diff(edges(body))
    at_rest = np.zeros(len(lengths))
    for part in turns_of_pieces(body):
        at_rest[part.piece] += part.turn
    blocks, column = dict[tuple[Strain, int], Real](), 0
    for strain, count in polynomials(body).items():
        for piece in range(len(lengths)):
            blocks[strain, piece] = size[:, column : column + count]
            column += count
    for piece, length in enumerate(lengths):
        own = {strain: blocks[strain, piece] for strain in CURVATURES if (strain, piece) in blocks}
        turn = at_rest[piece] + length * np.linalg.norm([strains[:, 0] for strains in own.values()], axis=0)
        for strain, each in own.items():
            if (count := each.shape[1]) > 1:
                first, rate = _left_out(each, turn)
                position = first * (length / (2 * count + 1)) ** 2
                n = int(np.argmax(position))
                allowed = ALLOWED * body.length_m / length**2
                enough = _enough(count, float(first[n]), float(rate[n]), allowed)
                yield Unresolved(body.name, float(t[n]), strain, count, float(position[n]), enough)


def _left_out(size: Real, turn: Real) -> tuple[Real, Real]:
    """The size (T,) of the first coefficient left out, by those of p (T,p), and the rate at which they fall there."""
    count = size.shape[1]
    top = np.max(size, axis=1)
    scaled = size / np.where(top > 0.0, top, 1.0)[:, None]
    if count == 2:
        rate = np.minimum(turn**2 / 9.0, 1.0)
        return size[:, 1] * rate, rate
    largest, rate = np.argmax(size, axis=1), np.zeros(len(size))
    for n in (count - 2, count - 1):
        after = n > largest
        rate = np.maximum(rate, np.where(after, scaled[:, n] ** (1.0 / np.maximum(n - largest, 1)), 0.0))
    rate = np.where(largest == count - 1, 1.0, rate)
    return top * rate ** (count - largest), rate


def _enough(count: int, first: float, rate: float, allowed: float) -> int | None:
    """How many polynomials leave out what is allowed, if further coefficients fall at a rate."""
    for more in range(max(count + 1, BEGIN_WITH), MOST + 1):
        if first * rate ** (more - count) / (2 * more + 1) ** 2 <= allowed:
            return more
    return None
