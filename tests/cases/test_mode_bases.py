"""The lowest frequency of one panel by modes clamped at its mount, by free-free modes, and with attachments."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.linalg import eigh

from flexmb import compile
from flexmb.modal.flexible import flexible_model
from flexmb.scene.files import load_scene
from flexmb.scene.schema import Weld

CASE = Path(__file__).parents[2] / "cases" / "spacecraft" / "mode_bases"
# Euler's and Bernoulli's cantilever, 1.8751^2 sqrt(EI/m)/l^2; the section's rotary inertia takes 2e-5 off.
LOWEST = 1.8751040687**2 * np.sqrt(300.0) / 9.0


def lowest(name: str) -> float:
    """Of the panel on a hub that is held, rad/s."""
    scene = load_scene(CASE / f"{name}.toml")
    panel = replace(scene.bodies[1], level="full")
    held = Weld(name="flight", parent="ground", child="hub")
    scene = replace(scene, bodies=(scene.bodies[0], panel), hinges=(held, scene.hinges[1]), loads=())
    system = compile(scene)
    squares = eigh(flexible_model(panel).stiffness, system.mass_matrix(system.initial_state), eigvals_only=True)
    return float(np.sqrt(squares[0]))


@pytest.mark.parametrize("name", ["scene", "clamped_2", "static"])
def test_modes_that_fit_the_mount_are_right(name: str) -> None:
    assert abs(lowest(name) / LOWEST - 1.0) < 5e-5


def test_free_free_modes_alone_are_too_stiff_by_one_over_their_number() -> None:
    """Ritz: from above. Twice the modes, half the error: the curvature at the mount is missing from each."""
    errors = [lowest(f"free_{n}") / LOWEST - 1.0 for n in (3, 6, 12)]
    assert errors[0] > errors[1] > errors[2] > 0.05
    assert 1.7 < errors[0] / errors[1] < 2.1
    assert 1.7 < errors[1] / errors[2] < 2.1
