"""Accelerations by the unsplit recursion: modes and hinge of a body eliminated together. For single states."""

from __future__ import annotations

from typing import Any

from flexmb.entry import unsplit
from flexmb.entry.observation import Outputs
from flexmb.system.algorithm import DynamicsAlgorithm
from flexmb.system.mechanics import Mechanics
from flexmb.typing import Real


def _accelerations(system: Mechanics, t: float, y: Real) -> Real:
    """Drive loads are left in w.speed.drive."""
    system._check(unsplit.accelerations(t, y, system.constants, system._w, system._joint))
    system._trust(t, y, system._w)
    return system._w.speed["acceleration"].copy()


def _observe(system: Mechanics, t: float, y: Real, out: Outputs) -> None:
    out.rates[:], out.drives[:] = _accelerations(system, t, y), system._w.speed["drive"]
    system._observe_forced(t, y, out)


def _tables(system: Mechanics) -> tuple[Any, ...]:
    return system.constants, system.workspace(), unsplit.joint(system.constants)


ALGORITHM = DynamicsAlgorithm(
    "unsplit",
    "the recursion with modes and hinge of a body eliminated together, for single states",
    _accelerations,
    _observe,
    kernel=lambda system: (unsplit.accelerations, _tables(system)),
)
