"""What methods that linearise have in common: Jacobians that are counted and checked, and where their cost is kept.

A `jacobian(t, y, J, constants, workspace)` puts df/dy (n,n) into J and returns a status code, as `rhs` does for f.
"""

from __future__ import annotations

from flexmb.integrate.control import all_finite
from flexmb.kernel import generic
from flexmb.status import NONFINITE, OK

# Entries of `counts` behind those of `control`: Jacobians, and factorisations or exponentials of a matrix.
JACOBIANS, FACTORISATIONS = 4, 5
COUNTS = 6  # length of `counts`


@generic
def linearisation(jacobian, t, y, J, constants, workspace, counts):
    """J = df/dy (n,n) at (t, y); returns a status code, which is never OK for a Jacobian that is not finite."""
    counts[JACOBIANS] += 1
    status = jacobian(t, y, J, constants, workspace)
    if status == OK:
        for row in J:
            if not all_finite(row):
                return NONFINITE
    return status
