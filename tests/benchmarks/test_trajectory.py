"""Whole runs: native loops against MuJoCo's stepping and SciPy over Pinocchio, at equal steps or tolerances."""

import numpy as np
import pytest

import flexmb as fm
from crosscheck.engines.contract import Effort, Run
from tests.benchmarks.rivals import interleaved, record, rigid_chain

BODIES = 10
T_END = 1.0


def test_rk4_steps(benchmark):
    """1000 equal RK4 steps: mj_step makes the same four evaluations a step."""
    mujoco = pytest.importorskip("mujoco", reason="the rival is not installed: pip install flexmb[peers]")
    from crosscheck.engines.links import links
    from crosscheck.engines.mujoco.tree import build_tree, initial_state

    scene = rigid_chain(BODIES)
    system = fm.compile(scene)
    tree = build_tree(links(scene), np.array(scene.gravity_m_s2))
    tree.model.opt.timestep = T_END / 1000
    data = mujoco.MjData(tree.model)

    def step_mujoco():
        mujoco.mj_resetData(tree.model, data)
        data.qpos[:], data.qvel[:] = initial_state(tree)
        mujoco.mj_step(tree.model, data, 1000)

    def run():
        return fm.simulate(system, T_END, method="rk4", step=T_END / 1000, samples=2)

    times = interleaved(run, step_mujoco)
    record(benchmark, times[0], mujoco=times[1])
    benchmark.pedantic(run, rounds=10)


@pytest.mark.parametrize("rtol", [1e-6, 1e-10])
def test_dop853(benchmark, rtol):
    """The same method at the same tolerance, compiled against SciPy over pin.aba."""
    pytest.importorskip("pinocchio", reason="the rival is not installed: pip install flexmb[peers]")
    from crosscheck.engines.pinocchio.engine import PinocchioEngine

    scene = rigid_chain(BODIES)
    system, rival = fm.compile(scene), PinocchioEngine().compile(scene)
    times_s = Run(times=np.array([0.0, T_END]))

    def run():
        return fm.simulate(system, T_END, rtol=rtol, atol=rtol, samples=2)

    times = interleaved(run, lambda: rival.simulate(times_s, Effort("tolerance", rtol, "DOP853")))
    record(benchmark, times[0], pinocchio=times[1])
    benchmark.pedantic(run, rounds=10)
