"""The sections of a beam whose strains are sums of modes, and the tables from which their exact motion follows.

In a frame that is fixed to the root, section j of the loaded beam is at r_j, turned by R_j from its unloaded place
r0_j. With the elastic curvature k(s) = sum B_n(s) eta_n, the elastic stretch and shears g(s) = sum G_n(s) eta_n, both
of the unloaded section but written in the axes of the root, and the unloaded tangent t0,

    R' = R k~            r' = R (t0 + g)

Between one section and the next, R advances by exp(Omega~) with Magnus' expansion to the sixth order, from three
integrals of k over the interval (`flexmb.spatial.magnus`): it is exact where k keeps its direction. Positions are
collocated: r_i - r0_i = sum_j A_ij (R_j (t0_j + g_j) - t0_j), where A_ij is the integral up to section i of Lagrange's
polynomials on the Gauss points j of the beam.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexmb.modal.section import section_table
from flexmb.scene.bodies import BeamBody
from flexmb.scene.collocation import gauss_rule, partial_integrals
from flexmb.scene.pieces import edges
from flexmb.scene.rest_curve import rest_sections
from flexmb.scene.strains import STRAINS, points_of_part, points_of_piece, polynomials
from flexmb.typing import Index, Real

WHOLE, LINEAR, SQUARE, STRETCH = range(4)
"""Tables of a section: int k, 6 int P_1 k and 30 int P_2 k over the interval before it, with Legendre's polynomials
P_n; g at the section."""


@dataclass(frozen=True, eq=False)
class StrainField:
    """n sections of a beam with m strain modes, in the axes of a body frame that is fixed to the root.

    x (n,) m along the beam; before (n,): the section from which R is advanced, -1 for the root; position (n,3) m and
    tangent (n,3) at rest; rows (n,4,3,m): WHOLE, LINEAR, SQUARE, STRETCH for each mode; weight (n,q) m: A_ij, whose
    columns are the q Gauss points; gauss (q,): their numbers. The first `steps` sections are these points and the ends
    of the intervals that they lie in; others turn from these. columns (p,m): the modes in Legendre's polynomials, in
    the order of `strain_field`; None where they are these polynomials.

    base (n,): the section at the inboard end of the interval in which a section lies, -1 for the root; own (n,2): the
    first of the Gauss points of that interval, and that after its last. What the points before it add to a section they
    add to its base, so that a position is that of the base and an integral over the own points.
    """

    x: Real
    before: Index
    position: Real
    tangent: Real
    rows: Real
    weight: Real
    gauss: Index
    steps: int
    base: Index
    own: Index
    columns: Real | None = None

    @property
    def mode_count(self) -> int:
        return self.rows.shape[-1]

    def seen_from(self, origin: Real, turn: Real) -> StrainField:
        """The same sections in other axes, R_new_old = `turn`, with the new origin at `origin` (3,) in the old axes."""
        return replace(
            self,
            position=(self.position - origin) @ turn.T,
            tangent=self.tangent @ turn.T,
            rows=np.einsum("ab,ncbm->ncam", turn, self.rows),
        )

    def with_modes(self, columns: Real) -> StrainField:
        """The field of other modes, which are the `columns` (m,k) of the present ones."""
        known = columns if self.columns is None else self.columns @ columns
        return replace(self, rows=self.rows @ columns, columns=known)

    def shapes(self) -> tuple[Real, Real]:
        """Mode shapes (n,3,m) at rest: rotations and translations of the sections."""
        turn = np.zeros(self.rows[:, WHOLE].shape)
        for j, i in enumerate(self.before):
            turn[j] = self.rows[j, WHOLE] + (turn[i] if i >= 0 else 0.0)
        rate = np.cross(turn, self.tangent[:, :, None], axis=1) + self.rows[:, STRETCH]
        return turn, np.einsum("ij,jam->iam", self.weight, rate[self.gauss])

    @property
    def axis(self) -> Real | None:
        """The unit axis (3,) about which all sections turn, if there is one; None for turns about several."""
        turning = np.moveaxis(self.rows[:, :STRETCH], 2, -1).reshape(-1, 3)
        size = np.linalg.norm(turning, axis=1)
        if not np.any(size):
            return None
        axis = turning[np.argmax(size)] / size.max()
        across = np.linalg.norm(turning - np.outer(turning @ axis, axis), axis=1)
        return axis if across.max() <= STRAIGHT * size.max() else None


STRAIGHT = 64.0 * np.finfo(float).eps
"""Relative size below which the part of curvatures across a common axis is a rounding error of the frames."""


@dataclass(frozen=True, eq=False)
class Hung:
    """The sections of a beam from which its places turn: before (n,), and the intervals (n,) that the places lie in."""

    before: Index
    interval: Index

    def following(self, like: Hung) -> Index:
        """The sections (n,) of `like`, except for places in another interval than there, whose strains are others.

        A place at a Gauss point then has one section on both sides of the point, and a smooth motion as a function of
        where it is. In an interval the strains are polynomials, so that it may lie on either side of its section.
        """
        return np.where(self.interval == like.interval, like.before, self.before)


def hung(body: BeamBody, places: Real) -> Hung:
    """How sections at `places` (n,) m turn: from the last Gauss point, or end of an interval, at or before them."""
    _, gauss, breaks = _grid(body)
    before = np.searchsorted(_main(gauss, breaks), places, side="right") - 1
    return Hung(before, np.searchsorted(breaks[1:-1], places, side="right"))


def _main(gauss: Real, breaks: Real) -> Real:
    """The Gauss points, and the ends of the intervals that they lie in."""
    return np.unique(np.concatenate([gauss, breaks[1:-1]]))


def strain_field(body: BeamBody, places: Real, hung_from: Index | None = None) -> StrainField:
    """The sections of a beam at the Gauss points, then at `places` (n,) m; the modes are Legendre's polynomials.

    Strain by strain in the order of `flexmb.scene.strains.polynomials`, in each piece by piece, by ascending degree.
    hung_from (n,): the sections from which the places turn, those of `hung` if left out.
    """
    grid, gauss, breaks = _grid(body)
    main = _main(gauss, breaks)
    if hung_from is None:
        hung_from = hung(body, places).before
    before = np.concatenate([np.arange(-1, len(main) - 1), hung_from])
    x = np.concatenate([main, places])
    left = np.where(before >= 0, x[before], 0.0)
    h = x - left
    position, rotation = rest_sections(body, x)
    shapes = _Polynomials(body)
    gauss_at, ends = np.searchsorted(main, gauss), np.searchsorted(main, breaks[1:-1])
    within = np.searchsorted(breaks[1:-1], x, side="right")  # number of the interval of each section
    within[ends] = np.arange(len(ends))  # the end of an interval is among its own sections
    first = np.cumsum([0, *(count for _, _, count in grid)])
    rows = np.stack([*_moments(body, left, h, shapes), rotation @ shapes.at(x)[:, :3]], axis=1)
    return StrainField(
        x=x,
        before=before,
        position=position,
        tangent=rotation[:, :, 0],
        rows=rows,
        weight=_weights(x, grid, gauss),
        gauss=gauss_at,
        steps=len(main),
        base=np.concatenate([[-1], ends])[within],
        own=np.stack([first[within], first[within + 1]], axis=1),
    )


class _Polynomials:
    """Legendre's polynomials of all strains on the pieces of a beam."""

    def __init__(self, body: BeamBody) -> None:
        self._counts, self._edges = polynomials(body), edges(body)
        self._pieces = len(self._edges) - 1

    def at(self, x: Real, within: Real | None = None) -> Real:
        """(n,6,m) [stretch, shears; twist, curvatures] of each mode at x (n,) m, in the pieces of the points `within`:
        at an edge there are two."""
        inside = x if within is None else within
        piece = np.clip(np.searchsorted(self._edges, inside, side="right") - 1, 0, self._pieces - 1)
        xi = 2.0 * (x - self._edges[piece]) / np.diff(self._edges)[piece] - 1.0
        fields_of_strains = np.zeros((len(x), 6, sum(self._counts.values()) * self._pieces))
        column = 0
        for strain, count in self._counts.items():
            values = np.polynomial.legendre.legvander(xi, count - 1)
            for piece_number in range(self._pieces):
                fields_of_strains[:, STRAINS.index(strain), column : column + count] = (
                    values * (piece == piece_number)[:, None]
                )
                column += count
        return fields_of_strains


