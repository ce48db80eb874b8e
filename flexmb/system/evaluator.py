"""Accelerations of a tree again and again: an algorithm with a workspace and arrays that it uses again."""

from __future__ import annotations

from typing import Any

from flexmb.entry.gate import DOUBTED, OVERFLOWN, REFUSED, accelerations, gate
from flexmb.jit.direct import ADDRESS, addresses, bound, settled
from flexmb.jit.pointer import REAL, STATUS, VECTOR
from flexmb.system.algorithm import DynamicsAlgorithm
from flexmb.system.mechanics import Mechanics
from flexmb.tables.state import finite_result
from flexmb.tables.status import OK
from flexmb.typing import Real


class Evaluator:
    """`evaluator(t, q, u)`: udot (nu,) at time t (s), q (nq,) and u (nu,), in an array that every call writes anew.

    `System.evaluator` makes one. The array, `accelerations`, is for reading; copy what is to be kept. Arrays of floats
    in C order go in as they are; what else `System.evaluate` takes is converted. An evaluator writes into its own
    workspace: one per thread.
    """

    def __init__(self, system: Mechanics, algorithm: DynamicsAlgorithm, tables: tuple[Any, ...]) -> None:
        """tables: what the algorithm's kernel takes after t and y, the workspace second."""
        self._system, self._algorithm, self._w = system, algorithm, tables[1]
        behind = addresses(algorithm.kernel(), STATUS, REAL, VECTOR, *tables)
        passed = gate(system.layout.quaternions, system.nq, self._w.speed, self._w.doubt, behind)
        entry = settled(accelerations, ADDRESS, REAL, VECTOR, VECTOR)
        self._enter = bound(entry, (passed._address,), passed, tables)  # type: ignore[attr-defined]
        self.accelerations: Real = passed.rates.view()
        self.accelerations.flags.writeable = False

    def __call__(self, t: float, q: Real, u: Real) -> Real:
        """Raises ValueError, TypeError and DynamicsError as `System.evaluate` does."""
        try:
            status = self._enter(t, q, u) if type(t) is float else REFUSED
        except TypeError:  # arrays of another type
            status = REFUSED
        if status != OK:
            self._look_into(status, t, q, u)
        return self.accelerations

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is made by the copied system."""
        return self._system.evaluator, (self._algorithm.name,)

    def _look_into(self, status: int, t: Any, q: Any, u: Any) -> None:
        """Raise the error of a status code, or have what was refused in the form that is needed."""
        system = self._system
        t, y = system.layout.packed(t, q, u)
        if status == REFUSED:
            status = self._enter(t, y[: system.nq], y[system.nq : -1])
        if status == OVERFLOWN:
            finite_result(self.accelerations, t)
        elif status == DOUBTED:
            system._trust(t, y, self._w)
        elif status != OK:
            system._check(status, int(self._w.fault[0]))
