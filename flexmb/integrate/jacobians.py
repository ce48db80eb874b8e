"""What methods that linearise have in common: Jacobians that are counted and checked, and where their cost is kept."""

from __future__ import annotations

from flexmb.integrate.control import all_finite
from flexmb.jit.kernel import helper
from flexmb.tables.status import NONFINITE, OK

# Entries of `counts` behind those of `control`: Jacobians, and factorisations or exponentials of a matrix.
JACOBIANS, FACTORISATIONS = 5, 6
COUNTS = 7  # length of `counts`


@helper
def linearisation(problem, t, y, J, counts):
    """J = df/dy (n,n) at (t, y); returns a status code, which is never OK for a Jacobian that is not finite."""
    counts[JACOBIANS] += 1
    status = problem.jacobian(t, y, J, problem.exact, problem.tangent)
    if status == OK:
        for row in J:
            if not all_finite(row):
                return NONFINITE
    return status
