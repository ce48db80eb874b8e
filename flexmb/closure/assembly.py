"""Initial conditions that close all closures, from a user's rough ones, or why there are none.

Coordinates by damped Gauss-Newton steps (Levenberg and Marquardt), then the speeds, each the least in one metric: that
of kinetic energy, with modes so much heavier, in proportion to their stiffness, that they only move where hinges cannot
close the loop. Prescribed coordinates and speeds stay as they are. Rows are weighed with a length of the scene, and
compared with the size of their closure.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.closure.closures import ClosureError, Closures, GroupResponse
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
        found = decomposed(closures)
        # the damping fades with the errors: convergence is quadratic, even where redundant rows become dependent
        fading = damping * min(1.0, float(np.linalg.norm(errors)))
        floor = fading * found.largest**2 + np.finfo(float).tiny
        trial = closures.moved(t, y, -found.damped(errors, floor))
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
        found = decomposed(closures)
        y = closures.pushed(t, y, -found.damped(rates, 0.0))
        rates, largest = closures.rates()
    if not largest <= MOVING_APART:
        where = closures.worst(rates, rates=True)
        raise ClosureError(
            f"{where}: no speeds keep it closed; the nearest leave this. Prescribed motions ask for what the closures "
            "do not allow: the mechanism is locked; free a hinge, or use flexible bodies"
        )
    return y


class Group(NamedTuple):
    """Singular values of B' of a group in its own columns, U s V', and U' times the columns that its cluster shares."""

    of: GroupResponse
    U: Real
    s: Real
    Vt: Real
    shared: Real


class Decomposed(NamedTuple):
    """The responses of all rows, by cluster and group."""

    speeds: int
    clusters: list[list[Group]]

    @property
    def largest(self) -> float:
        """The largest singular value of all."""
        return max((float(group.s[0]) for groups in self.clusters for group in groups if len(group.s)), default=0.0)

    def damped(self, values: Real, floor: float) -> Real:
        """x (nu,) = B (B'B + floor)^-1 values (G,) of the rows; without a floor the least squares' solution.

        What groups share comes in by Woodbury's formula, as in `flexmb.closure.clusters`.
        """
        x = np.zeros(self.speeds)
        for groups in self.clusters:
            kept = [group.s > (0.0 if floor > 0.0 else DEPENDENT * self.largest) for group in groups]
            root = [np.sqrt(group.s[k] ** 2 + floor) for group, k in zip(groups, kept, strict=True)]
            T = [group.shared[k] / r[:, None] for group, k, r in zip(groups, kept, root, strict=True)]
            z = [group.U[:, k].T @ values[group.of.rows] / r for group, k, r in zip(groups, kept, root, strict=True)]
            C = np.eye(T[0].shape[1]) + sum(each.T @ each for each in T)
            y = np.linalg.solve(C, sum(each.T @ part for each, part in zip(T, z, strict=True)))
            for group, k, r, t, part in zip(groups, kept, root, T, z, strict=True):
                f = (part - t @ y) / r
                x[group.of.columns[: group.of.own]] += group.Vt[k].T @ (group.s[k] * f)
                x[group.of.columns[group.of.own :]] += group.shared[k].T @ f
        return x


def decomposed(closures: Closures) -> Decomposed:
    """At the state that was linearised last."""
    return Decomposed(
        len(closures.constants[0].speed), [[_decomposed(of) for of in groups] for groups in closures.responses()]
    )


def _decomposed(of: GroupResponse) -> Group:
    U, s, Vt = np.linalg.svd(of.half[:, : of.own], full_matrices=False)
    return Group(of, U, s, Vt, U.T @ of.half[:, of.own :])


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
