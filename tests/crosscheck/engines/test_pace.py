"""How fast a scene goes: rates, swinging and springs against formulas, in whatever place and attitude."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.engines.functions_of_time import fastest_change
from crosscheck.engines.pace import fastest_mode, pace
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.scene.schema import Scene

G, MASS, ARM, OWN = 9.81, 2.0, 0.7, 0.05
ABOUT_PIVOT = OWN + MASS * ARM**2


def _arm(builder: SceneBuilder) -> SceneBuilder:
    return builder.rigid_body("arm", mass=MASS, com=(ARM, 0.0, 0.0), inertia=(OWN, OWN, OWN))


@pytest.mark.parametrize("angle", [0.0, 0.5 * np.pi, 2.0])
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (30.0, -20.0, 5.0)])
def test_a_pendulum_swings_as_fast_wherever_it_begins(angle: float, place: tuple[float, float, float]) -> None:
    scene = _arm(SceneBuilder("pendulum", gravity=(0.0, 0.0, -G)))
    scene = scene.revolute("pivot", "ground", "arm", axis=(0.0, 1.0, 0.0), angle=angle, position=place).scene()
    assert pace(scene, 1.0) == pytest.approx((np.sqrt(MASS * G * ARM / ABOUT_PIVOT), 0.0, 0.0))


def test_a_free_body_has_its_turning_rate_and_no_pendulum() -> None:
    spin = (0.0, 3.0, 4.0)
    scene = _arm(SceneBuilder("thrown", gravity=(0.0, 0.0, -G))).free("loose", "ground", "arm", angular_velocity=spin)
    assert pace(scene.scene(), 1.0) == pytest.approx((5.0, 0.0, 0.0))


def _chained() -> Scene:
    """Two carriages in a row on springs, with masses 1 and 3 kg and stiffnesses 5 and 7 N/m."""
    return (
        SceneBuilder("carriages")
        .rigid_body("first", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .rigid_body("second", mass=3.0, inertia=(1.0, 1.0, 1.0))
        .prismatic("near", "ground", "first", axis=(0.6, 0.0, 0.8), stiffness=5.0)
        .prismatic("far", "first", "second", axis=(0.6, 0.0, 0.8), stiffness=7.0)
        .scene()
    )


def test_springs_in_a_chain_have_its_highest_frequency() -> None:
    M, K = np.array([[4.0, 3.0], [3.0, 3.0]]), np.diag([5.0, 7.0])
    highest = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).max())
    assert pace(_chained(), 1.0).elastic == pytest.approx(highest, rel=1e-9)


def test_the_mass_matrix_is_the_native_one() -> None:
    """By their damping poles: hinges of all kinds, turned and moved, point masses and wheels with their own."""
    from crosscheck.engines.native import NativeEngine

    scene = (
        _arm(SceneBuilder("tree", gravity=(0.0, 0.0, -G)))
        .rigid_body("hand", mass=0.7, com=(0.1, 0.2, -0.1), inertia=(0.02, 0.03, 0.04))
        .spherical("shoulder", "ground", "arm", quaternion=(0.8, 0.6, 0.0, 0.0), stiffness=3.0)
        .revolute("wrist", "arm", "hand", axis=(0.0, 0.6, 0.8), angle=0.4, position=(1.0, 0.1, 0.0), stiffness=11.0)
        .scene()
    )
    system = NativeEngine().compile(scene)._system
    M = system.mass_matrix(system.initial_state.q)
    highest = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, np.diag([3.0, 3.0, 3.0, 11.0]))).real.max())
    assert pace(scene, 1.0).elastic == pytest.approx(highest, rel=1e-9)


def test_a_spring_on_what_has_no_mass_has_no_say() -> None:
    scene = (
        SceneBuilder("massless")
        .rigid_body("link", mass=0.0, inertia=(0.0, 0.0, 0.0))
        .revolute("pivot", "ground", "link", axis=(0.0, 1.0, 0.0), stiffness=5.0)
        .scene()
    )
    assert pace(scene, 1.0) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("function", [Constant(value=3.0), Ramp(rate=2.0), Pulse(value=1.0, start_s=0.0, duration_s=1.0)])
def test_what_does_not_swing_changes_at_no_frequency(function) -> None:
    assert fastest_change(function) == 0.0


def test_profiles_change_at_the_frequency_of_a_sine_like_them() -> None:
    times = np.linspace(0.0, 6.0, 200)
    table = Table(times_s=tuple(times), values=tuple(4.0 + 0.1 * np.sin(5.0 * times)))
    assert fastest_change(table) == pytest.approx(5.0, rel=1e-3)
    assert fastest_change(Table(times_s=tuple(times), values=(1.0,) * 200)) == 0.0
    assert fastest_change(Sine(amplitude=9.0, angular_frequency_rad_s=-3.0)) == 3.0
    step = SmoothStep(start_value=0.0, end_value=1.0, start_s=5.0, duration_s=2.0)
    assert (fastest_change(step), fastest_change(step, 4.0)) == (np.pi, 0.0)
    assert fastest_change(SpinUp(rate=1.0, duration_s=2.0)) == np.pi


def test_the_highest_mode_of_points() -> None:
    translation, rotation = np.zeros((2, 3, 2)), np.zeros((2, 3, 2))
    translation[0, 1, 0], rotation[1, 2, 1] = 2.0, 1.0  # modal masses 3 * 4 and 0.5
    inertia = np.array([np.eye(3), 0.5 * np.eye(3)])
    assert fastest_mode(np.array([3.0, 1.0]), translation, inertia, rotation, np.diag([12.0, 8.0])) == pytest.approx(4.0)
