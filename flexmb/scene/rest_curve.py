"""The unloaded axis of a beam whose stations have curvature: position and rotation of its sections.

With curvature and twist kappa in section axes, R' = R kappa~ and r' = R e_x. On spans that turn by less than a radian
the quaternion of R and then r are found by collocation at Gauss points, to rounding errors.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from math import ceil
from typing import NamedTuple

import numpy as np

from flexmb.scene.bodies import BeamBody, BeamStation
from flexmb.scene.collocation import gauss_rule, partial_integrals
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.rest_turn import turn_at_rest, turn_between
from flexmb.scene.rounding import ROUNDING
from flexmb.scene.sizes import refuse_beyond
from flexmb.typing import Real

_Station = tuple[float, tuple[float, float, float]]  # x in m, curvature in 1/m
POINTS = 16
"""Gauss points of a span: the error of a solution that turns by one radian is some (1/2)^32 / 32!."""


MOST_TURN = 10_000.0
"""Radians by which an unloaded axis may turn: each takes a third of a millisecond. Coils of 1,500 turns stay below."""


class _Spans(NamedTuple):
    """Spans (S,) with p Gauss points at `start` + length/2 (1 + xi). There quaternions change at the rates (S,p,4), and
    the axis runs along the directions (S,p,3), from quaternion (S,4) and position (S,3) at the start."""

    start: Real
    length: Real
    quaternion: Real
    position: Real
    rates: Real
    directions: Real


def is_curved(body: BeamBody) -> bool:
    """Whether the unloaded axis of a beam is curved or twisted."""
    return any(is_bent(station, body.length_m) for station in body.stations)


def is_bent(station: BeamStation, length: float) -> bool:
    """Whether a beam of this length (m) would turn by more than rounding with the curvature of a station."""
    return any(
        not abs(component) * length <= ROUNDING for component in station.curvature_1_m
    )  # so is what is no number


def rest_sections(body: BeamBody, x: Real) -> tuple[Real, Real]:
    """Position (n,3) and rotation (n,3,3), section to body axes, of the unloaded sections at x (n,) m.

    ValueError for a beam that turns by more than MOST_TURN, before anything is computed; `check_scene` names the place.
    """
    x = np.asarray(x, float)
    if not is_curved(body):
        zero = np.zeros_like(x)
        return np.column_stack([x, zero, zero]), np.tile(np.eye(3), (len(x), 1, 1))
    remedy = "correct curvature_1_m, or divide the beam into several that are welded together"
    refuse_beyond(turn_at_rest(body), MOST_TURN, f'body "{body.name}" turns at rest by', remedy, "rad")
    spans = _spans(_stations(body))
    at = np.maximum(np.searchsorted(spans.start, x, side="right") - 1, 0)
    start, length, quaternion, position, rates, directions = (span[at] for span in spans)
    rows = length[:, None] / 2.0 * partial_integrals(2.0 * (x - start) / length - 1.0, POINTS)
    turned = quaternion + np.einsum("np,npk->nk", rows, rates)
    return position + np.einsum("np,npk->nk", rows, directions), rotation_matrix(turned)


def _stations(body: BeamBody) -> tuple[_Station, ...]:
    return tuple((station.x_m, station.curvature_1_m) for station in body.stations)


@lru_cache(maxsize=128)
def _spans(stations: tuple[_Station, ...]) -> _Spans:
    quaternion, position = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
    spans = []
    xi, _ = gauss_rule(POINTS)
    inner, whole = partial_integrals(xi, POINTS), partial_integrals(np.ones(1), POINTS)[0]
    for (left, first), (right, last) in pairwise(stations):
        count = max(1, ceil(turn_between(first, last, right - left)))
        for start, stop in zip(*_ends(left, right, count), strict=True):
            if stop == start:
                continue
            half = (stop - start) / 2.0
            middle = start + half * (1.0 + xi)
            # Within the interval of these two stations: at a jump, np.interp could not tell its sides apart.
            share = ((middle - left) / (right - left))[:, None]
            kappa = (1.0 - share) * np.array(first) + share * np.array(last)
            # q at the Gauss points: q_i = q_0 + half sum_j inner_ij 1/2 Omega(kappa_j) q_j
            rate = 0.5 * np.array([_right_product(k) for k in kappa])
            system = np.eye(4 * POINTS) - half * np.einsum("ij,jab->iajb", inner, rate).reshape(4 * POINTS, -1)
            at_points = np.linalg.solve(system, np.tile(quaternion, POINTS)).reshape(POINTS, 4)
            rates = np.einsum("jab,jb->ja", rate, at_points)
            directions = rotation_matrix(at_points)[:, :, 0]
            spans.append((start, stop - start, quaternion, position, rates, directions))
            quaternion, position = quaternion + half * whole @ rates, position + half * whole @ directions
    return _Spans(*map(np.array, zip(*spans, strict=True)))


def _ends(left: float, right: float, count: int) -> tuple[Real, Real]:
    breaks = np.linspace(left, right, count + 1)
    return breaks[:-1], breaks[1:]


def _right_product(kappa: Real) -> Real:
    """The matrix (4,4) of q -> q (0, kappa)."""
    x, y, z = kappa
    return np.array([[0.0, -x, -y, -z], [x, 0.0, z, -y], [y, -z, 0.0, x], [z, y, -x, 0.0]])
