"""Accelerations of a tree again and again: an algorithm with a workspace of its own and arrays that it uses again."""

from __future__ import annotations

from functools import partial
from typing import Any

from flexmb.entry.gate import DOUBTED, OVERFLOWN, REFUSED, accelerations, gate
from flexmb.jit.direct import ADDRESS, addresses, settled
from flexmb.jit.pointer import REAL, STATUS, VECTOR
from flexmb.system.mechanics import Mechanics
from flexmb.tables.state import finite_result
from flexmb.tables.status import OK
from flexmb.typing import Real


class Evaluator:
    """udot (nu,) at time t (s), q (nq,) and u (nu,), as an array that every call writes anew: `evaluator(t, q, u)`.

    `System.evaluator` makes one. It owns its workspace: one per thread. The array is `accelerations`; copy what is to
    be kept. Arrays of floats in C order go in as they are, whatever else `System.evaluate` takes is converted.
    """

    def __init__(self, system: Mechanics, kernel: Any, tables: tuple[Any, ...]) -> None:
        """Of a kernel of accelerations, and what it takes after t and y: constants, a workspace, and maybe a third."""
        self._system, self._w = system, tables[1]
        behind = addresses(kernel, STATUS, REAL, VECTOR, *tables)
        self._held = tables, gate(system.layout.quaternions, system.nq, self._w.speed, self._w.doubt, behind)
        self.accelerations: Real = self._held[1].rates
        self._enter = partial(settled(accelerations, ADDRESS, REAL, VECTOR, VECTOR), self._held[1]._address)

    def __call__(self, t: float, q: Real, u: Real) -> Real:
        """Raises ValueError, TypeError and DynamicsError as `System.evaluate` does."""
        try:
            status = self._enter(t, q, u) if type(t) is float else REFUSED
        except TypeError:  # arrays of another type
            status = REFUSED
        if status != OK:
            self._look_into(status, t, q, u)
        return self.accelerations

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