def _moments(body: BeamBody, left: Real, h: Real, shapes: _Polynomials) -> Real:
    """WHOLE, LINEAR and SQUARE (3,n,3,m) of the intervals from `left` (n,) of length h (n,), which lie in the piece
    that begins at or before it, by Gauss points enough for all digits."""
    degree = max(polynomials(body).values())
    xi, w = gauss_rule(degree + 12)
    factors = 0.5 * w * np.array([1.0, 6.0, 30.0])[:, None] * np.polynomial.legendre.legvander(xi, 2).T
    points = left + 0.5 * h * (1.0 + xi[:, None])
    rotations = rest_sections(body, points.ravel())[1].reshape(*points.shape, 3, 3)
    moments = np.zeros((3, *shapes.at(left)[:, 3:].shape))
    for x, rotation, factor in zip(points, rotations, factors.T, strict=True):
        moments += factor[:, None, None, None] * (h[:, None, None] * (rotation @ shapes.at(x, within=left)[:, 3:]))
    return moments


def _grid(body: BeamBody) -> tuple[list[tuple[float, float, int]], Real, Real]:
    """Intervals with their numbers of Gauss points, these points, and the ends of the intervals (m).

    The intervals end where pieces do and where the section's data have a kink. One that is shorter than a piece has
    fewer points, because the strains vary less along it.
    """
    ends = edges(body)
    breaks = np.unique(np.concatenate([ends, _kinks(body)]))
    breaks = breaks[np.concatenate([[True], np.diff(breaks) > 1e-12 * body.length_m])]
    whole = points_of_piece(body)
    intervals = []
    for left, right in zip(breaks[:-1], breaks[1:], strict=True):
        piece = np.searchsorted(ends, 0.5 * (left + right)) - 1
        share = (right - left) / (ends[piece + 1] - ends[piece])
        intervals.append((float(left), float(right), points_of_part(whole, share)))
    gauss = np.concatenate([left + (right - left) / 2.0 * (1.0 + gauss_rule(n)[0]) for left, right, n in intervals])
    return intervals, gauss, breaks


