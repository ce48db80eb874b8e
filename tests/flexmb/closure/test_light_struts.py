"""Struts that are nearly massless, between closures: they cost no more steps than heavier ones."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb
from flexmb.scene.build import SceneBuilder, s

LENGTHS, ANGLES = (1.0, 0.8), (-1.0, -1.2)


def strut_between_arms(mass: float, *, loose: bool) -> s.Scene:
    """Two arms that hang 1 m apart, and a bar of this mass (kg) between their tips; `loose`: by closures at both."""
    scene = SceneBuilder("strut", gravity=(0.0, -9.81, 0.0))
    tips = []
    for i, (length, angle) in enumerate(zip(LENGTHS, ANGLES, strict=True)):
        scene.rigid_body(
            f"arm {i}", mass=1.0, com=(0.5, 0, 0), inertia=(1e-3, 1 / 12, 1 / 12), nodes={"tip": (length, 0, 0)}
        )
        scene.revolute(f"pivot {i}", "ground", f"arm {i}", parent_position=(i, 0, 0), angle=angle, rate=1.0 - i)
        tips.append(np.array([i + length * np.cos(angle), length * np.sin(angle)]))
    across, middle = tips[1] - tips[0], 0.5 * (tips[0] + tips[1])
    half, angle = 0.5 * np.linalg.norm(across), np.arctan2(across[1], across[0])
    scene.rigid_body("strut", mass=mass, inertia=tuple(mass * np.array([1e-3, 1 / 12, 1 / 12])))
    if loose:
        turn = (np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle))
        scene.free("flight", "ground", "strut", position=(*middle, 0.0), quaternion=turn)
        scene.closure("near", "spherical", "arm 0", "strut", node_a="tip", position_b=(-half, 0.0, 0.0))
    else:
        scene.revolute(
            "near", "arm 0", "strut", parent_node="tip", child_position=(-half, 0.0, 0.0), angle=angle - ANGLES[0]
        )
    scene.closure("far", "spherical", "arm 1", "strut", node_a="tip", position_b=(half, 0.0, 0.0))
    return scene.scene()


@pytest.mark.parametrize("loose", [True, False])
def test_steps_do_not_depend_on_how_light_a_strut_is(loose):
    runs = {mass: flexmb.simulate(strut_between_arms(mass, loose=loose), 2.0, samples=5)
            for mass in (1e-3, 1e-6, 1e-8, 1e-10)}  # fmt: skip
    assert all(run.finished for run in runs.values())
    steps = {mass: run.statistics.accepted_steps + run.statistics.rejected_steps for mass, run in runs.items()}
    assert max(steps.values()) <= 1.1 * steps[1e-3], steps
    # what a strut changes is proportional to its mass
    limit = runs[1e-10].q[:, 0]
    for mass in (1e-6, 1e-8):
        expected = mass / 1e-3 * (runs[1e-3].q[:, 0] - limit)
        assert np.max(np.abs(runs[mass].q[:, 0] - limit - expected)) < 1e-2 * np.max(np.abs(expected)) + 1e-8
    assert np.max(np.abs(runs[1e-10].energy_drift)) < 1e-8
