"""The declaration of an integrator, which each method's file makes at its end. `catalogue` lists all of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from flexmb.integrate.memory import Memory

Method = Literal["dop853", "rk4", "radau5", "exponential", "generalised_alpha"]
"""Names of the integrators, for type checkers; a test compares them with the catalogue."""


@dataclass(frozen=True)
class Integrator:
    """A method by which runs are integrated.

    run(problem, y, clock, accuracy, out, counts, memory, watch) -> (status code, time of the last good state)
    integrates a `Problem`, or a `StiffProblem` if it `linearises`, from clock.times[0], or from the time at which
    `memory` resumes a run, to clock.times[-1]. y (n,): the state at the start, on return the last good one. out (T,n):
    y at every time of the clock. counts (COUNTS,): as named in `control`; entries that a method does not use stay 0.
    memory: a `Memory`, from which, on return, the run can be resumed unless it failed. watch: a `Watch`, or that of
    `nothing_watched`; the run pauses when it reaches the first of its levels and returns `CROSSED`.
    """

    name: Method
    run: Callable[..., tuple[int, float]]
    order: int
    summary: str
    """When to use it, in one line."""
    fixed: bool = False
    """Whether it takes equal steps, not longer than `step`; other methods choose their steps by rtol and atol."""
    linearises: bool = False
    """Whether it needs Jacobians."""
    keeps_jacobian: bool = False
    """Whether a step may use the Jacobian of an earlier one: the rows of `Memory` are then J and three more."""
    damps: bool = False
    """Whether `spectral_radius` sets its damping of modes that the step does not resolve."""
    evaluations: int = 1
    """Minimum number of evaluations of the right-hand side per step."""
    matrices: int = 0
    """How many matrices over the whole state its workspace holds."""
    algebra: tuple[float, float] = (0.0, 0.0)
    """Operations of its linear algebra: factors of n^3 for each factorisation and of n^2 for each evaluation."""

    def entered(self, *given: Any) -> Callable[..., tuple[int, float]]:
        """`run`, compiled for arguments of the types of these. It checks no types: see `undispatched`.

        numba takes 1 ms to describe a problem, longer than many a run, so that it describes each kind once.
        """
        from flexmb.jit.direct import undispatched  # imported here as below

        key = self.run, *map(_kind, given)
        if key not in _ENTERED:
            _ENTERED[key] = undispatched(self.run, *given)
        return _ENTERED[key]

    def memory(self, n: int) -> Memory:
        """The memory of a new run whose state has n entries."""
        from flexmb.integrate.memory import memory  # imported here so that command lines need not load the compiler

        return memory(n, n + 3 if self.keeps_jacobian else 0)


_ENTERED: dict[Any, Callable[..., tuple[int, float]]] = {}


def _kind(argument: Any) -> Any:
    """What the type of an argument follows from."""
    import numpy as np

    from flexmb.jit.pointer import Pointer

    if isinstance(argument, tuple):
        return type(argument), *map(_kind, argument)
    if isinstance(argument, np.ndarray):
        return argument.dtype, argument.ndim, argument.flags.num
    if isinstance(argument, Pointer):
        return argument
    return getattr(argument, "_numba_type_", type(argument))  # of bundles; whole and real numbers are of one type each
