"""Exact Jacobians against central differences of the same right-hand side, with the same columns."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb
from flexmb.entry import articulated
from flexmb.entry.tangent import tangent_workspace
from tests.benchmarks.rivals import flexible_chain, interleaved, record, rigid_chain
from tests.flexmb.entry.dual_jacobian import jacobian

SCENES = {"rigid": lambda: rigid_chain(20), "flexible": lambda: flexible_chain(10, 5, "full")}


@pytest.mark.parametrize("kind", SCENES)
def test_jacobian(benchmark, kind):
    """All columns, seven in an evaluation of duals, against two evaluations of floats for each."""
    system = flexmb.compile(SCENES[kind]())
    state, c, w = system.initial_state, system.constants, system.workspace()
    y = np.concatenate([state.q, state.u, [0.0]])
    n, dual_w = len(y), tangent_workspace(system.constants, system.nq, system.nu)
    J, plus, minus = np.empty((n, n)), np.empty(n), np.empty(n)

    def exact() -> None:
        jacobian(0.0, y, J, c, dual_w)

    def differences() -> None:
        for j in dual_w.column:
            moved = y[j]
            y[j] = moved + 1e-6
            articulated.rhs(0.0, y, plus, c, w)
            y[j] = moved - 1e-6
            articulated.rhs(0.0, y, minus, c, w)
            y[j] = moved

    native, rival = interleaved(exact, differences)
    record(benchmark, native, central_differences=rival)
    benchmark(exact)
