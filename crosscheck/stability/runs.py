"""Measures of whole runs, where nothing has a linear model: growth in sampled loops, drift of what is conserved.

For motions without instants `spectrum` (equations that do not change with time) and `flow` (Floquet's multipliers of
those that do) are exact up to rounding, and cheaper.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.stability.map import Measurement
from flexmb.run.trajectory import Trajectory
from flexmb.typing import Real


def growth(run: Trajectory, amplitude: Real) -> Measurement:
    """Growth rate (1/s) of an amplitude (T,), any norm of a disturbance, from the largest ones of the last two thirds.

    What dies out in the first third is not counted. Outputs must be several in a period of the motion, and each third
    several periods long. A run that ended early has failed, except by an event that ends it.
    """
    if not run.finished:
        return Measurement(status="failed", message=run.message)
    third = len(amplitude) // 3
    before, after = np.max(amplitude[third : 2 * third]), np.max(amplitude[2 * third : 3 * third])
    if after <= 0.0 or before <= 0.0:
        return Measurement(status="failed", message="nothing moves: disturb the start")
    return Measurement(float(np.log(after / before) / (run.t[2 * third] - run.t[third])))


def conserved(quaternion: Real, velocity: Real, inertia: Real) -> tuple[Real, Real]:
    """Angular momentum (T,3) about the mass centre and rotational energy (T,) of a rigid body.

    quaternion (T,4) body to World, scalar first; velocity (T,6) [angular; linear] in World axes; inertia (3,),
    principal moments in body axes. Any engine's marker at the mass centre has them.
    """
    R = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    spin = np.einsum("tji,tj->ti", R, velocity[:, :3])
    return np.einsum("tij,tj->ti", R, inertia * spin), 0.5 * np.sum(inertia * spin**2, axis=1)


def drift(values: Real) -> float:
    """log10 of the largest distance of values (T,) or (T,n) from the first, over its norm; rounding counts as 1e-17."""
    rows = values.reshape(len(values), -1)
    return float(np.log10(np.max(np.linalg.norm(rows - rows[0], axis=1)) / np.linalg.norm(rows[0]) + 1e-17))
