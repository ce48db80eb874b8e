"""Derivatives of whole runs, in runs: the satellite by twelve numbers; a fit."""

from __future__ import annotations

import numpy as np

import flexmb as fm
from tests.benchmarks.must_hold.row import Measured, Row, measured
from tests.benchmarks.rivals import turns
from tests.repo.project import ROOT

T_END = 100.0
BY = (
    "hub.mass_kg", "hub.inertia_kg_m2.1.1", "left_hinge.rotation.stiffness_Nm_rad",
    "left_hinge.rotation.damping_Nms_rad", "right_hinge.rotation.stiffness_Nm_rad", "slosh.mass_kg",
    "slosh.coordinates.0.stiffness_N_m", "left.stations.*.EIy_Nm2", "left.stations.*.mass_per_length_kg_m",
    "attitude.parameters.3", "attitude.parameters.8", "left latches.level",
)  # fmt: skip
OF = ("left_tip.position.x", "right_tip.position.y", "left_hinge.torque.y", "tracker.quaternion.x", "wheel_y.speed")


def rows() -> list[Row]:
    """Both in one process, in turns, kernels compiled."""
    what = f"derivatives of spacecraft/deploy_and_slew by {len(BY)} numbers, {T_END:g} s, 2 latches, over the run"
    return [Row("sensitivity", "Derivatives", what, 8.0, _satellite, "at most")]


def _satellite() -> Measured:
    scene = fm.load_scene(ROOT / "cases" / "spacecraft" / "deploy_and_slew" / "scene.toml")
    found: list[fm.Sensitivities] = []

    def derivatives() -> None:
        found[:] = [fm.sensitivities(scene, T_END, BY, OF)]

    def run() -> None:
        fm.simulate(scene, T_END)

    seconds = turns(derivatives, run, rounds=7)
    if not (len(found[0].events) == 2 and np.isfinite(found[0].derivatives).all()):
        raise ArithmeticError(f"{len(found[0].events)} latches, and derivatives that are not finite")
    whole, alone = np.median(seconds, axis=0)
    return measured(seconds[:, 0] / seconds[:, 1], f"{whole:.2f} s over {alone:.3f} s, {len(OF)} outputs at 201 times")
