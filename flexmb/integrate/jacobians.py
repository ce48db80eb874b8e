"""Jacobians that are counted and checked, for all methods that need them."""

from __future__ import annotations

from flexmb.integrate.control import JACOBIANS, all_finite
from flexmb.jit.kernel import helper
from flexmb.tables.status import NONFINITE, OK


@helper
def linearisation(problem, t, y, J, counts):
    """J = df/dy (n,n) at (t, y); returns a status code, which is not OK if the Jacobian is not finite."""
    counts[JACOBIANS] += 1
    status = problem.jacobian(t, y, J, problem.exact, problem.tangent)
    if status == OK:
        for row in J:
            if not all_finite(row):
                return NONFINITE
    return status
