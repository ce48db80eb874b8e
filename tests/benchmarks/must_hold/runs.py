"""Whole runs of a rigid chain of ten bodies, everything that `simulate` does included."""

from __future__ import annotations

from functools import partial

import numpy as np

import flexmb as fm
from flexmb.scene.schema import Scene
from tests.benchmarks import peers
from tests.benchmarks.must_hold.row import Call, Measured, Row, how_many_times
from tests.benchmarks.rivals import rigid_chain

GROUP = "Whole runs, 10 bodies, 1 s"
BODIES, T_END, STEPS = 10, 1.0, 1000
SAME_STEPS = 1e-7  # of the same method at the same steps: rounding, grown over a second of a chaotic chain
OF_TOLERANCE = 1e4  # two adaptive runs: what the tolerance of one step becomes over some hundred of them


def rows() -> list[Row]:
    """The same method at the same steps or tolerances."""
    return [
        Row("rk4", GROUP, f"mj_step, RK4, {STEPS} steps", 2.5, _rk4),
        *(
            Row(f"dop853_{rtol:g}", GROUP, f"solve_ivp over pin.aba, rtol {rtol:g}", 8.0, partial(_dop853, rtol))
            for rtol in (1e-6, 1e-10)
        ),
    ]


def _rk4() -> Measured:
    scene = rigid_chain(BODIES)
    native = _simulated(fm.compile(scene), method="rk4", step=T_END / STEPS)
    return how_many_times(native, peers.mujoco_steps(scene, T_END, STEPS), SAME_STEPS)


def _dop853(rtol: float) -> Measured:
    scene = rigid_chain(BODIES)
    native = _simulated(fm.compile(scene), method="dop853", rtol=rtol, atol=rtol)
    return how_many_times(native, _solve_ivp(scene, rtol), OF_TOLERANCE * rtol)


def _simulated(system: fm.System, **settings) -> Call:
    found = list[fm.Trajectory]()

    def run() -> None:
        found[:] = [fm.simulate(system, T_END, samples=2, **settings)]

    return Call(run, 1, lambda: np.concatenate([found[0].q[-1], found[0].u[-1]]))


def _solve_ivp(scene: Scene, rtol: float) -> Call:
    """SciPy's DOP853 with a right-hand side that does nothing but call `pin.aba` and put both rates into one array."""
    import pinocchio as pin
    from scipy.integrate import solve_ivp

    tree, q, v = peers.pinocchio_tree(scene)
    model, data, n, tau = tree.model, tree.model.createData(), tree.model.nv, np.zeros(tree.model.nv)
    start, found = np.concatenate([q, v]), list[np.ndarray]()

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[n:], pin.aba(model, data, y[:n], y[n:], tau)])

    def run() -> None:
        done = solve_ivp(rate, (0.0, T_END), start, "DOP853", t_eval=(T_END,), rtol=rtol, atol=rtol)
        found[:] = [done.y[:, -1]]

    return Call(run, 1, lambda: found[0])
