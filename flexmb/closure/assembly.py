"""Initial conditions that close all closures, from a user's rough ones, or why there are none.

Coordinates by damped Gauss-Newton steps (Levenberg and Marquardt), then the speeds, each the least in one metric: that
of kinetic energy, with modes so much heavier, in proportion to their stiffness, that they only move where hinges cannot
close the loop. Prescribed coordinates and speeds stay as they are. Rows are weighed with a length of the scene, and
compared with the size of their closure.
"""

from __future__ import annotations

import numpy as np

from flexmb.closure.closures import ClosureError, Closures
from flexmb.closure.factor import DEPENDENT
from flexmb.closure.projection import CLOSED, MOVING_APART, OPEN
from flexmb.tables.status import OK
from flexmb.typing import Real

STEPS = 200
STRONGEST = 1e12  # damping beyond which no step makes the errors smaller


def consistent(closures: Closures, t: float, y: Real) -> Real:
    """y = [q, u, work] with closed closures, close to the one given; ClosureError where there is none."""
    y = _closed(closures, t, y.copy())
    closures.linearise(t, y)
    closures.count_rows()
    _refuse_half_a_turn(closures)
    return _moving(closures, t, y)


def _closed(closures: Closures, t: float, y: Real) -> Real:
    errors, damping = _errors(closures, t, y), 1e-3
    for _ in range(STEPS):
        if _largest(errors) <= CLOSED or damping > STRONGEST:
            break
        U, s, Vt = np.linalg.svd(closures.responses(), full_matrices=False)
        # the damping fades with the errors: convergence is quadratic, even where redundant rows become dependent
        floor = damping * s[0] ** 2 * min(1.0, float(np.linalg.norm(errors))) + np.finfo(float).tiny
        trial = closures.moved(t, y, -Vt.T @ (s / (s**2 + floor) * (U.T @ errors)))
        smaller = np.linalg.norm(closures.errors()) < np.linalg.norm(errors)
        if smaller and closures.linearise_stiff(t, trial) == OK:
            y, errors, damping = trial, closures.errors(), damping / 10.0
        else:
            damping *= 10.0
            closures.linearise_stiff(t, y)
    if not _largest(errors) <= OPEN:
        where = closures.worst(errors)
        raise ClosureError(
            f"{where}: no coordinates close it; the nearest that were found leave this. Check lengths, axes and "
            "offsets, give initial coordinates closer to a closed configuration, or, where closures suppress more "
            "motions than rigid bodies leave, more digits or flexible bodies"
        )
    return y


def _moving(closures: Closures, t: float, y: Real) -> Real:
    """Speeds in the range that the closures leave."""
    closures.linearise_stiff(t, y)
    rates, largest = closures.rates()
    for _ in range(3):
        if largest <= CLOSED:
            break
        x = -np.linalg.lstsq(closures.responses(), rates, rcond=DEPENDENT)[0]
        y = closures.pushed(t, y, x.astype(np.float64, copy=False))
        rates, largest = closures.rates()
    if not largest <= MOVING_APART:
        where = closures.worst(rates, rates=True)
        raise ClosureError(
            f"{where}: no speeds keep it closed; the nearest leave this. Prescribed motions ask for what the closures "
            "do not allow: the mechanism is locked; free a hinge, or use flexible bodies"
        )
    return y


def _refuse_half_a_turn(closures: Closures) -> None:
    """Axes that should be equal may have come out opposite."""
    for name, turned in closures.half_turned():
        if turned:
            raise ClosureError(
                f'closure "{name}" closes only with its frames half a turn apart: turn quaternion_b, or give initial '
                "coordinates closer to the closed configuration"
            )


def _errors(closures: Closures, t: float, y: Real) -> Real:
    closures.linearise(t, y)  # raises where the tree itself has no dynamics
    closures.linearise_stiff(t, y)
    return closures.errors()


def _largest(errors: Real) -> float:
    return float(np.max(np.abs(errors), initial=0.0))
