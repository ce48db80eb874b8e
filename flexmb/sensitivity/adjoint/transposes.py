"""Makes the tables of the transposed equations of one part of a run."""

from __future__ import annotations

import numpy as np

from flexmb.jit.direct import address, addresses
from flexmb.jit.lanes import LANES
from flexmb.jit.pointer import MATRIX, REAL, STATUS, VECTOR, VOID
from flexmb.sensitivity.adjoint import transposed
from flexmb.sensitivity.adjoint.arc import Transposes
from flexmb.sensitivity.leg import Variation
from flexmb.system.tree_system import System
from flexmb.typing import Real


class ByLanes:
    """The blocks of dual numbers of the first `count` directions.

    gradient (.,): of the scalar by these directions, added up while steps are passed.
    """

    def __init__(self, variation: Variation, count: int) -> None:
        self.blocks = variation.blocks
        used = -(-count // LANES)
        self.which = np.array([b for b in range(used) if self.blocks.acts(b)], np.int64)
        self.gradient: Real = np.zeros(LANES * max(used, 1))


def transposes(system: System, lanes: ByLanes) -> Transposes:
    """Kernels and tables of a part of a run of a system."""
    route = system.route("articulated", 0.0)
    assert route.linear is not None
    linear = route.linear(*route.tables())
    n = system.nq + system.nu + 1
    where = np.zeros(transposed.ADDRESSES, np.int64)
    where[:3] = addresses(linear.jacobian, STATUS, REAL, VECTOR, MATRIX, linear.exact, linear.tangent)
    where[transposed.MOTION], where[transposed.MANIFOLD] = lanes.blocks.motion, lanes.blocks.manifold
    where[transposed.UNPROJECT] = addresses(transposed.off_manifold, VOID, VECTOR, VECTOR, linear.exact)[0]
    where[transposed.CONSTANTS] = address(linear.exact)
    tables = transposed.ByJacobian(
        address=where, J=np.zeros((n, n)), which=lanes.which, block=np.array(lanes.blocks.where, np.int64),
        state=lanes.blocks.state, slope=lanes.blocks.slope, gradient=lanes.gradient,
    )  # fmt: skip
    return Transposes(transposed.transpose, transposed.unproject, tables, (linear, lanes))
