"""The Princeton beam at rest by shooting: a truth that shares nothing with flexmb.

A rod with stretch, shear, twist and bending, straight at rest, clamped at 0 and under a dead force f at its tip. Along
the arc s, with the rotation R of the section (Simo and Vu-Quoc 1986, eq. 3.1 and 5.1, of which this is the static case
with linear laws),

    r' = R (e1 + gamma),  R' = R [kappa]x,  m' = -r' x f,
    gamma = (n1/EA, n2/GAy, n3/GAz),  kappa = (M1/GJ, M2/EIy, M3/EIz),  n = R^T f,  M = R^T m

The unknown moment (3,) at the clamp is that for which the moment at the tip vanishes.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from flexmb.scene.schema import BeamBody, BeamStation
from flexmb.typing import Real

RTOL = 1e-13
SHARES = (0.25, 0.5, 0.75, 1.0)  # of the force, by which the moment is followed from zero


def tip(beam: BeamBody, force: Real) -> Real:
    """Place (3,) in m of the tip of a uniform beam under a dead force (3,) in N, in the clamp's axes.

    RuntimeError where shooting does not converge.
    """
    station, moment = beam.stations[0], np.zeros(3)
    for share in SHARES:
        found = root(lambda m, f: _shot(beam, station, m, f)[7:], moment, args=(share * force,), tol=1e-13)
        moment = found.x
    if np.max(np.abs(found.fun)) > 1e-11 * np.linalg.norm(force) * beam.length_m:
        raise RuntimeError(f"the moment at the tip is {found.fun} N m: {found.message}")
    return _shot(beam, station, moment, force)[:3]


def _shot(beam: BeamBody, station: BeamStation, moment: Real, force: Real) -> Real:
    """Place, quaternion and moment (10,) at the tip for a moment at the clamp."""
    start = np.concatenate([np.zeros(3), [1.0, 0.0, 0.0, 0.0], moment])
    stretch = np.array([station.EA_N, station.GAy_N, station.GAz_N])
    bending = np.array([station.GJ_Nm2, station.EIy_Nm2, station.EIz_Nm2])

    def along(s: float, y: Real) -> Real:
        w, x = y[3], y[4:7]
        R = np.eye(3) * (w**2 - x @ x) + 2.0 * np.outer(x, x) + 2.0 * w * np.cross(np.eye(3), x)
        slope = R @ (np.array([1.0, 0.0, 0.0]) + R.T @ force / stretch)
        kappa = R.T @ y[7:] / bending
        turned = np.append(-x @ kappa, w * kappa + np.cross(x, kappa)) / 2.0
        return np.concatenate([slope, turned, -np.cross(slope, force)])

    return solve_ivp(along, (0.0, beam.length_m), start, "DOP853", rtol=RTOL, atol=1e-15).y[:, -1]
