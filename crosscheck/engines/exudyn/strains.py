"""Strain energy of a beam's elements from the recorded motion of their ends."""

from __future__ import annotations

import numpy as np

from crosscheck.engines.exudyn.rotations import logarithm
from crosscheck.engines.exudyn.sections import BeamElement
from crosscheck.engines.exudyn.state import CarrierPath
from flexmb.typing import Real


def strain_energy(elements: tuple[BeamElement, ...], paths: dict[int, CarrierPath]) -> Real:
    """(T,) of all elements: half their length times strain' K strain."""
    found = np.zeros(len(paths[-1].position))
    for element in elements:
        left, right = paths[element.left.key], paths[element.right.key]
        turn = np.swapaxes(left.rotation, 1, 2) @ right.rotation
        apart = np.einsum("tji,tj->ti", left.rotation, right.position - left.position)
        found += 0.5 / element.length * (logarithm(turn, apart) - element.rest) ** 2 @ element.stiffness
    return found
