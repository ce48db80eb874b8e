"""Strain energy of a beam's elements from the recorded motion of their ends."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.engines.exudyn.rotations import cross_matrices
from crosscheck.engines.exudyn.sections import BeamElement
from crosscheck.engines.exudyn.state import CarrierPath
from flexmb.typing import Real


def strain_energy(elements: tuple[BeamElement, ...], paths: dict[int, CarrierPath]) -> Real:
    """(T,) of all elements: half their length times strain' K strain."""
    found = np.zeros(len(paths[-1].position))
    for element in elements:
        left, right = paths[element.left.key], paths[element.right.key]
        motion = _logarithm(left, right)
        motion[:, 0] -= element.length
        found += 0.5 / element.length * motion**2 @ element.stiffness
    return found


def _logarithm(left: CarrierPath, right: CarrierPath) -> Real:
    """(T,6) [translation; rotation] whose exponential is the motion from one frame to the other, in its axes."""
    turn = Rotation.from_matrix(np.swapaxes(left.rotation, 1, 2) @ right.rotation).as_rotvec()
    apart = np.einsum("tji,tj->ti", left.rotation, right.position - left.position)
    angle = np.linalg.norm(turn, axis=1)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    # coefficient of the square of the cross matrix in the inverse of the mean of exp(s turn~), 0 <= s <= 1
    factor = np.where(small, 1.0 / 12.0, (1.0 - safe / 2.0 / np.tan(safe / 2.0)) / safe**2)
    K = cross_matrices(turn)
    inverse = np.eye(3) - 0.5 * K + factor[:, None, None] * (K @ K)
    return np.concatenate([np.einsum("tij,tj->ti", inverse, apart), turn], axis=1)
