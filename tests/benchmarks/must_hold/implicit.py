"""Implicit methods: on trees of many speeds with Newton's method by the recursion, against the same with Jacobians; on
a closed chain with Jacobians by the recursion, against those by dual numbers."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from unittest.mock import patch

import numpy as np

import flexmb as fm
from crosscheck.library.find import shipped_folder
from flexmb.closure import jacobian
from flexmb.closure.tables import Closed
from flexmb.integrate.problem import Linear
from flexmb.scene.files import load_scene
from flexmb.system import by_recursion
from flexmb.system.constraints import Constraints
from tests.benchmarks.must_hold.row import Call, Measured, Row, how_many_times
from tests.benchmarks.rivals import flexible_chain
from tests.flexmb.closure import dual_jacobian

BODIES, MODES, T_END = 50, 5, 0.02
SETTINGS = {"radau5": {"rtol": 1e-4, "atol": 1e-6}, "generalised_alpha": {"step": 2e-3}}
LOOP, LOOP_RTOL = "stiff/four_bar", 1e-6
WITHIN_LOOP = 1e-5  # as the next, but for speeds of the bars, which rounding leads to other steps
WITHIN = 1e-4  # of the largest component: both err by what their tolerance or step permits, alike but not equally


def rows() -> list[Row]:
    """Both methods that can do without."""
    what = f"with Jacobians and dense factors, {BODIES} beams of {MODES} modes, `full`, {T_END:g} s"
    names = {method: f"`{method}` {what}" for method in SETTINGS}
    trees = [Row(f"implicit_{m}", "Implicit methods", name, 3.0, partial(_run, m)) for m, name in names.items()]
    what = f"`radau5` with Jacobians by dual numbers, `{LOOP}`, 1 s, rtol {LOOP_RTOL:g}"
    return [*trees, Row("implicit_four_bar", "Implicit methods", what, 3.0, _run_loop)]


def _run(method: fm.Method) -> Measured:
    scene = flexible_chain(BODIES, MODES, "full")
    return how_many_times(_simulated(scene, method), _with_jacobians(scene, method), WITHIN)


def _run_loop() -> Measured:
    scene = load_scene(shipped_folder() / LOOP / "scene.toml")
    return how_many_times(_loop(scene), _by_duals(scene), WITHIN_LOOP)


def _loop(scene: fm.Scene) -> Call:
    system, found = fm.compile(scene), list[fm.Trajectory]()

    def run() -> None:
        found[:] = [fm.simulate(system, 1.0, "radau5", samples=2, rtol=LOOP_RTOL, atol=1e-2 * LOOP_RTOL)]

    return Call(run, 1, lambda: np.concatenate([found[0].q[-1], found[0].u[-1]]))


def _by_duals(scene: fm.Scene) -> Call:
    call, samples, result = _loop(scene)

    def run() -> None:
        with patch.object(Constraints, "_linear", _dual):
            call()

    return Call(run, samples, result)


def _dual(_: Constraints, chain: Closed, __: Closed) -> Linear:
    tangent = dual_jacobian.chain_tangent(chain.c, chain.cc, len(chain.w.q), len(chain.w.u))
    return Linear(dual_jacobian.jacobian, jacobian.move, jacobian.resolve, chain, tangent, settles=True)


def _simulated(scene: fm.Scene, method: fm.Method) -> Call:
    system, found = fm.compile(scene), list[fm.Trajectory]()

    def run() -> None:
        found[:] = [fm.simulate(system, T_END, method, samples=2, **SETTINGS[method])]

    return Call(run, 1, lambda: np.concatenate([found[0].q[-1], found[0].u[-1]]))


def _with_jacobians(scene: fm.Scene, method: fm.Method) -> Call:
    call: Callable[[], object]
    call, samples, result = _simulated(scene, method)

    def run() -> None:
        with patch.object(by_recursion, "MANY_SPEEDS", 10**9):
            call()

    return Call(run, samples, result)
