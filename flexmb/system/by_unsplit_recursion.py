"""Accelerations by the unsplit recursion: modes and hinge of a body eliminated together. For single states."""

from __future__ import annotations

from flexmb.entry import unsplit
from flexmb.system.algorithm import DynamicsAlgorithm

ALGORITHM = DynamicsAlgorithm(
    "unsplit",
    "the recursion with modes and hinge of a body eliminated together, for single states",
    lambda: unsplit.accelerations,
    lambda system: (system.constants, system.own_workspace, system.own_joint),
    lambda system: (system.constants, system.workspace(), unsplit.joint(system.constants)),
)
