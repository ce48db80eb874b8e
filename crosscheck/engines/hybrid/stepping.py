"""Steps of an arc between two instants: DOP853 of SciPy with its dense output, or the classical Runge-Kutta method."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np

from crosscheck.engines.contract import Effort
from crosscheck.engines.scipy_loop import absolute_tolerance
from flexmb.typing import Real

Rate = Callable[[float, Real], Real]
EVALUATIONS = {"RK4": 4}


class Stopped(ArithmeticError):
    """An arc that cannot be integrated to its end; the message says when and why."""


@dataclass(frozen=True)
class ArcStep:
    """From `begin` to `end` (s), with y at the end; `at` gives y in between.

    `probes`: fractions of the step at which watched quantities are looked at.
    """

    begin: float
    end: float
    y: Real
    at: Callable[[float], Real]
    probes: tuple[float, ...]


class ArcStepper:
    """Steps by an effort. The length of one arc's last step is the first try of the next arc's."""

    def __init__(self, effort: Effort) -> None:
        if effort.method not in ("DOP853", "RK4"):
            raise ValueError(f'the loop of events and controllers has no method "{effort.method}"')
        self._effort = effort
        self._usual: float | None = None

    @property
    def has_dense_output(self) -> bool:
        """Whether states within a step cost no further evaluations; else steps end at the samples."""
        return self._effort.method == "DOP853"

    def steps(self, rate: Rate, begin: float, y: Real, end: float) -> Iterator[ArcStep]:
        """Until the end; raises Stopped. The right-hand side takes the limit from the left at the end."""
        before_end = float(np.nextafter(end, begin))

        def to_the_left(t: float, y: Real) -> Real:
            return rate(min(t, before_end), y)

        return (self._dense if self.has_dense_output else self._classical)(to_the_left, begin, y, end)

    def _dense(self, rate: Rate, begin: float, y: Real, end: float) -> Iterator[ArcStep]:
        from scipy.integrate import DOP853

        rtol = self._effort.value
        first = None if self._usual is None else min(self._usual, end - begin)
        solver = DOP853(rate, begin, y, end, rtol=rtol, atol=absolute_tolerance(rtol), first_step=first)
        while solver.status == "running":
            message = solver.step()
            if solver.status == "failed" or not np.isfinite(solver.y).all():
                raise Stopped(f"stopped after t = {solver.t:g} s: {message or 'undefined numbers'}")
            # The last step of an arc is cut short, and says little about the next arc's first.
            self._usual = solver.h_abs if solver.status == "running" else max(self._usual or 0.0, solver.h_abs)
            at = _of(solver)
            yield ArcStep(float(solver.t_old), float(solver.t), solver.y.copy(), at, _EIGHTHS)

    def _classical(self, rate: Rate, begin: float, y: Real, end: float) -> Iterator[ArcStep]:
        count = max(1, ceil((end - begin) / self._effort.value * (1.0 - 1e-9)))
        times = np.linspace(begin, end, count + 1).tolist()
        for before, after in zip(times, times[1:], strict=False):

            def at(t: float, before: float = before, y: Real = y) -> Real:
                return classical(rate, before, y, t - before)

            y = at(after)
            if not np.isfinite(y).all():
                raise Stopped(f"stopped after t = {before:g} s: undefined numbers")
            yield ArcStep(before, after, y, at, _HALVES)


_EIGHTHS = tuple((np.arange(1, 9) / 8.0).tolist())
_HALVES = (0.5, 1.0)


def _of(solver: object) -> Callable[[float], Real]:
    """The dense output of the step made last, computed when it is first asked for, before the next step."""
    found: list[Callable[[float], Real]] = []

    def at(t: float) -> Real:
        if not found:
            found.append(solver.dense_output())  # type: ignore[attr-defined]  # SciPy has no types
        return found[0](t)

    return at


def classical(rate: Rate, t: float, y: Real, h: float) -> Real:
    """y after a step h of the classical Runge-Kutta method."""
    a = rate(t, y)
    b = rate(t + 0.5 * h, y + 0.5 * h * a)
    c = rate(t + 0.5 * h, y + 0.5 * h * b)
    d = rate(t + h, y + h * c)
    return np.asarray(y + h / 6.0 * (a + 2.0 * b + 2.0 * c + d))
