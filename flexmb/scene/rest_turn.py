"""How far the sections of an unloaded beam turn, and how many points or polynomials follow such a turn.

Along a piece whose sections turn by theta, places and strains vary as exp(i theta s), 0 < s < 1. Its coefficients in
Legendre's polynomials are spherical Bessel functions of x = theta / 2, which fall from the degree x on as Airy's
function does: at x + a x^(1/3) to exp(-(2 sqrt(2) / 3) a^(3/2)) (Abramowitz & Stegun, 9.3.23 and 10.4.59).
"""

from __future__ import annotations

from itertools import pairwise
from math import ceil, hypot, inf, log, sqrt
from typing import NamedTuple

import numpy as np

from flexmb.scene.bodies import MOST_POINTS, BeamBody, Vector
from flexmb.scene.pieces import edges


class RestTurn(NamedTuple):
    """A part of a piece between stations: the number of the piece, the part's share of it, and an upper bound of the
    angle (rad) by which its sections turn at rest."""

    piece: int
    share: float
    turn: float


def follow(turn: float, left_out: float) -> int:
    """How many polynomials follow a turn (rad) to a part `left_out` of what turns; MOST_POINTS at most."""
    if not turn <= MOST_POINTS:  # also what is no number
        return MOST_POINTS
    reach = (3.0 / (2.0 * sqrt(2.0)) * log(1.0 / left_out)) ** (2.0 / 3.0)
    return ceil(turn / 2.0 + reach * (turn / 2.0) ** (1.0 / 3.0))


def turn_at_rest(body: BeamBody) -> float:
    """Upper bound (rad) of the angle by which the sections of an unloaded beam turn from its root to its tip."""
    return sum(
        turn_between(left.curvature_1_m, right.curvature_1_m, right.x_m - left.x_m)
        for left, right in pairwise(body.stations)
    )


def turn_between(left: Vector, right: Vector, length: float) -> float:
    """The same along a length (m) on which the curvature (1/m) changes linearly."""
    return max(hypot(*left), hypot(*right)) * length


def turns_of_pieces(body: BeamBody) -> list[RestTurn]:
    """The parts of the pieces of a beam that turn at rest."""
    ends, found = edges(body), list[RestTurn]()
    if not 0.0 < body.length_m < inf:
        return found  # a defect of its own
    for left, right in pairwise(body.stations):
        curvatures = hypot(*left.curvature_1_m), hypot(*right.curvature_1_m)
        if not any(curvatures) or not left.x_m < right.x_m:
            continue
        inside = ends[(ends > left.x_m) & (ends < right.x_m)]
        for start, stop in pairwise([left.x_m, *inside.tolist(), right.x_m]):
            size = float(np.max(np.interp([start, stop], [left.x_m, right.x_m], curvatures)))
            piece = min(max(int(np.searchsorted(ends, 0.5 * (start + stop))) - 1, 0), len(ends) - 2)
            found.append(RestTurn(piece, (stop - start) / float(ends[piece + 1] - ends[piece]), size * (stop - start)))
    return found
