"""The rod at rest: its equations of equilibrium integrated from the clamp by SciPy, with the moment there such that
none is left at the tip.

With section axes R, constant force n, moment m, extension and shears gamma, twist and curvatures kappa, and the
section's stiffness K

    r' = R (e_x + gamma),  R' = R kappa~,  m' = -r' x n,  [gamma; kappa] = K^-1 [R^T n; R^T m]
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

NEWTON, METRE = 4.4482216152605, 0.0254  # of a pound and of an inch, in which the data are published
LENGTH, FORCE = 10.0 * METRE, np.array([0.0, 0.0, 150.0 * NEWTON])
STIFFNESS = np.zeros((6, 6))
STIFFNESS[:3, :3] = np.diag([1368.17e3, 88.56e3, 38.78e3]) * NEWTON
STIFFNESS[3:, 3:] = [[16.96e3, 17.61e3, -0.351e3], [17.61e3, 59.12e3, -0.37e3], [-0.351e3, -0.37e3, 141.47e3]]
STIFFNESS[3:, 3:] *= NEWTON * METRE**2
GROWTH_S = 10.0  # the force grows by 35 x^4 - 84 x^5 + 70 x^6 - 20 x^7, x being the part of this time


def exact(times):
    """Position (T, 3) m and unit quaternion (T, 4) of the tip, which is at rest under each force."""
    x, moment, tips = np.asarray(times) / GROWTH_S, np.zeros(3), []
    for part in x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3):
        moment = root(lambda m, part=part: _at_tip(m, part * FORCE)[12:], moment, tol=1e-13).x
        tips.append(_at_tip(moment, part * FORCE))
    positions, rotations = np.array(tips)[:, :3], np.array(tips)[:, 3:12].reshape(-1, 3, 3)
    return {"marker:tip.position": positions, "marker:tip.orientation": np.array([_quaternion(R) for R in rotations])}


def _at_tip(moment, force):
    """Position, rotation matrix and moment at the tip (15,) for a moment at the clamp."""
    start = np.concatenate([np.zeros(3), np.eye(3).ravel(), moment])
    return solve_ivp(_slope, (0.0, LENGTH), start, "DOP853", rtol=1e-13, atol=1e-13, args=(force,)).y[:, -1]


def _slope(x, y, force):
    R, m = y[3:12].reshape(3, 3), y[12:]
    strain = np.linalg.solve(STIFFNESS, np.concatenate([R.T @ force, R.T @ m]))
    tangent = R @ (strain[:3] + [1.0, 0.0, 0.0])
    return np.concatenate([tangent, np.cross(R, strain[3:]).ravel(), -np.cross(tangent, force)])


def _quaternion(R):
    """Of a turn by less than half a revolution, scalar first."""
    w = 0.5 * np.sqrt(1.0 + np.trace(R))
    return np.array([w, *(np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4.0 * w))])
