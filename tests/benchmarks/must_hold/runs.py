"""Whole runs of a rigid chain of ten bodies, everything that `simulate` does included."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import msgspec
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import OptimizeResult

import flexmb as fm
from flexmb.scene.schema import Scene
from tests.benchmarks import peers
from tests.benchmarks.must_hold.row import Call, Measured, Row, how_many_times
from tests.benchmarks.rivals import rigid_chain, turns

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
    found = how_many_times(native, _solve_ivp(scene, rtol), OF_TOLERANCE * rtol)
    detail = f"{found.detail}, of which {_scipys_share(scene, rtol):.0%} are SciPy's own"
    return msgspec.structs.replace(found, detail=detail)


def _scipys_share(scene: Scene, rtol: float) -> float:
    """Share of the time of `solve_ivp` that is not spent in `pin.aba`, whose calls are timed alone and in turns."""
    run, aba = scipy_over_aba(scene), peers.pinocchio_aba(scene)
    whole, each = np.median(turns(lambda: run("DOP853", rtol), aba.call), axis=0)
    return float(1.0 - run("DOP853", rtol).nfev * each / whole)


def _simulated(system: fm.System, **settings) -> Call:
    found = list[fm.Trajectory]()

    def run() -> None:
        found[:] = [fm.simulate(system, T_END, samples=2, **settings)]

    return Call(run, 1, lambda: np.concatenate([found[0].q[-1], found[0].u[-1]]))


def _solve_ivp(scene: Scene, rtol: float) -> Call:
    run, found = scipy_over_aba(scene), list[np.ndarray]()

    def call() -> None:
        found[:] = [run("DOP853", rtol).y[:, -1]]

    return Call(call, 1, lambda: found[0])


def scipy_over_aba(scene: Scene) -> Callable[[str, float], OptimizeResult]:
    """A run by a method of SciPy's at a relative and absolute tolerance; `y` (2 nv, 1) is the last state.

    The right-hand side does nothing but call `pin.aba` and put both rates into one array.
    """
    import pinocchio as pin

    tree, q, v = peers.pinocchio_tree(scene)
    model, data, n, tau = tree.model, tree.model.createData(), tree.model.nv, np.zeros(tree.model.nv)
    start = np.concatenate([q, v])

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[n:], pin.aba(model, data, y[:n], y[n:], tau)])

    return lambda method, rtol: solve_ivp(rate, (0.0, T_END), start, method, t_eval=(T_END,), rtol=rtol, atol=rtol)
