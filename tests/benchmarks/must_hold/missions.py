"""A whole mission of a spacecraft: everything that `simulate` does, latches and a sampled controller included."""

from __future__ import annotations

import numpy as np

import flexmb as fm
from tests.benchmarks.must_hold.row import Measured, Row, measured
from tests.benchmarks.rivals import turns
from tests.repo.project import ROOT

T_END = 100.0


def rows() -> list[Row]:
    """From a scene that has been read, its kernels compiled."""
    what = f"spacecraft/deploy_and_slew, {T_END:g} s, warm"
    return [Row("satellite", "Missions", what, 1.0, _satellite, "at most", "s")]


def _satellite() -> Measured:
    scene = fm.load_scene(ROOT / "cases" / "spacecraft" / "deploy_and_slew" / "scene.toml")
    found: list[fm.Trajectory] = []

    def run() -> None:
        found[:] = [fm.simulate(scene, T_END)]

    seconds = turns(run)[:, 0]
    drift = float(np.abs(found[0].energy_drift).max() / found[0].energy_scale)
    if not (found[0].finished and len(found[0].events) == 2 and drift < 1e-9):
        raise ArithmeticError(f"{found[0].message}, {len(found[0].events)} latches, energy drifts by {drift:.1e}")
    steps = found[0].statistics.accepted_steps
    return measured(seconds, f"{steps} steps, 2 latches, 1000 samples of a controller; energy drifts by {drift:.0e}")
