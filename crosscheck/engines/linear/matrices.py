"""Derivatives of the accelerations at one state, and how well an engine knows them.

udot (n,) are the accelerations of the free speeds u, xi displacements along them and tau loads along them:

    by_displacement = d udot / d xi,    by_speed = d udot / d u,    by_force = d udot / d tau    (n, n)

`transport` is that of xi' = du + transport xi (`flexmb.linear.variations`): carried axes turn.

**Exact derivatives** are known up to rounding. They come from solving with the mass matrix M = by_force^-1, and the
relative error of that is at most about c n eps kappa (Higham 2002, chapters 9 and 10), where kappa is the condition
number of M after its rows and columns are scaled by the roots of its diagonal: by the choice of units no digit is lost
(van der Sluis 1969). n counts all speeds, prescribed ones too, through which a recursion passes, and c the roundings of
a product of spatial vectors and matrices on the way. The bound applies to the parts of a derivative, which may cancel.
Their sizes are those of the derivative itself and of the products with speeds and accelerations by which turned axes
and arms enter:

    |by_displacement| + |by_speed| |u| + |udot|,    |by_speed| + |u|,    |by_force|
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from crosscheck.engines.conventions import cross_matrix
from flexmb.typing import Real

EPS = float(np.finfo(np.float64).eps)
ROUNDINGS = 8  # c: six products and their sum, and the one that turns the axes


@dataclass(frozen=True)
class Errors:
    """How far, in the Frobenius norm, each derivative may be from that of the same state in exact arithmetic."""

    by_displacement: float
    by_speed: float
    by_force: float


@dataclass(frozen=True)
class LinearMatrices:
    """The derivatives of one state in the order of `coordinate_names`, their errors, and the transport."""

    by_displacement: Real
    by_speed: Real
    by_force: Real
    transport: Real
    errors: Errors

    def ordered(self, places: Any) -> LinearMatrices:
        """The same with rows and columns in another order: `places` (n,) are their numbers in this one."""
        square = np.ix_(places, places)
        parts = (self.by_displacement, self.by_speed, self.by_force, self.transport)
        return LinearMatrices(*(part[square] for part in parts), self.errors)


def exact(
    by_displacement: Real, by_speed: Real, by_force: Real, transport: Real, u: Real, udot: Real
) -> LinearMatrices:
    """Derivatives that are exact up to rounding, of a state with all speeds u and accelerations udot, also prescribed
    ones."""
    unit = rounding(by_force, len(u))
    sizes = (norm(by_displacement) + norm(by_speed) * norm(u) + norm(udot), norm(by_speed) + norm(u), norm(by_force))
    errors = Errors(*(unit * size if np.isfinite(unit) else float("inf") for size in sizes))
    return LinearMatrices(by_displacement, by_speed, by_force, transport, errors)


def rounding(by_force: Real, speeds: int) -> float:
    """The relative error c n eps kappa of a solution with the mass matrix, of a tree with so many speeds."""
    return ROUNDINGS * speeds * EPS * scaled_condition(by_force)


def norm(values: Real) -> float:
    """Euclidean, or Frobenius."""
    return float(np.linalg.norm(values))


def scaled_condition(positive: Real) -> float:
    """Condition number of a positive definite matrix with unit diagonal; infinite where it is not positive definite."""
    diagonal = np.diag(positive)
    if not np.all(diagonal > 0.0):
        return float("inf")
    root = np.sqrt(diagonal)
    values = np.linalg.eigvalsh((positive + positive.T) / (2.0 * np.outer(root, root)))
    return float(values[-1] / values[0]) if values[0] > 0.0 else float("inf")


def quaternion_transport(u: Real, turning: Sequence[int], moving: Sequence[int]) -> Real:
    """The transport (n,n) of speeds u (n,), where the angular velocities of ball joints begin at `turning`, and those
    of free flight at `moving`, followed by velocities."""
    transport = np.zeros((len(u), len(u)))
    for j in (*turning, *moving):
        transport[j : j + 3, j : j + 3] = -cross_matrix(u[j : j + 3])
    for j in moving:
        transport[j + 3 : j + 6, j : j + 3] = -cross_matrix(u[j + 3 : j + 6])
        transport[j + 3 : j + 6, j + 3 : j + 6] = -cross_matrix(u[j : j + 3])
    return transport


# Derivatives by central differences of fourth order, with two steps.  Let D_2(h) = [f(h) - f(-h)] / 2h be the
# differences of second order. Those of fourth order are      D(h) = [4 D_2(h) - D_2(2h)] / 3 = f' + C h^4 + ...  The
# result is D(h). Its error is estimated as |D(h) - D(2h)|, fifteen times the leading term, plus the rounding 1.5 noise
# / h of its own formula, where `noise` is that of the values of f. Where the former is more than the latter a shorter
# step is tried, and the result with the least error is taken.

STEPS = (1e-3, 1e-4, 1e-5)
"""h in SI units. The fourth power of the first is 1e-12, and rounding divided by it 1e-13, of values whose scales are
of order one; shorter ones are for coordinates in which f bends more, such as those of high modes."""


def differentiated(f: Callable[[Real], Real], size: int, noise: float) -> tuple[Real, float]:
    """The derivative (m, size) of f: (size,) -> (m,) at zero, and its error in the Frobenius norm."""

    @cache
    def second_order(step: float) -> Real:
        return np.array([(f(step * one) - f(-step * one)) / (2.0 * step) for one in np.eye(size)]).T

    return fourth_order(second_order, noise * np.sqrt(size))


def fourth_order(second_order: Callable[[float], Real], noise: float) -> tuple[Real, float]:
    """D and its error from D_2 as a function of its step; `noise` is that of the values in the norm of D."""
    best, least = np.zeros(0), np.inf
    for step in STEPS:
        near, mid, far = (second_order(factor * step) for factor in (1.0, 2.0, 4.0))
        fine, coarse = (4.0 * near - mid) / 3.0, (4.0 * mid - far) / 3.0
        bent, rounding = float(np.linalg.norm(fine - coarse)), 1.5 * noise / step
        if not best.size or bent + rounding < least:
            best, least = fine, bent + rounding
        if not bent > rounding:
            break
    return best, least
