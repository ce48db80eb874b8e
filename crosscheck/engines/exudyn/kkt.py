"""Accelerations and multipliers at the initial state, from the constrained equations of motion.

Exudyn's own initial accelerations have errors of 1e-7 in constrained systems; these have errors of 1e-11.
"""

from __future__ import annotations

import numpy as np

from crosscheck.engines.exudyn.assembly import Assembly
from crosscheck.engines.exudyn.beams import PlanarBeam
from crosscheck.engines.exudyn.library import accelerations, equations
from crosscheck.engines.exudyn.rotations import local_rate_map
from crosscheck.engines.exudyn.state import States
from flexmb.typing import Real

_DISTANCE = 1e-3
"""Largest change of a coordinate in the differences along the velocity.

Joints between Euler-parameter bodies have quartic constraints, for which the fourth-order difference is exact; for
relative angles it leaves (1e-3)^4. Round-off is 1e-16 / 1e-3 of the coordinates' rates.
"""


def initial_state(assembly: Assembly | PlanarBeam) -> States:
    """The state at t = 0 with accelerations and multipliers that satisfy M a + C' mu = f and C a = -dC/dt v + d2o/dt2.

    C is the Jacobian of Exudyn's constraints, o the prescribed coordinates.
    """
    mbs = assembly.shop.mbs
    data = mbs.systemData
    with equations(mbs) as system:
        q, v = np.array(data.GetODE2Coordinates()), np.array(data.GetODE2Coordinates_t())
        M, f, C, kept = system.mass(), system.force(), np.zeros((0, system.n)), np.zeros(0)
        if system.k:
            C = system.jacobian()
            dt = _DISTANCE / max(1.0, np.abs(v).max())
            near, far = (system.jacobian(q + h * v) - system.jacobian(q - h * v) for h in (dt, 2.0 * dt))
            data.SetODE2Coordinates(q)
            kept = -(8.0 * near - far) / (12.0 * dt) @ v + _prescribed_accelerations(assembly, system.k)
        a, multipliers = accelerations(M, f, C, kept)
    stored = np.array(data.GetDataCoordinates())
    return States(np.zeros(1), q[None], v[None], a[None], multipliers[None], stored[None])


def _prescribed_accelerations(assembly: Assembly | PlanarBeam, size: int) -> Real:
    """Second derivatives of the offsets in the rows of their constraints (coordinate - offset = 0)."""
    accelerations = np.zeros(size)
    for constraint, profile in assembly.prescribed:
        accelerations[assembly.shop.mbs.systemData.GetObjectLTGAE(constraint)[0]] = profile(0.0).acceleration
    return accelerations


def body_mass_matrix(assembly: Assembly, body: str) -> Real:
    """Mass matrix (m+6, m+6) of a flexible body in its initial state, [modes; angular; linear] in scene body axes.

    Exudyn's matrix for [World position, rotation coordinates, modes] by congruence with the map from these speeds.
    """
    placed, shop = assembly.bodies[body], assembly.shop
    data = shop.mbs.systemData
    data.SetODE2Coordinates(data.GetODE2Coordinates(shop.exu.ConfigurationType.Initial))
    carrier, m = placed.carrier, len(placed.eta)
    M = np.array(shop.mbs.ComputeItem(carrier.flexible, shop.exu.ComputeItemType.MassMatrix))
    A = placed.motion.rotation @ carrier.zero.T
    turning = len(M) - m - 3
    T = np.zeros((len(M), m + 6))
    T[:3, m + 3 :] = A @ carrier.zero
    if shop.explicit:
        T[3:6, m : m + 3] = carrier.zero
    else:
        p = np.array(shop.mbs.GetNodeParameter(carrier.node, "referenceCoordinates"))[3:7]
        T[3:7, m : m + 3] = local_rate_map(p).T @ carrier.zero / 4.0
    T[3 + turning :, :m] = np.eye(m)
    return T.T @ M @ T
