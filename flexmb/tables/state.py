"""The state of a system at one time, the layout of its coordinates, and errors of states without accelerations.

All states from outside pass `Layout` before they reach a kernel, because kernels do not check lengths and types.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flexmb.scene.problems import SceneWarning
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.tables.soundness import LONGEST, SHORTEST, unsound
from flexmb.tables.status import Status
from flexmb.typing import Index, Real

NO_QUATERNIONS: Index = np.zeros(0, np.int64)


class DynamicsError(ArithmeticError):
    """The accelerations do not exist at this state; the message names body and remedy, `status` the kind of failure."""

    status = Status.NOT_POSITIVE_DEFINITE


class NotFiniteError(DynamicsError):
    """The state is finite, but its accelerations or other results overflow."""

    status = Status.NONFINITE


class PrecisionWarning(SceneWarning):
    """Rounding leaves few digits of the accelerations at this state; the message says how many, and why."""


class _StateRow:
    """An array of a state, of which each access returns a new view.

    NumPy allows users to change shape, strides and type of an array in place. Such a change of a view does not affect
    the array that kernels use.
    """

    def __set_name__(self, owner: type, name: str) -> None:
        self._kept = "kernel_" + name

    def __get__(self, state: State | None, owner: type) -> Real:
        if state is None:
            raise AttributeError  # a field of a dataclass without a default
        part: Real = state.__dict__[self._kept][:]
        return part

    def __set__(self, state: State, values: Any) -> None:
        state.__dict__[self._kept] = values


class _KernelArrays:
    """The arrays of a state that kernels use; users only get views of them."""

    kernel_y: Real
    kernel_q: Real
    kernel_u: Real

    def _keep(self, y: Real, nq: int, t: float) -> None:
        """y (nq+nu+1,) = [q, u, 0], which is not copied."""
        y = y[:]  # the `base` of users' views is then the owner of the data, not the array that kernels use
        self.__dict__.update(kernel_y=y, kernel_q=y[:nq], kernel_u=y[nq:-1], t=t)

    @property
    def y(self) -> Real:
        """[q, u, 0] (nq+nu+1,), of which q and u are parts."""
        return self.kernel_y[:]


@dataclass(frozen=True, eq=False)
class State(_KernelArrays):
    """Coordinates q (nq,), speeds u (nu,) and time t (s).

    q and u are copied; their entries may be changed in place, their lengths may not. Quaternions need not have unit
    length; they are normalised. `layout` is that of the system to which the state belongs; without it, a state fits any
    system with the same lengths. TypeError for anything but rows of real numbers, ValueError for rows whose lengths are
    not those of the layout.
    """

    q: _StateRow = _StateRow()
    u: _StateRow = _StateRow()
    t: float = 0.0
    layout: Layout | None = field(default=None, repr=False)

    __repr__ = brief

    def __post_init__(self) -> None:
        q, u = arguments.array("q", self.kernel_q), arguments.array("u", self.kernel_u)
        if q.ndim != 1 or u.ndim != 1:
            raise ValueError(f"q and u are rows of numbers, got arrays of shapes {q.shape} and {u.shape}")
        if self.layout is not None:
            if not isinstance(self.layout, Layout):
                raise TypeError(f"layout is a {type(self.layout).__name__}: give that of a system, or leave it out")
            self.layout.fitting(len(q), len(u))
        self._keep(np.concatenate([q, u, [0.0]]), len(q), arguments.number("t", self.t))

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is constructed like a new state, with a y of its own."""
        return State, (self.q, self.u, self.t, self.layout)


