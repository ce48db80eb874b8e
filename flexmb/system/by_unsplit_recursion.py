"""Accelerations by the unsplit recursion: modes and hinge of a body eliminated together. For single states."""

from __future__ import annotations

from typing import Any

from flexmb.entry import unsplit
from flexmb.system.algorithm import DynamicsAlgorithm
from flexmb.system.mechanics import Mechanics
from flexmb.typing import Real


def _own(system: Mechanics) -> tuple[Any, ...]:
    return system.constants, system._w, system._joint


def _fresh(system: Mechanics) -> tuple[Any, ...]:
    return system.constants, system.workspace(), unsplit.joint(system.constants)


def _observe(system: Mechanics, t: float, y: Real) -> None:
    system._observe_rates(t, y, "unsplit")


ALGORITHM = DynamicsAlgorithm(
    "unsplit",
    "the recursion with modes and hinge of a body eliminated together, for single states",
    lambda: unsplit.accelerations,
    _own,
    _fresh,
    _observe,
)
