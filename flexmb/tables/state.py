"""The state of a system at one time, the system it belongs to, and the error of a state that has no accelerations.

Everything that enters a kernel from outside passes `Layout`, because kernels trust the lengths and types of their
arrays.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flexmb.scene.problems import SceneWarning
from flexmb.tables import arguments
from flexmb.tables.soundness import LONGEST, SHORTEST, unsound
from flexmb.tables.status import Status
from flexmb.typing import Index, Real

_NONE: Index = np.zeros(0, np.int64)


class DynamicsError(ArithmeticError):
    """The accelerations do not exist at this state; the message names the body and the remedy, `status` the kind."""

    status = Status.NOT_POSITIVE_DEFINITE


class NotFiniteError(DynamicsError):
    """A state is finite, but its accelerations or other results overflow."""

    status = Status.NONFINITE


class PrecisionWarning(SceneWarning):
    """Rounding leaves few digits of the accelerations at this state; the message says how many, and why."""


@dataclass(frozen=True, eq=False)
class State:
    """Coordinates q (nq,), speeds u (nu,) and time t (s).

    q and u are copied; their entries may be changed in place, their lengths may not. Quaternions need not have unit
    length: they are scaled. `layout` says whose state it is; one that is made by hand belongs to any system whose
    lengths it has. TypeError for what is not a row of real numbers.
    """

    q: Real
    u: Real
    t: float = 0.0
    layout: Layout | None = field(default=None, repr=False)
    y: Real = field(init=False, repr=False)
    """[q, u, 0], of which q and u are parts: what kernels take."""

    def __post_init__(self) -> None:
        q, u = arguments.array("q", self.q), arguments.array("u", self.u)
        if q.ndim != 1 or u.ndim != 1:
            raise ValueError(f"q and u are rows of numbers, got arrays of shapes {q.shape} and {u.shape}")
        y = np.concatenate([q, u, [0.0]])
        for name, value in (("q", y[: len(q)]), ("u", y[len(q) : -1]), ("t", arguments.number("t", self.t)), ("y", y)):
            object.__setattr__(self, name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy's q and u are parts of its own y."""
        return State, (self.q, self.u, self.t, self.layout)


@dataclass(frozen=True)
class Layout:
    """Places of coordinates in q (nq,) and of speeds in u (nu,) by name; `quaternions` (k,): where each starts in q.

    Systems with equal layouts take each other's states.
    """

    nq: int
    nu: int
    q: dict[str, slice]
    u: dict[str, slice]
    quaternions: Index = field(compare=False, repr=False)

    def state(self, q: Any, u: Any, t: Any = 0.0) -> State:
        """A state that belongs here, finite; ValueError or TypeError for what does not fit."""
        return self.known(*self.packed(t, q, u))

    def known(self, t: float, y: Real) -> State:
        """A state of what is known to fit, without asking again."""
        found = object.__new__(State)
        found.__dict__.update(q=y[: self.nq], u=y[self.nq : -1], t=t, layout=self, y=y)
        return found

    def entering(self, state: State) -> tuple[float, Real]:
        """Time and y = [q, u, 0], which is not copied, of a state of this system; ValueError or TypeError for others.

        Asked by every public call: what fits costs one comparison and one small kernel.
        """
        self.owning(state)
        if unsound(state.y, self.quaternions):
            self._examine(state.y)
        return state.t, state.y

    def owning(self, state: State) -> None:
        """ValueError or TypeError unless a state belongs here; its numbers are not looked at."""
        if type(state) is not State or state.layout is not self:
            self._own(state)

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
        """Time and y = [q, u, work]; ValueError or TypeError where they do not fit."""
        y = arguments.vector("y", y, self.nq + self.nu + 1)
        if unsound(y, self.quaternions):
            self._examine(y)
        return arguments.number("t", t), y

    def rates(self, name: str, values: Any) -> Real:
        """(nu,) numbers, finite."""
        found = arguments.vector(name, values, self.nu)
        return arguments.finite(name, found) if unsound(found, _NONE) else found

    def _own(self, state: Any) -> None:
        if not isinstance(state, State):
            raise TypeError(f"a State is needed, not {type(state).__name__}: make one by system.state(q, u, t)")
        if (len(state.q), len(state.u)) != (self.nq, self.nu):
            raise ValueError(
                f"this system has q of {self.nq} and u of {self.nu} entries, the state has {len(state.q)} and "
                f"{len(state.u)}: it belongs to another one"
            )
        if state.layout is not None and state.layout != self:
            strange = [repr(name) for name, place in state.layout.q.items() if self.q.get(name) != place]
            raise ValueError(
                f"the state belongs to another system: {', '.join(strange[:3]) or 'speeds'} have no or another place "
                "here. If its numbers are meant, give them to system.state(q, u, t)"
            )

    def _examine(self, y: Real) -> None:
        """ValueError for what `unsound` found."""
        arguments.finite("q", y[: self.nq])
        arguments.finite("u", y[self.nq : self.nq + self.nu])
        arguments.finite("work", y[self.nq + self.nu :])
        for start in self.quaternions:
            q = y[start : start + 4]
            if not SHORTEST < q @ q < LONGEST:
                raise ValueError(f"q[{start}:{start + 4}] is {q}: a quaternion needs a length that is not zero")


def finite_result(result: Real, t: float) -> Real:
    """The result (any shape) itself; DynamicsError where an entry is not finite."""
    if unsound(result if result.ndim == 1 else result.ravel(), _NONE):
        raise NotFiniteError(
            f"the result at t = {t:g} s is not finite: coordinates, speeds, accelerations or functions of time are so "
            "large that their products overflow"
        )
    return result


def pack(state: State) -> Real:
    """y = [q, u, work], a copy."""
    return state.y.copy()
