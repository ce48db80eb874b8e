"""Scenes that tests export: a tree with much in it, and a loop."""

from __future__ import annotations

import shutil
from typing import Any

import numpy as np

import flexmb as fm
from flexmb.scene.shapes import beam_section
from tests.flexmb.closure import mechanisms

COMPILER = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
SECTION = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700)
PUSH = fm.Pulse(value=3.0, start_s=0.013, duration_s=0.02)


def machine() -> fm.Scene:
    """A free body with a wheel, a driven and a sprung arm, an elastic beam, and loads that are constant or jump."""
    scene = fm.SceneBuilder("a 'machine', 100 % \"quoted\"?", gravity=(0.1, -0.2, -9.81))
    scene.rigid_body("hub", mass=2.0, inertia=(0.3, 0.4, 0.5)).rigid_body("arm", mass=0.5, inertia=(0.02, 0.03, 0.04))
    scene.rigid_body("lever", mass=0.7, inertia=(0.02, 0.05, 0.04))
    scene.beam("rod", length=0.6, elements=6, section=SECTION, modes=3)
    scene.free("flight", "ground", "hub", angular_velocity=(0.3, -0.4, 0.5))
    scene.revolute(
        "pivot", "hub", "arm", parent_position=(0.2, 0.1, 0.0), angle=0.4, rate=1.0, stiffness=3.0, damping=0.1,
        torque=fm.Constant(value=0.2),
    )  # fmt: skip
    scene.revolute("crank", "hub", "lever", axis=(1, 0, 0), prescribed=fm.SpinUp(rate=2.0, duration_s=0.5))
    scene.revolute("root", "arm", "rod", parent_position=(0.1, 0.0, 0.0), axis=(0, 1, 0), angle=-0.2)
    scene.wheel("spin", "hub", axis=(0, 0, 1), mass=0.1, axial_inertia=0.01, transverse_inertia=0.006, speed=30.0)
    scene.force("push", "rod", node="tip", direction=(0, 0, 1), function=PUSH)
    scene.force("hold", "arm", direction=(0, 1, 0), function=fm.Constant(value=0.2))
    scene.marker("end", "rod", node="tip")
    return scene.scene()


def mechanism() -> fm.Scene:
    """A four-bar whose last pin suppresses only what is not redundant."""
    scene = mechanisms.four_bar_builder({"angle": 1.0, "rate": mechanisms.RATE}, {}, closure="in_line")
    return scene.scene()


def some_state(system: fm.System, seed: int = 0) -> Any:
    y = system.initial_state.y.copy()
    return y + 0.05 * np.random.default_rng(seed).standard_normal(len(y)) * (np.arange(len(y)) < len(y) - 1)
