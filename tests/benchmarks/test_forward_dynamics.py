"""One evaluation of the accelerations, called from Python: native against Pinocchio's aba and MuJoCo's mj_forward.

python -m pytest tests/benchmarks --benchmark-columns=min,median
"""

import numpy as np
import pytest

import flexmb as fm
from tests.benchmarks.peers import mujoco_forward, pinocchio_aba
from tests.benchmarks.rivals import interleaved, record, rigid_chain


def evaluation(scene):
    """The compiled right-hand side at the initial state, as a call without arguments."""
    system = fm.compile(scene)
    state, workspace = system.initial_state, system.workspace()
    y = np.concatenate([state.q, state.u, [0.0]])
    dy = np.empty_like(y)
    return lambda: system.rhs(0.0, y, dy, system.constants, workspace)


@pytest.mark.parametrize("bodies", [1, 10, 50, 100])
def test_rigid_chain(benchmark, bodies):
    scene = rigid_chain(bodies)
    for peer in ("pinocchio", "mujoco"):
        pytest.importorskip(peer, reason="the rival is not installed: pip install flexmb[peers]")
    native = evaluation(scene)
    times = interleaved(native, pinocchio_aba(scene).call, mujoco_forward(scene).call)
    record(benchmark, times[0], pinocchio=times[1], mujoco=times[2])
    benchmark.pedantic(native, rounds=20, iterations=100)


@pytest.mark.parametrize("bodies", [10, 1000])
def test_cost_of_each_body(benchmark, bodies):
    """Compare `native_us / bodies` of the two: O(N) means that they hardly differ."""
    native = evaluation(rigid_chain(bodies))
    record(benchmark, interleaved(native)[0])
    benchmark.pedantic(native, rounds=20, iterations=10)
