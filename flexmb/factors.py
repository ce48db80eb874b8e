"""The mass matrix of one state in factors, M = F F', by recursion: solutions and products in O(N), M never formed.

Jain & Rodriguez (54)-(56): F = (1 + H Phi K) D^1/2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flexmb import arguments, factorisation
from flexmb.arrays import Constants, Real, Workspace
from flexmb.jain.response import Response, response
from flexmb.state import finite_result


class MassMatrixFactors:
    """M (nu,nu) of one state as F F' in the order of u, all speeds free; every product costs O(N)."""

    def __init__(self, constants: Constants, workspace: Workspace, t: float, y: Real) -> None:
        """Keeps `workspace` for itself; `status` says whether M was positive definite."""
        speed = constants.speed.copy()
        speed["prescribed"] = -1
        self._c, self._w = replace(constants, speed=speed), workspace
        self._x: Response = response(constants)
        self._t = t
        self.status: int = factorisation.factorise(t, y, constants, self._c, workspace)

    @property
    def fault(self) -> int:
        """Number of the body whose D is not positive definite."""
        return int(self._w.fault[0])

    def solve(self, b: Real) -> Real:
        """M^-1 b for b (nu,) or (nu,m); as of its kin, ValueError or TypeError for an array that is not that."""
        return self._by_columns(factorisation.solve, b)

    def half_solve(self, b: Real) -> Real:
        """F^-1 b for b (nu,) or (nu,m): |F^-1 b|^2 = b' M^-1 b."""
        return self._by_columns(factorisation.half_solve, b)

    def half_multiply(self, y: Real) -> Real:
        """F y for y (nu,) or (nu,m): what `half_solve` undoes; F itself of the unit matrix."""
        return self._by_columns(factorisation.half_multiply, y)

    def multiply(self, x: Real) -> Real:
        """M x for x (nu,) or (nu,m)."""
        return self._by_columns(factorisation.multiply, x)

    @property
    def log_determinant(self) -> float:
        """log det M."""
        return float(factorisation.log_determinant(self._c, self._w))

    def _by_columns(self, apply: Callable[..., None], b: Real) -> Real:
        b = arguments.finite("the array", arguments.array("the array", b))
        if b.ndim not in (1, 2) or len(b) != len(self._c.speed):
            raise ValueError(f"this mass matrix has {len(self._c.speed)} rows, got an array of shape {b.shape}")
        rows = np.array(np.atleast_2d(b.T), order="C")
        apply(self._c, self._w, self._x, rows)
        finite_result(rows, self._t)
        found: Real = rows[0] if b.ndim == 1 else rows.T
        return found
