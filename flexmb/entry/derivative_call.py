"""Derivatives of accelerations behind the gate of an evaluator: all that a call writes is in one bundle."""

from __future__ import annotations

import math

import numpy as np

from flexmb.entry.derivatives import DerivativeWorkspace, acceleration_derivatives, derivative_workspace
from flexmb.jit.bundle import bundle
from flexmb.jit.direct import addresses, status_at
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.pointer import MATRIX, REAL, STATUS, VECTOR
from flexmb.tables.arrays import Constants
from flexmb.tables.status import NONFINITE, OK
from flexmb.typing import Index, Real, Record


@bundle
class DerivativeCall:
    """Results (nu,nu), the workspace, and the addresses of `acceleration_derivatives` and of its tables."""

    by_displacement: Real
    by_speed: Real
    by_force: Real
    behind: Index  # (3,)
    w: DerivativeWorkspace

    @property
    def speed(self) -> Record:
        """(nu,) SPEED_STATE, where the kernel leaves udot."""
        return self.w.sweeps.speed

    @property
    def doubt(self) -> Index:
        """(1,) whether an evaluation met a pivot that may consist of rounding errors."""
        return self.w.doubt

    @property
    def fault(self) -> Index:
        """(1,) body where an evaluation failed."""
        return self.w.fault


def derivative_call(c: Constants, nq: int, nu: int, w: DerivativeWorkspace | None = None) -> DerivativeCall:
    """A bundle for calls of `differentiate`, in this workspace or one of its own; one per thread."""
    w = derivative_workspace(c, nq, nu) if w is None else w
    behind = addresses(acceleration_derivatives, STATUS, REAL, VECTOR, MATRIX, MATRIX, MATRIX, c, w)
    results = (np.zeros((nu, nu)) for _ in range(3))
    return DerivativeCall(*results, np.array(behind, np.int64), w)


@kernel
def differentiate(t, y, c, x):
    """`acceleration_derivatives` with the results in x; returns a status code, NONFINITE where one overflows."""
    results = x.by_displacement, x.by_speed, x.by_force
    status = status_at(x.behind[0], (t, y, results[0], results[1], results[2], x.behind[1], x.behind[2]))
    if status == OK and not (_is_finite(results[0]) and _is_finite(results[1]) and _is_finite(results[2])):
        return NONFINITE
    return status


@helper
def _is_finite(a):
    finite = True
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            finite &= math.isfinite(a[i, j])
    return finite
