"""Whether a motion bent beams of level exact more than their points can follow.

Between neighbouring sections rotations have an error of the seventh order in the turn between them, and positions are
integrals of polynomials through the Gauss points. What both leave is measured: the same strains are seen at more than
twice as many points, where the first error is below a hundredth of what it was. Only beams that turn by more than
SMALL_TURN between neighbouring points are looked at, at the times of their largest such turn and of their largest turn
in all.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flexmb.modal.exact import field_of_points
from flexmb.modal.strain_field import WHOLE, StrainField
from flexmb.scene.bodies import MOST_POINTS, BeamBody
from flexmb.scene.pieces import piece_count
from flexmb.scene.rest_turn import follow, turns_of_pieces
from flexmb.scene.strains import points_of_piece
from flexmb.system.moved_sections import moved_sections
from flexmb.system.scene_arrays import SceneArrays
from flexmb.typing import Real

ALLOWED = 1e-4
"""rad, and parts of the beam's length: a third of what four polynomials leave of a beam that swings bent by 82 degrees,
whose six points leave 6e-5."""
SMALL_TURN = 0.5
"""rad: between points that turn by less, nothing of ALLOWED's size is lost. The seventh order of Magnus' expansion
leaves 3e-5 rad of random strains where they turn by 0.6, and six points 6e-5 of the length where a plane beam turns by
0.47. Looking closer takes longer than a short run, so that what is harmless is not looked at."""
_SEEN_AT = 4
"""The parts of a beam at whose ends places and rotations are compared."""
_MOST = 2e7
"""Numbers in the tables of the finer sections. Beams beyond have so many pieces that turns in them are small."""


class Unfollowed(NamedTuple):
    """At t (s), the `points` along each piece of a beam put its sections `position` (m) and `rotation` (rad) away from
    where its strains have them; length (m) of the beam. `enough`: points that would do, None where only more pieces
    help."""

    body: str
    t: float
    points: int
    position: float
    rotation: float
    enough: int | None
    length: float

    @property
    def size(self) -> float:
        return max(self.rotation, self.position / self.length)

    @property
    def what(self) -> str:
        return (
            f'beam "{self.body}" bends more than its points can follow: at t = {self.t:g} s, {self.points} of them '
            f"along each piece put its sections {self.position:.1e} m and {self.rotation:.1e} rad from where its "
            f"strains have them"
        )

    @property
    def remedy(self) -> str:
        return "cut it into more `pieces`" if self.enough is None else f"give its modes points = {self.enough}"


def unfollowed(arrays: SceneArrays, t: Real, q: Real) -> Iterator[Unfollowed]:
    """The beams of level exact that the states q (T,nq) at t (T,) s bend too far for their points."""
    bodies = {body.name: body for body in arrays.scene.bodies if isinstance(body, BeamBody)}
    for link in arrays.links:
        body = bodies.get(link.name)
        field = None if link.is_rigid else link.model.field
        if body is None or field is None:
            continue
        eta = q[:, arrays.coordinate(f"{body.name}.modes")]
        most = [_error(body, eta[i], float(t[i]), turn) for i, turn in _suspects(field, eta)]
        yield from sorted((finding for finding in most if finding is not None), key=lambda finding: -finding.size)[:1]


def weights(field: StrainField) -> Real:
    """(m,) Of the sizes of strains in a sum that is below 1 where nothing is looked at."""
    return np.max(np.linalg.norm(field.rows[: field.steps, WHOLE], axis=1), axis=0, initial=0.0) / SMALL_TURN


def _suspects(field: StrainField, eta: Real) -> list[tuple[int, float]]:
    """The numbers of the strains eta (T,m) that are worth a closer look, at most two, and their turn (rad) in all."""
    turns = np.linalg.norm(np.einsum("jam,tm->tja", field.rows[: field.steps, WHOLE], eta), axis=2)
    largest, whole = turns.max(axis=1), turns.sum(axis=1)
    found = {int(np.argmax(sizes)) for sizes in (largest, whole)}
    return [(i, float(whole[i])) for i in sorted(found) if largest[i] > SMALL_TURN]


def _error(body: BeamBody, eta: Real, t: float, turn: float) -> Unfollowed | None:
    """What the points of the beam leave of these strains (m,), which turn by so many rad, if it is beyond ALLOWED."""
    points = points_of_piece(body)
    at_rest = max((part.turn for part in turns_of_pieces(body)), default=0.0)
    finest = max(2 * points + 8, follow(turn + at_rest, ALLOWED**2))
    if 12.0 * finest * piece_count(body) * len(eta) > _MOST:
        return None
    truth = _seen(body, finest, eta)

    def left(points: int) -> tuple[float, float]:
        return _apart(_seen(body, points, eta), truth)

    def is_enough(left: tuple[float, float]) -> bool:
        return left[0] <= ALLOWED * body.length_m and left[1] <= ALLOWED

    position, rotation = left(points)
    if is_enough((position, rotation)):
        return None
    few, enough = points, finest
    while enough - few > 1:
        middle = (few + enough) // 2
        few, enough = (few, middle) if is_enough(left(middle)) else (middle, enough)
    needed = enough if enough < min(finest, MOST_POINTS) else None
    return Unfollowed(body.name, t, points, position, rotation, needed, body.length_m)


def _seen(body: BeamBody, points: int, eta: Real) -> tuple[Real, Real]:
    """Positions (n,3) and rotations (n,3,3) of sections along the beam."""
    places = np.linspace(0.0, body.length_m, _SEEN_AT + 1)[1:]
    none = np.zeros(len(eta))
    moved = moved_sections(field_of_points(body, points, places), eta, none, none)
    return moved.r[-_SEEN_AT:], moved.R[-_SEEN_AT:]


def _apart(found: tuple[Real, Real], truth: tuple[Real, Real]) -> tuple[float, float]:
    """The largest distance of positions (m), and angle of rotations (rad), which is that of a small rotation."""
    turned = np.einsum("nba,nbc->nac", truth[1], found[1])
    skew = (turned - np.swapaxes(turned, 1, 2)) / 2.0
    sine = np.linalg.norm(skew, axis=(1, 2)) / np.sqrt(2.0)
    angle = np.arctan2(sine, (np.trace(turned, axis1=1, axis2=2) - 1.0) / 2.0)
    return float(np.linalg.norm(found[0] - truth[0], axis=1).max()), float(angle.max())
