"""Signals at other times: taken over where the times are the same, interpolated elsewhere.

Every channel is interpolated separately, by a spline of degree 5; the largest distance from that of degree 3 is
added to its U: it is the error of the lower degree and bounds that of the higher. Velocities are not used for
positions, so that an error in one channel does not spread to another. Quaternions are first given signs that
do not jump, as q and -q are one orientation, then interpolated and normalised.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import make_interp_spline

from crosscheck.judging.against_reference import shared_times
from flexmb.run.channels import distance
from flexmb.typing import Real

DEGREES = (5, 3)
FEWEST = 8  # fewest samples to interpolate from


def resample(channels: Mapping[str, Real], given: Real, wanted: Real) -> tuple[dict[str, Real], dict[str, float]]:
    """Channels (T, k) at the `wanted` times (T,) from those at the times `given`, and what that adds to U (SI).

    Nothing is added, and the second is empty, where all times wanted are among those given.
    """
    places = shared_times(wanted, given)
    if places is not None:
        return {name: rows[places] for name, rows in channels.items()}, {}
    found, doubts = {}, {}
    for name, rows in channels.items():
        high, low = (_interpolated(name, rows, given, wanted, degree) for degree in DEGREES)
        found[name] = high
        doubts[name] = float(np.max(distance(name, high, low)))
    return found, doubts


def _interpolated(name: str, rows: Real, given: Real, wanted: Real, degree: int) -> Real:
    if not name.endswith(".orientation"):
        return np.asarray(make_interp_spline(given, rows, k=degree)(wanted), float)
    turned = np.sum(rows[1:] * rows[:-1], axis=1) < 0.0
    signs = np.cumprod(np.concatenate([[1.0], np.where(turned, -1.0, 1.0)]))
    smooth = np.asarray(make_interp_spline(given, signs[:, None] * rows, k=degree)(wanted), float)
    return smooth / np.maximum(np.linalg.norm(smooth, axis=1, keepdims=True), np.finfo(float).tiny)