def _kinks(body: BeamBody) -> Real:
    """Stations inside the beam (n,) m, but not an outermost one beyond which the data go on as before it.

    The length of a beam with a station at its tip is then a number like others, by which motions have a derivative.
    """
    table = section_table(body)
    curvature = np.array([s.curvature_1_m for s in sorted(body.stations, key=lambda station: station.x_m)])
    data = np.hstack([table.stiffness.reshape(-1, 36), table.inertia.reshape(-1, 36), curvature])
    inside = (table.x > 0.0) & (table.x < body.length_m)
    if len(data) > 1:
        for end, neighbour in ((0, 1), (-1, -2)):
            inside[end] &= bool(np.any(data[end] != data[neighbour]))
    return table.x[inside]


def _weights(x: Real, grid: list[tuple[float, float, int]], gauss: Real) -> Real:
    """A (n,q): the integrals from 0 to x (n,) of Lagrange's polynomials on the Gauss points of each interval."""
    found, column = np.zeros((len(x), len(gauss))), 0
    for left, right, count in grid:
        inside = np.clip(2.0 * (x - left) / (right - left) - 1.0, -1.0, 1.0)
        found[:, column : column + count] = (right - left) / 2.0 * partial_integrals(inside, count)
        found[x <= left, column : column + count] = 0.0
        column += count
    return found


def gauss_weights(body: BeamBody) -> tuple[Real, Real]:
    """The Gauss points of the beam (q,) m, and their weights (q,) m."""
    grid, gauss, _ = _grid(body)
    weights = [(right - left) / 2.0 * gauss_rule(n)[1] for left, right, n in grid]
    return gauss, np.concatenate(weights)


def strain_stiffness(body: BeamBody, section: Real, x: Real, weight: Real) -> Real:
    """K (m,m) = int B' C B of the polynomials, by points x (p,) m with these weights, where C is `section` (p,6,6)."""
    B = _Polynomials(body).at(x)
    return np.asarray(np.einsum("p,pam,pab,pbn->mn", weight, B, section, B, optimize=True))
