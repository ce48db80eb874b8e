"""The declaration of an integrator, which stands in the last lines of its file. `catalogue` lists all of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

Method = Literal["dop853", "rk4", "radau5", "exponential", "generalised_alpha"]
"""Names of the integrators, for type checkers: a test holds them to the catalogue."""


@dataclass(frozen=True)
class Integrator:
    """A method by which runs are integrated.

    run(problem, y, clock, accuracy, out, counts) -> (status code, time of the last good state) integrates a `Problem`,
    or a `StiffProblem` if it `linearises`, from clock.times[0] to clock.times[-1]. y (n,): the initial state, on return
    the last good one. out (T,n): y at every time of the clock. counts (COUNTS,): as named in `control`; all entries
    that a method has no use for stay 0.
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
    damps: bool = False
    """`spectral_radius` says what it leaves of modes that its step does not resolve."""
    evaluations: int = 1
    """Evaluations of the right-hand side in a step, at least."""
    algebra: tuple[float, float] = (0.0, 0.0)
    """Operations of its linear algebra: times n^3 for each factorisation, times n^2 for each evaluation."""
