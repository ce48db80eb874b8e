"""Implicit methods on trees of many speeds: Newton's method by the recursion, against the same with Jacobians."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from unittest.mock import patch

import numpy as np

import flexmb as fm
from flexmb.system import by_recursion
from tests.benchmarks.must_hold.row import Call, Measured, Row, how_many_times
from tests.benchmarks.rivals import flexible_chain

BODIES, MODES, T_END = 50, 5, 0.02
SETTINGS = {"radau5": {"rtol": 1e-4, "atol": 1e-6}, "generalised_alpha": {"step": 2e-3}}
WITHIN = 1e-4  # of the largest component: both err by what their tolerance or step permits, alike but not equally


def rows() -> list[Row]:
    """Both methods that can do without."""
    what = f"with Jacobians and dense factors, {BODIES} beams of {MODES} modes, `full`, {T_END:g} s"
    names = {method: f"`{method}` {what}" for method in SETTINGS}
    return [Row(f"implicit_{m}", "Implicit methods", name, 3.0, partial(_run, m)) for m, name in names.items()]


def _run(method: fm.Method) -> Measured:
    scene = flexible_chain(BODIES, MODES, "full")
    return how_many_times(_simulated(scene, method), _with_jacobians(scene, method), WITHIN)


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
