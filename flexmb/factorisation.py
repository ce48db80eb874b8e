"""The mass matrix of one state in factors, M = F F', by recursion: solutions and products in O(N), M never formed.

Jain & Rodriguez (54)-(56): F = (1 + H Phi K) D^1/2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexmb.arrays import Constants, Real, Workspace
from flexmb.coordinates import load_state
from flexmb.jain import innovations
from flexmb.jain.response import Response, response
from flexmb.kernel import helper, kernel
from flexmb.status import NOT_POSITIVE_DEFINITE, OK


@kernel
def factorise(t, y, scene, c, w):
    """Factors into w: the state with the functions of `scene`, free speeds as in c; returns a status code."""
    load_state(t, y, scene, w)
    return OK if innovations.factorise(c, w) else NOT_POSITIVE_DEFINITE


@kernel
def solve(c, w, x, b):
    """Rows of b (m,nu) replaced by M^-1 b."""
    for row in range(b.shape[0]):
        _apply(c, x, b[row])
        innovations.innovations(c, w, x)
        innovations.respond(c, w, x)
        for j in range(b.shape[1]):
            b[row, j] = x.speed[j].acceleration


@kernel
def half_solve(c, w, x, b):
    """Rows of b (m,nu) replaced by F^-1 b."""
    for row in range(b.shape[0]):
        _apply(c, x, b[row])
        innovations.innovations(c, w, x)
        for j in range(b.shape[1]):
            b[row, j] = x.speed[j].innovation


@kernel
def multiply(c, w, x, b):
    """Rows of b (m,nu) replaced by M b."""
    for row in range(b.shape[0]):
        innovations.clear(c, x)
        for j in range(b.shape[1]):
            x.speed[j].acceleration = b[row, j]
        innovations.excite(c, w, x)
        innovations.synthesise(c, w, x)
        for j in range(b.shape[1]):
            b[row, j] = x.speed[j].applied


@kernel
def log_determinant(c, w):
    """log det M."""
    return innovations.log_determinant(c, w)


@helper
def _apply(c, x, b):
    innovations.clear(c, x)
    for j in range(b.shape[0]):
        x.speed[j].applied = b[j]


class MassMatrixFactors:
    """M (nu,nu) of one state as F F' in the order of u, all speeds free; every product costs O(N)."""

    def __init__(self, constants: Constants, workspace: Workspace, t: float, y: Real) -> None:
        """Keeps `workspace` for itself; `status` says whether M was positive definite."""
        speed = constants.speed.copy()
        speed["prescribed"] = -1
        self._c, self._w = replace(constants, speed=speed), workspace
        self._x: Response = response(constants)
        self.status: int = factorise(t, y, constants, self._c, workspace)

    @property
    def fault(self) -> int:
        """Number of the body whose D is not positive definite."""
        return int(self._w.fault[0])

    def solve(self, b: Real) -> Real:
        """M^-1 b for b (nu,) or (nu,m)."""
        return self._by_columns(solve, b)

    def half_solve(self, b: Real) -> Real:
        """F^-1 b for b (nu,) or (nu,m): |F^-1 b|^2 = b' M^-1 b."""
        return self._by_columns(half_solve, b)

    def multiply(self, x: Real) -> Real:
        """M x for x (nu,) or (nu,m)."""
        return self._by_columns(multiply, x)

    @property
    def log_determinant(self) -> float:
        """log det M."""
        return float(log_determinant(self._c, self._w))

    def _by_columns(self, apply, b: Real) -> Real:  # type: ignore[no-untyped-def]
        b = np.asarray(b, float)
        if b.ndim not in (1, 2) or len(b) != len(self._c.speed):
            raise ValueError(f"this mass matrix has {len(self._c.speed)} rows, got an array of shape {b.shape}")
        rows = np.array(np.atleast_2d(b.T), order="C")
        apply(self._c, self._w, self._x, rows)
        return rows[0] if b.ndim == 1 else rows.T
