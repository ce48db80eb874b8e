"""Accelerations of a tree again and again: an algorithm with a workspace and arrays that it uses again."""

from __future__ import annotations

from functools import cached_property, partial
from typing import Any

import numpy as np

from flexmb.entry.gate import gate
from flexmb.jit.direct import Direct, addresses, direct
from flexmb.jit.objects import readable
from flexmb.jit.pointer import REAL, STATUS, VECTOR
from flexmb.system.algorithm import DynamicsAlgorithm
from flexmb.system.mechanics import Mechanics
from flexmb.tables.state import finite_result
from flexmb.tables.status import OK
from flexmb.typing import Real


class Evaluator(partial):  # a partial, so that a call takes no way through Python
    """`evaluator(t, q, u)`: udot (nu,) at time t (s), q (nq,) and u (nu,), in an array that every call writes anew.

    `System.evaluator` makes one. The array, `accelerations`, is for reading; copy what is to be kept. Arrays of floats
    in C order go in as they are; what else `System.evaluate` takes is converted. An evaluator writes into its own
    workspace: one per thread. Raises ValueError, TypeError and DynamicsError as `System.evaluate` does.
    """

    accelerations: Real
    _system: Mechanics
    _algorithm: DynamicsAlgorithm

    def __new__(cls, system: Mechanics, algorithm: DynamicsAlgorithm, tables: tuple[Any, ...]) -> Evaluator:
        """tables: what the algorithm's kernel takes after t and y, the workspace second."""
        careful, w = _Careful(system, algorithm, tables), tables[1]
        call: Any = careful
        if readable():
            behind = addresses(algorithm.kernel(), STATUS, REAL, VECTOR, *tables)
            call = gate(system.layout.quaternions, careful.shown, system.nq, w.speed, w.doubt, behind, careful)
        self = super().__new__(cls, call)
        self.accelerations, self._system, self._algorithm = careful.shown, system, algorithm
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is made by the copied system."""
        return self._system.evaluator, (self._algorithm.name,)


class _Careful:
    """The same step by step, for arguments in another form, and for all that there is something to say of."""

    def __init__(self, system: Mechanics, algorithm: DynamicsAlgorithm, tables: tuple[Any, ...]) -> None:
        self._system, self._algorithm, self._tables, self._w = system, algorithm, tables, tables[1]
        self._rates = np.zeros(system.nu)
        self.shown = self._rates.view()
        self.shown.flags.writeable = False

    @cached_property
    def _evaluate(self) -> Direct:
        """(t, y): the kernel by an entry of its own, compiled when first needed."""
        return direct(self._algorithm.kernel(), STATUS, REAL, VECTOR, *self._tables)

    def __call__(self, t: Any, q: Any, u: Any) -> Real:
        t, y = self._system.layout.packed(t, q, u)
        status = self._evaluate(t, y)
        if status != OK:
            self._system._check(status, int(self._w.fault[0]))
        self._rates[:] = self._w.speed["acceleration"]
        finite_result(self._rates, t)
        self._system._trust(t, y, self._w)
        return self.shown
