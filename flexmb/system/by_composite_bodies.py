"""Accelerations by composite bodies: the mass matrix, inverse dynamics, and Cholesky's factors."""

from __future__ import annotations

from flexmb.entry import composite
from flexmb.jain.places import matrices
from flexmb.motion import coordinates
from flexmb.system.algorithm import DynamicsAlgorithm, Route

ALGORITHM = DynamicsAlgorithm(
    "composite",
    "the mass matrix and its Cholesky factors",
    lambda: composite.accelerations,
    lambda system: (system.constants, system.own_workspace, system.own_matrices),
    lambda system: (system.constants, system.workspace(), matrices(system.constants)),
    route=lambda system: Route(
        lambda: (system.constants, system.composite_workspace()), composite.rhs, coordinates.project
    ),
    closed_motion=lambda closures, t, y: closures.composite_motion(t, y),
    matrices=2,
)
