"""The declaration of an integrator, which stands in the last lines of its file. `catalogue` lists all of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from flexmb.integrate.memory import Memory

Method = Literal["dop853", "rk4", "radau5", "exponential", "generalised_alpha"]
"""Names of the integrators, for type checkers: a test holds them to the catalogue."""


@dataclass(frozen=True)
class Integrator:
    """A method by which runs are integrated.

    run(problem, y, clock, accuracy, out, counts, memory, watch) -> (status code, time of the last good state)
    integrates a `Problem`, or a `StiffProblem` if it `linearises`, from clock.times[0], or from where a run is taken up
    by `memory`, to clock.times[-1]. y (n,): the state there, on return the last good one. out (T,n): y at every time of
    the clock. counts (COUNTS,): as named in `control`; all entries that a method has no use for stay 0. memory: a
    `Memory`, on return where the run can be taken up, unless it failed. watch: None, or a `Watch`, at whose first
    level the run pauses: it then returns `CROSSED`. Compiled for None, a method looks for no level.
    """

    name: Method
    run: Callable[..., tuple[int, float]]
    order: int
    summary: str
    """What it is for, in one line."""
    fixed: bool = False
    """It takes equal steps, not longer than `step`; others choose theirs by rtol and atol."""
    linearises: bool = False
    """It needs Jacobians."""
    keeps_jacobian: bool = False
    """Its next step needs the Jacobian of an earlier one: rows of `Memory` are it and three more."""
    damps: bool = False
    """`spectral_radius` says what it leaves of modes that its step does not resolve."""
    evaluations: int = 1
    """Evaluations of the right-hand side in a step, at least."""
    algebra: tuple[float, float] = (0.0, 0.0)
    """Operations of its linear algebra: times n^3 for each factorisation, times n^2 for each evaluation."""

    def memory(self, n: int) -> Memory:
        """Of a run that begins, with a state of n entries."""
        from flexmb.integrate.memory import memory  # command lines, which list the methods, go without the compiler

        return memory(n, n + 3 if self.keeps_jacobian else 0)
