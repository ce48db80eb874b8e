"""Peers at their best settings on rigid trees, as calls that reuse their own arrays.

A peer that is not installed raises ModuleNotFoundError, which skips a benchmark.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from crosscheck.engines.links import links
from flexmb.scene.schema import Scene
from tests.benchmarks.must_hold.row import Call


def pinocchio_aba(scene: Scene) -> Call:
    """`pin.aba` at the initial state, called from Python."""
    import pinocchio as pin

    tree, q, v = pinocchio_tree(scene)
    data, tau = tree.model.createData(), np.zeros(tree.model.nv)
    return Call(lambda: pin.aba(tree.model, data, q, v, tau), 1, lambda: data.ddq)


def pinocchio_derivatives(scene: Scene, x: np.ndarray, *, inverse: bool = False) -> Call:
    """`pin.computeABADerivatives` at forces x, or `pin.computeRNEADerivatives` at accelerations x, from Python."""
    import pinocchio as pin

    tree, q, v = pinocchio_tree(scene)
    data = tree.model.createData()
    function = pin.computeRNEADerivatives if inverse else pin.computeABADerivatives

    def result() -> np.ndarray:
        found = (data.dtau_dq, data.dtau_dv, data.M) if inverse else (data.ddq_dq, data.ddq_dv, data.Minv)
        symmetric = np.triu(found[2]) + np.triu(found[2], 1).T
        return np.concatenate([found[0].ravel(), found[1].ravel(), symmetric.ravel()])

    return Call(lambda: function(tree.model, data, q, v, x), 1, result)


def aba_in_parallel(scene: Scene, samples: int) -> Call:
    """`pin.abaInParallel` on one thread over copies of the initial state: Pinocchio's C++ without Python in between."""
    import pinocchio as pin

    tree, q, v = pinocchio_tree(scene)
    pool = pin.ModelPool(tree.model, 1)

    def copies(column: np.ndarray) -> np.ndarray:
        return np.asfortranarray(np.tile(column[:, None], samples))

    states = copies(q), copies(v), copies(np.zeros(tree.model.nv))
    found = np.zeros((tree.model.nv, samples), order="F")
    return Call(lambda: pin.abaInParallel(1, pool, *states, found), samples, lambda: found.T)


def mujoco_forward(scene: Scene) -> Call:
    """`mj_forward` at the initial state, called from Python."""
    import mujoco

    model, data = _mujoco(scene)
    return Call(lambda: mujoco.mj_forward(model, data), 1, lambda: data.qacc)


def mujoco_steps(scene: Scene, t_end: float, steps: int) -> Call:
    """A run of equal RK4 steps by one call of `mj_step`; the result is the last state."""
    run, found = mujoco_runs(scene, t_end), list[np.ndarray]()

    def call() -> None:
        found[:] = [run(steps)]

    return Call(call, 1, lambda: found[0])


def mujoco_runs(scene: Scene, t_end: float) -> Callable[[int], np.ndarray]:
    """A function of the number of equal RK4 steps, which are one call of `mj_step`: the state [q, v] at t_end."""
    import mujoco

    model, data = _mujoco(scene)
    q, v = data.qpos.copy(), data.qvel.copy()

    def run(steps: int) -> np.ndarray:
        model.opt.timestep = t_end / steps
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_step(model, data, steps)
        return np.concatenate([data.qpos, data.qvel])

    return run


def mujoco_rollout(scene: Scene, copies: int, steps: int) -> Call:
    """`mujoco.rollout` on one thread: Euler steps of copies of the initial state, one evaluation each.

    The result is the acceleration of the first step of every copy, [copies, nv], from its change of speed.
    """
    import mujoco
    from mujoco.rollout import rollout

    model, data = _mujoco(scene)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    model.opt.timestep = 1e-3
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start = np.empty(size)
    mujoco.mj_getState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    starts, reached = np.tile(start, (copies, 1)), np.empty((copies, steps, size))
    sensors, models = np.empty((copies, steps, model.nsensordata)), [model] * copies
    speeds = slice(1 + model.nq, 1 + model.nq + model.nv)

    def run() -> None:
        rollout(models, [data], starts, nstep=steps, skip_checks=True, state=reached, sensordata=sensors)

    return Call(run, copies * steps, lambda: (reached[:, 0, speeds] - start[speeds]) / model.opt.timestep)


def pinocchio_tree(scene: Scene) -> tuple[Any, np.ndarray, np.ndarray]:
    from crosscheck.engines.pinocchio.tree import build_tree, initial_state

    tree = build_tree(links(scene), np.array(scene.gravity_m_s2))
    return tree, *initial_state(tree)


def _mujoco(scene: Scene) -> tuple[Any, Any]:
    """Model and data at the initial state, without what such a scene has none of: contacts, constraints, sensors."""
    import mujoco

    from crosscheck.engines.mujoco.tree import build_tree, initial_state

    tree = build_tree(links(scene), np.array(scene.gravity_m_s2))
    off = mujoco.mjtDisableBit
    tree.model.opt.disableflags |= int(off.mjDSBL_CONSTRAINT) | int(off.mjDSBL_SENSOR) | int(off.mjDSBL_ACTUATION)
    data = mujoco.MjData(tree.model)
    data.qpos[:], data.qvel[:] = initial_state(tree)
    return tree.model, data
