"""The mass matrix of one state in factors, M = F F', by recursion: solutions and products in O(N), M never formed.

Jain & Rodriguez (54)-(56): F = (1 + H Phi K) D^1/2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flexmb.entry import factorisation
from flexmb.jain.response import Response, response
from flexmb.kept import kept
from flexmb.tables import arguments
from flexmb.tables.arrays import Constants, Workspace
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import finite_result
from flexmb.typing import Real

ROUNDING = 2.0**-53
# 16 units of roundoff. Estimates of 1/kappa for singular scenes were 2 units at most, and 90 for definite ones of which
# a digit was left.
NEGLIGIBLE = 2.0**-49
STEPS = 30  # of the power method at most
CONVERGED = 1.1  # growth of the estimate in a step below which it is final: kappa is needed to a digit


class Condition(NamedTuple):
    """kappa: see `flexmb.jain.precision`; speed: index in u of the speed whose pivot magnifies rounding most."""

    kappa: float
    speed: int

    @property
    def digits(self) -> float:
        """Significant decimal digits that rounding leaves of the accelerations, 0 to 16."""
        return float(np.clip(-np.log10(np.maximum(self.kappa, 1.0) * ROUNDING), 0.0, 16.0))

    @property
    def is_singular(self) -> bool:
        """Whether M cannot be told from a singular matrix (NaN cannot either)."""
        return not self.kappa * NEGLIGIBLE < 1.0


class _Factors(NamedTuple):
    """The status of the factorisation, the workspace that holds the factors, and the scratch arrays of products."""

    status: int
    w: Workspace
    x: Response


class MassMatrixFactors:
    """M (nu,nu) of one state as F F' in the order of u; every product costs O(N).

    Threads may share it: products write to the workspace of the factors, so each thread factorises once for itself.
    """

    def __init__(
        self, constants: Constants, made: Callable[[], Workspace], t: float, y: Real, held: Constants | None = None
    ) -> None:
        """`made` makes workspaces; `status` says whether M was positive definite.

        Speeds that `held` prescribes are left out; by default none is.
        """
        if held is None:
            speed = constants.speed.copy()
            speed["prescribed"] = -1
            held = replace(constants, speed=speed)
        self._tree, self._c, self._made = constants, held, made
        self._t, self._y = t, y.copy()
        self.status = self._factors.status

    @property
    def is_doubtful(self) -> bool:
        """Whether a pivot is so small that it may be rounding."""
        return bool(self._factors.w.doubt[0])

    @property
    def fault(self) -> int:
        """Number of the body whose D is not positive definite."""
        return int(self._factors.w.fault[0])

    def solve(self, b: Real) -> Real:
        """M^-1 b for b (nu,) or (nu,m); this and all products raise ValueError or TypeError for other arrays."""
        return self._by_columns(factorisation.solve, b)

    def half_solve(self, b: Real) -> Real:
        """F^-1 b for b (nu,) or (nu,m): |F^-1 b|^2 = b' M^-1 b."""
        return self._by_columns(factorisation.half_solve, b)

    def half_multiply(self, y: Real) -> Real:
        """F y for y (nu,) or (nu,m), the inverse of `half_solve`; with the unit matrix, F itself."""
        return self._by_columns(factorisation.half_multiply, y)

    def multiply(self, x: Real) -> Real:
        """M x for x (nu,) or (nu,m)."""
        return self._by_columns(factorisation.multiply, x)

    @kept
    def condition(self) -> Condition:
        """Condition number of the scaled M, by the power method on F^-1 S'S F'^-1; each step is O(N)."""
        free = self._c.speed["prescribed"] < 0
        y = np.where(free, np.random.default_rng(0).normal(size=len(free)), 0.0)
        kappa, size = 0.0, float(np.linalg.norm(y))
        _, w, x = self._factors
        for _ in range(STEPS):
            if not 0.0 < size < np.inf:
                break
            y /= size
            factorisation.weigh(self._c, w, x, y)
            before, size = size, float(np.linalg.norm(y))
            kappa = size
            if size <= CONVERGED * before:
                break
        return Condition(kappa, int(np.argmax(np.abs(y))) if len(y) else 0)

    @property
    def log_determinant(self) -> float:
        """log det M."""
        return float(factorisation.log_determinant(self._c, self._factors.w))

    @per_thread
    def _factors(self) -> _Factors:
        w = self._made()
        return _Factors(factorisation.factorise(self._t, self._y, self._tree, self._c, w), w, response(self._tree))

    def _by_columns(self, apply: Callable[..., None], b: Real) -> Real:
        b = arguments.finite("the array", arguments.array("the array", b))
        if b.ndim not in (1, 2) or len(b) != len(self._c.speed):
            raise ValueError(f"this mass matrix has {len(self._c.speed)} rows, got an array of shape {b.shape}")
        rows = np.array(np.atleast_2d(b.T), order="C")
        _, w, x = self._factors
        apply(self._c, w, x, rows)
        finite_result(rows, self._t)
        solution: Real = rows[0] if b.ndim == 1 else rows.T
        return solution
