"""Flexible chains of ten bodies: composite bodies and Cholesky's factors over the recursion."""

from __future__ import annotations

from functools import partial

import flexmb as fm
from flexmb.scene.schema import Level
from tests.benchmarks.must_hold.native import kernel
from tests.benchmarks.must_hold.row import Measured, Row, how_many_times
from tests.benchmarks.rivals import flexible_chain
from tests.benchmarks.routes import composite_body

GROUP = "Ten flexible bodies, composite over articulated"
GOALS: dict[Level, dict[int, float]] = {
    "ruthless": {5: 4.5, 10: 8.0, 20: 25.0}, "full": {5: 4.0, 10: 7.0, 20: 15.0},
}  # fmt: skip
CONDITIONING = 1e-6  # the condensed form and the factors of the whole matrix, with 20 modes


def rows() -> list[Row]:
    """Modes clamped at the root, evaluations one after the other as in a run."""
    return [
        Row(f"modes_{level}_{modes}", GROUP, f"{level}, {modes} modes", goal, partial(_composite, level, modes))
        for level, goals in GOALS.items()
        for modes, goal in goals.items()
    ]


def _composite(level: Level, modes: int) -> Measured:
    system = fm.compile(flexible_chain(10, modes, level))
    return how_many_times(kernel(system), kernel(system, composite_body), CONDITIONING)
