"""The rod at rest: its equations of equilibrium integrated from the clamp by SciPy, with the moment there such that
none is left at the tip.

With the twist tau of the unloaded beam, section axes R, constant force n, moment m, extension and shears gamma, twist
and curvatures kappa, and the section's stiffness K

    r' = R (e_x + gamma),  R' = R (tau e_x + kappa)~,  m' = -r' x n,  [gamma; kappa] = K^-1 [R^T n; R^T m]
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

LENGTH, TWIST, FORCE = 10.0, 0.05 * np.pi, np.array([0.0, 0.0, -4e6])  # m, 1/m, N
STIFFNESS = np.array([2.5e10, 8.2604167e9, 8.2604167e9, 1.41872656e8, 5.20833e8, 1.30208333e8])  # N, N m^2
GROWTH_S = 300.0  # the force grows by 35 x^4 - 84 x^5 + 70 x^6 - 20 x^7, x being the part of this time
STEP = 0.1  # part of the force: the whole of it at once may be balanced by another shape of the rod, too


def exact(times):
    """Position (T, 3) m and unit quaternion (T, 4) of the tip, which is at rest under each force."""
    x, moment, before, tips = np.asarray(times) / GROWTH_S, np.zeros(3), 0.0, []
    for part in x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3):
        for under in np.linspace(before, part, 2 + int(abs(part - before) / STEP))[1:]:
            moment = root(lambda m, under=under: _at_tip(m, under * FORCE)[12:], moment, tol=1e-13).x
        before = part
        tips.append(_at_tip(moment, part * FORCE))
    positions, rotations = np.array(tips)[:, :3], np.array(tips)[:, 3:12].reshape(-1, 3, 3)
    return {"marker:tip.position": positions, "marker:tip.orientation": np.array([_quaternion(R) for R in rotations])}


def _at_tip(moment, force):
    """Position, rotation matrix and moment at the tip (15,) for a moment at the clamp."""
    start = np.concatenate([np.zeros(3), np.eye(3).ravel(), moment])
    return solve_ivp(_slope, (0.0, LENGTH), start, "DOP853", rtol=1e-13, atol=1e-13, args=(force,)).y[:, -1]


def _slope(x, y, force):
    R, m = y[3:12].reshape(3, 3), y[12:]
    strain = np.concatenate([R.T @ force, R.T @ m]) / STIFFNESS
    tangent = R @ (strain[:3] + [1.0, 0.0, 0.0])
    return np.concatenate([tangent, np.cross(R, strain[3:] + [TWIST, 0.0, 0.0]).ravel(), -np.cross(tangent, force)])


def _quaternion(R):
    """Of a turn by less than half a revolution, scalar first."""
    w = 0.5 * np.sqrt(1.0 + np.trace(R))
    return np.array([w, *(np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4.0 * w))])