@dataclass(frozen=True)
class Layout:
    """Slices of coordinates in q (nq,) and of speeds in u (nu,) by name; `quaternions` (k,): where each starts in q.

    Systems with equal layouts accept each other's states.
    """

    nq: int
    nu: int
    q: dict[str, slice]
    u: dict[str, slice]
    quaternions: Index = field(compare=False, repr=False)

    def state(self, q: Any, u: Any, t: Any = 0.0) -> State:
        """A state of this layout with finite numbers; ValueError or TypeError for arrays that do not fit."""
        return self.known(*self.packed(t, q, u))

    def known(self, t: float, y: Real) -> State:
        """A state from an array that is known to fit, without checks."""
        state = object.__new__(State)
        state.__dict__["layout"] = self
        state._keep(y, self.nq, t)
        return state

    def fitting(self, nq: int, nu: int) -> None:
        """ValueError unless the lengths are those of this layout."""
        if (nq, nu) != (self.nq, self.nu):
            raise ValueError(
                f"this system has q of {self.nq} and u of {self.nu} entries, the state has {nq} and {nu}: it belongs "
                "to another one"
            )

    def entering(self, state: State) -> tuple[float, Real]:
        """Time and y = [q, u, 0], which is not copied, of a state of this system; ValueError or TypeError for others.

        Every public call does this. For a valid state it costs one comparison and one small kernel.
        """
        if type(state) is not State or state.layout is not self:
            state = self.owning(state)
        if unsound(state.kernel_y, self.quaternions):
            self._examine(state.kernel_y)
        return state.t, state.kernel_y

    def owning(self, state: Any) -> State:
        """The state if it belongs to this layout; ValueError or TypeError for others. Its numbers are not checked.

        A state that has this very layout object was checked when it was made.
        """
        if type(state) is State and state.layout is self:
            return state
        if not isinstance(state, State):
            raise TypeError(f"a State is needed, not {type(state).__name__}: make one by system.state(q, u, t)")
        if type(state) is not State:
            state = State(state.q, state.u, state.t, state.layout)  # subclasses may have changed its arrays
        self.fitting(len(state.kernel_q), len(state.kernel_u))
        if state.layout is not None and state.layout != self:
            strange = [repr(name) for name, place in state.layout.q.items() if self.q.get(name) != place]
            raise ValueError(
                f"the state belongs to another system: {', '.join(strange[:3]) or 'speeds'} have no or another place "
                "here. If its numbers are meant, give them to system.state(q, u, t)"
            )
        return state

    def packed(self, t: Any, q: Any, u: Any) -> tuple[float, Real]:
        """Time and y = [q, u, 0] of arrays, a copy; ValueError or TypeError where they do not fit."""
        y = np.empty(self.nq + self.nu + 1)
        y[: self.nq] = arguments.vector("q", q, self.nq)
        y[self.nq : -1] = arguments.vector("u", u, self.nu)
        y[-1] = 0.0
        if unsound(y, self.quaternions):
            self._examine(y)
        return arguments.number("t", t), y

    def whole(self, t: Any, y: Any) -> tuple[float, Real]:
        """Time and y = [q, u, work]; ValueError or TypeError if they do not fit."""
        y = arguments.vector("y", y, self.nq + self.nu + 1)
        if unsound(y, self.quaternions):
            self._examine(y)
        return arguments.number("t", t), y

    def rates(self, name: str, values: Any) -> Real:
        """(nu,) numbers, finite."""
        found = arguments.vector(name, values, self.nu)
        return arguments.finite(name, found) if unsound(found, NO_QUATERNIONS) else found

    def _examine(self, y: Real) -> None:
        """Raise the ValueError for the entry that `unsound` has found."""
        arguments.finite("q", y[: self.nq])
        arguments.finite("u", y[self.nq : self.nq + self.nu])
        arguments.finite("work", y[self.nq + self.nu :])
        for start in self.quaternions:
            q = y[start : start + 4]
            if not SHORTEST < q @ q < LONGEST:
                raise ValueError(f"q[{start}:{start + 4}] is {q}: a quaternion needs a length that is not zero")


def finite_result(result: Real, t: float) -> Real:
    """The result (any shape) itself; DynamicsError if an entry is not finite."""
    if unsound(result if result.ndim == 1 else result.ravel(), NO_QUATERNIONS):
        raise NotFiniteError(
            f"the result at t = {t:g} s is not finite: coordinates, speeds, accelerations or functions of time are so "
            "large that their products overflow"
        )
    return result


def pack(state: State) -> Real:
    """y = [q, u, work], a copy."""
    return state.kernel_y.copy()
