"""Repeated evaluation of the accelerations of a tree, with one workspace and one array for the results."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from threading import get_ident
from typing import Any, Protocol

import numpy as np

from flexmb.entry.gate import NOBODY, GateNotes, gate
from flexmb.entry.object_access import may_read_objects
from flexmb.jit.direct import Direct, addresses, direct
from flexmb.jit.pointer import REAL, STATUS, VECTOR
from flexmb.system import algorithms
from flexmb.system.mechanics import Mechanics
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import NotFiniteError, finite_result
from flexmb.tables.status import OK
from flexmb.typing import Real

Refusal = Callable[[float, Real], None]
"""Raises where there is nothing to evaluate at t (s) and y = [q, u, work]."""


class Evaluated(Protocol):
    """What an evaluator evaluates: an algorithm, or derivatives."""

    @property
    def name(self) -> str: ...
    @property
    def kernel(self) -> Callable[[], Any]: ...
    @property
    def fresh(self) -> Callable[[Any], tuple[Any, ...]]: ...


class Evaluator(partial):  # a partial, so that calls enter the compiled gate without a frame of Python
    """`evaluator(t, q, u)`: udot (nu,) at time t (s), q (nq,) and u (nu,), in an array that every call writes anew.

    `System.evaluator` makes one. The array, `accelerations`, is read-only; copy it to keep its values. Arrays of floats
    in C order are used directly; other arguments that `System.evaluate` accepts are converted. Threads may share an
    evaluator: each gets an array of its own. Calls are fastest in the thread that makes the first one. Raises
    ValueError, TypeError and DynamicsError as `System.evaluate` does.
    """

    _careful: _Careful

    def __new__(
        cls, system: Mechanics, algorithm: Evaluated, tables: tuple[Any, ...], refuse: Refusal | None = None
    ) -> Evaluator:
        """tables: what the algorithm's kernel takes after t and y, the workspace second; refuse: is called before."""
        careful, w = _Careful(system, algorithm, tables, refuse), tables[1]
        call: Any = careful
        if may_read_objects() and refuse is None:
            behind = addresses(algorithm.kernel(), STATUS, REAL, VECTOR, *tables)
            call = gate(
                system.layout.quaternions, careful.rates, system.nq, w.speed, w.doubt, behind, careful.notes, careful
            )  # fmt: skip
        self = super().__new__(cls, call)
        self._careful = careful
        return self

    @property
    def accelerations(self) -> Real:
        """The array (nu,) that calls in this thread write and return."""
        return self._careful.shown

    @property
    def tables(self) -> tuple[Any, ...]:
        """What calls in this thread write into, behind the constants."""
        return self._careful.tables_here

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is a new evaluator of the copied system."""
        return fresh_evaluator, (self._careful.system, self._careful.algorithm.name)


def fresh_evaluator(system: Mechanics, algorithm: str) -> Evaluator:
    """An evaluator with a workspace of its own; ValueError for an unknown algorithm."""
    chosen = algorithms.chosen(algorithm)
    return Evaluator(system, chosen, chosen.fresh(system))


class _Careful:
    """The same evaluation in Python, for arguments that need conversion, for other threads, for errors and warnings.

    The evaluator belongs to the thread that calls it first. When that thread has ended, a new one may get its number
    and thereby the evaluator; no two living threads have the same number.
    """

    def __init__(
        self, system: Mechanics, algorithm: Evaluated, tables: tuple[Any, ...], refuse: Refusal | None
    ) -> None:
        self.system, self.algorithm, self._tables, self._w = system, algorithm, tables, tables[1]
        self._refuse = refuse
        numbers = np.zeros(system.nu)
        self.rates = numbers[:]
        numbers.flags.writeable = False  # views that are made from now on are read-only too
        self._numbers = numbers
        self.notes = GateNotes(np.full(1, NOBODY), np.zeros(1, np.int64))
        self._first = dict[str, int]()
        self._show()

    def __call__(self, t: Any, q: Any, u: Any) -> Real:
        if not self._is_owner():
            return self._of_this_thread(t, q, u)
        t, y = self.system.layout.packed(t, q, u)
        if self._refuse is not None:
            self._refuse(t, y)
        status = self._evaluate(t, y)
        if status != OK:
            self.system.check_status(status, int(self._w.fault[0]))
        self.rates[:] = self._w.speed["acceleration"]
        try:
            finite_result(self.rates, t)
        except NotFiniteError:
            self.system.refuse_undecided(t, y)
            raise
        self.system.check_precision(t, y, self._w)
        return self.shown

    @property
    def shown(self) -> Real:
        """The array that calls in this thread return: a new view of the rates if the shape or type of the last one was
        changed in place."""
        if self.notes.owner[0] not in (NOBODY, get_ident()):
            return self._of_this_thread.accelerations
        one, other = self._shown, self._numbers
        if (one.shape, one.dtype, one.flags.c_contiguous) != (other.shape, other.dtype, True):
            self._show()
        return self._shown

    @property
    def tables_here(self) -> tuple[Any, ...]:
        """The tables that calls in this thread use."""
        if self.notes.owner[0] not in (NOBODY, get_ident()):
            return self._of_this_thread.tables
        return self._tables

    def _show(self) -> None:
        shown = self._numbers.view()
        self.notes.returned[0] = id(shown)  # before the old view is released, which the gate must not return any more
        self._shown = shown

    def _is_owner(self) -> bool:
        """Whether this thread made the first call.

        The gate records it. Without a gate, as in an interpreter without a global lock, the atomic `setdefault` decides
        between threads that call at the same time.
        """
        this = get_ident()
        if self.notes.owner[0] == NOBODY:
            self.notes.owner[0] = self._first.setdefault("thread", this)
        return bool(self.notes.owner[0] == this)

    @per_thread
    def _of_this_thread(self) -> Evaluator:
        """The evaluator of a thread that is not the owner."""
        return Evaluator(self.system, self.algorithm, self.algorithm.fresh(self.system), self._refuse)

    @per_thread
    def _evaluate(self) -> Direct:
        """(t, y): the kernel without the gate, compiled at the first access."""
        return direct(self.algorithm.kernel(), STATUS, REAL, VECTOR, *self._tables)
