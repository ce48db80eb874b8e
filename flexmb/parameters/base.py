"""Base parameters: the combinations of inertia parameters that motions and loads along the speeds can determine.

    base = regressor.base(states, accelerations)
    found = base.fit(regressor.stacked(states, accelerations), tau)      from measured torques, with their covariance

Many states give W pi = tau, with their rows of Y one above the other. W has fewer independent columns than parameters.
QR with pivoting chooses r independent ones, and all others are W_2 = W_1 B, so that only pi_1 + B pi_2 has an effect
(Gautier 1991; Khalil & Dombre, Modeling, Identification and Control of Robots, ch. 12).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexmb.tables import arguments
from flexmb.typing import Index, Real

CLEAR = 1e4
"""Least ratio of two neighbouring pivots between which the rank is taken: rounding leaves 1e8 and more as a rule."""
NOTHING = 1e-9
"""Elements of B below this, relative to the scales of both columns, are rounding errors of zero."""


class BaseFit(NamedTuple):
    """Identified base parameters: values (r,), their covariance (r,r), and the standard deviation of the torques."""

    values: Real
    covariance: Real
    noise: float

    @property
    def deviations(self) -> Real:
        """(r,) standard deviations of the values."""
        return np.sqrt(np.diag(self.covariance))


class BaseParameters(NamedTuple):
    """names (r,): each with the parameters that have the same effect, such as "upper.inertia.zz + 0.25 lower.mass".

    matrix (r,P): the values are matrix @ pi. chosen (r,): the parameters with coefficient 1 that have no other name in
    their column. gap: ratio of the last pivot that counts to the first that does not, infinite where all count.
    """

    names: tuple[str, ...]
    matrix: Real
    chosen: Index
    gap: float

    @property
    def rank(self) -> int:
        """How many there are."""
        return len(self.names)

    def reduced(self, Y: Real) -> Real:
        """The columns (...,r) of a regressor (...,P) by which the base parameters are multiplied.

        Raises TypeError or ValueError for what is no such array of finite numbers.
        """
        Y = arguments.finite("Y", arguments.array("Y", Y))
        matrix: Real = arguments.shaped("Y", Y, (*Y.shape[:-1], self.matrix.shape[1]))[..., self.chosen]
        return matrix

    def fit(self, Y: Real, tau: Real, noise: Real | float | None = None) -> BaseFit:
        """Least squares for measured tau (n,), less what is known, with the rows of Y (n,P).

        noise: standard deviation of the measurements, one or (n,); by default it is estimated from what remains. Raises
        ValueError where the rows determine fewer parameters, OverflowError for numbers whose products overflow.
        """
        Y, tau = arguments.array("Y", Y), arguments.array("tau", tau)
        Y, tau = arguments.finite("Y", Y), arguments.finite("tau", arguments.vector("tau", tau, len(Y)))
        W = self.reduced(arguments.shaped("Y", Y, (len(tau), self.matrix.shape[1])))
        weight = np.ones(len(tau)) if noise is None else 1.0 / np.broadcast_to(_positive(noise), len(tau))
        weighed, size = W * weight[:, None], np.linalg.norm(W * weight[:, None], axis=0)
        if len(tau) <= self.rank or not np.all(size > 0.0):
            raise ValueError(f"{len(tau)} measurements do not determine {self.rank} parameters: measure livelier ones")
        U, s, Vt = np.linalg.svd(weighed / size, full_matrices=False)
        if not s[-1] > s[0] / CLEAR**2:
            raise ValueError(
                f"these motions do not determine all of the {self.rank} parameters: measure livelier ones, or name "
                "fewer bodies"
            )
        values = Vt.T @ ((U.T @ (tau * weight)) / s) / size
        left = (tau - W @ values) * weight
        deviation = 1.0 if noise is not None else float(np.sqrt(left @ left / (len(tau) - self.rank)))
        half = Vt.T / s / size[:, None] * deviation
        remaining = arguments.representable(np.sqrt(np.mean((tau - W @ values) ** 2)))
        return BaseFit(arguments.representable(values), arguments.representable(half @ half.T), float(remaining))


def base_parameters(parameters: Sequence[str], W: Real) -> BaseParameters:
    """The base parameters of these names (P,) that the rows of W (n,P) can determine.

    ValueError where no parameter has an effect, or the rank is not clear because pivots become small without a gap.
    """
    from scipy.linalg import qr, solve_triangular  # slow to import, and only identification needs it

    size = np.linalg.norm(W, axis=0)
    acting = np.flatnonzero(size > 0.0)
    if not len(acting):
        raise ValueError("no parameter has an effect on the loads of these states: take states that move")
    R, order = qr(W[:, acting] / size[acting], mode="r", pivoting=True)
    pivots = np.abs(np.diag(R))
    rank, gap = _rank(pivots, len(W))
    B = solve_triangular(R[:rank, :rank], R[:rank, rank:])
    B = np.where(np.abs(B) > NOTHING * max(1.0, float(np.max(np.abs(B), initial=0.0))), B, 0.0)
    chosen, others = acting[order[:rank]], acting[order[rank:]]
    matrix = np.zeros((rank, len(parameters)))
    matrix[np.arange(rank), chosen] = 1.0
    matrix[:, others] = B / size[chosen, None] * size[others]
    in_order = np.argsort(chosen)
    matrix, chosen = matrix[in_order], chosen[in_order]
    names = tuple(_name(parameters, row, int(first)) for row, first in zip(matrix, chosen, strict=True))
    return BaseParameters(names, matrix, chosen, gap)


def _rank(pivots: Real, rows: int) -> tuple[int, float]:
    """The number of pivots before the largest gap below which they may be rounding errors."""
    floor = rows * np.finfo(float).eps * pivots[0]
    ratios = pivots[:-1] / np.maximum(pivots[1:], floor * 2.0**-20)
    candidates = np.flatnonzero(pivots[1:] < 1e-6 * pivots[0])
    if not len(candidates):
        return len(pivots), np.inf
    last = int(candidates[np.argmax(ratios[candidates])])
    if ratios[last] < CLEAR:
        raise ValueError(
            f"the rank is not clear: pivot {last + 1} is only {ratios[last]:.1g} times the next; take more states, "
            "with larger speeds and accelerations, or name fewer bodies"
        )
    return last + 1, float(ratios[last])


def _name(names: Sequence[str], row: Real, first: int) -> str:
    rest = [i for i in np.flatnonzero(row) if i != first]
    text = names[first]
    for i in rest:
        factor = abs(row[i])
        shown = "" if np.isclose(factor, 1.0, rtol=1e-9) else f"{factor:.6g} "
        text += f" {'-' if row[i] < 0.0 else '+'} {shown}{names[i]}"
    return text


def _positive(noise: Real | float) -> Real:
    noise_sizes = arguments.array("noise", noise)
    if not np.all(np.isfinite(noise_sizes)) or not np.all(noise_sizes > 0.0):
        raise ValueError("noise is a standard deviation: give positive numbers")
    return noise_sizes
