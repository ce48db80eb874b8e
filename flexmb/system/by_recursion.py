"""Accelerations by articulated bodies: the O(N) recursion."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flexmb.entry import articulated
from flexmb.entry.observation import Outputs, observe
from flexmb.motion import coordinates
from flexmb.system.algorithm import DynamicsAlgorithm, Route
from flexmb.system.mechanics import Mechanics
from flexmb.tables.status import OK
from flexmb.typing import Real

if TYPE_CHECKING:
    from flexmb.closure.closures import ClosedMotion, Closures


def _accelerations(system: Mechanics, t: float, y: Real) -> Real:
    c, w = system.recursion_constants, system._recursion_w
    status = articulated.accelerations(t, y, c, w)
    if status != OK:
        system._check(status, int(w.fault[0]))
    system._trust(t, y, w)
    return w.speed["acceleration"].copy()


def _observe(system: Mechanics, t: float, y: Real, out: Outputs) -> None:
    c, w = system.recursion_constants, system._recursion_w
    status = observe(t, y, c, w, out)
    if status != OK:
        system._check(status, int(w.fault[0]))
    system._trust(t, y, w)


def _tables(system: Mechanics) -> tuple[Any, Any]:
    return system.recursion_constants, system.recursion_workspace()


def _closed_motion(closures: Closures, t: float, y: Real) -> ClosedMotion:
    return closures.motion(t, y)


ALGORITHM = DynamicsAlgorithm(
    "articulated",
    "the O(N) recursion",
    _accelerations,
    _observe,
    kernel=lambda system: (articulated.accelerations, _tables(system)),
    route=lambda system: Route(lambda: _tables(system), articulated.rhs, coordinates.project),
    closed_motion=_closed_motion,
    jacobian=True,
)
