"""The satellite that unfolds its panels and turns by its wheels: balances across latches, and its linear model."""

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import flexmb as fm
from flexmb.run.impulses import struck
from flexmb.typing import Real

SCENE = fm.load_scene(Path(__file__).parents[2] / "cases" / "spacecraft" / "deploy_and_slew" / "scene.toml")
(LAW,) = SCENE.controllers
assert isinstance(LAW, fm.UserLaw)
AXIS, STIFFNESS, DAMPING = np.reshape(LAW.parameters, (3, 3))
PERIOD, DELAY = 0.1, LAW.delay_s
WHEELS = [wheel.name for wheel in SCENE.wheels]
XYZ = "xyz"


@pytest.fixture(scope="module")
def run() -> fm.Trajectory:
    return fm.simulate(SCENE, 100.0)


def test_the_panels_latch_one_after_the_other_and_the_slew_ends_at_its_aim(run: fm.Trajectory) -> None:
    assert run.finished
    assert LAW.period_s == PERIOD
    assert [event.name for event in run.events] == ["left latches", "right latches"]
    left, right = (event.t for event in run.events)
    assert 5.0 < left < right - 1.0 < 25.0
    held = {"left_hinge.rotation": left, "right_hinge.rotation": right}
    for coordinate, t in held.items():
        angle = run.q[:, [name for name, _ in run.q_names].index(coordinate)]
        assert np.all(angle[run.t > t] == 0.0) and np.all(angle[run.t < t] < 0.0)
    aim = np.array([np.cos(0.4), *np.sin(0.4) * AXIS])
    missed = 2.0 * np.arccos(np.minimum(1.0, np.abs(run.markers["tracker"].quaternion[-20:] @ aim)))
    assert missed.max() < 1e-3  # of 0.8 rad; slosh and panels ring out


def test_energy_and_momentum_balance_between_latches_and_across_them(run: fm.Trajectory) -> None:
    largest = max(np.abs(kind).max() for kind in run.energy.values())
    assert np.abs(run.energy_drift).max() < 1e-9 * largest
    assert run.energy["spring"].max() > 1e-3 * largest  # what drives the panels counts in it
    for part in (slice(0, 3), slice(3, 6)):
        assert np.abs(run.momentum_drift[:, part]).max() < 1e-10 * np.linalg.norm(run.momentum[0, part])
    system = fm.compile(SCENE)
    for event in run.events:
        before, after = (system.energy(state) for state in (event.before, event.after))
        assert sum(after.values()) - sum(before.values()) == pytest.approx(event.energy_change, abs=1e-12 * largest)
        assert event.energy_change < 0.0
        p, p_after = system.momentum(event.before), system.momentum(event.after)
        assert np.abs(p_after - p).max() < 1e-12 * np.abs(p).max()
        assert np.abs(p - run.momentum[0]).max() < 1e-10 * np.abs(p).max()


def test_the_second_latch_passes_through_the_hinge_that_is_held(run: fm.Trajectory) -> None:
    """M (u+ - u-) is zero but for both hinges, by the mass matrix of the unlatched scene."""
    system = fm.compile(SCENE)
    names = [name for name, _ in run.u_names]
    places = {name.removesuffix(".rate"): i for i, name in enumerate(names) if "_hinge" in name}
    event = run.events[1]
    again = struck(system, event.before, dict.fromkeys(places.values(), 0.0))
    assert {name: again.impulses[i] for name, i in places.items()} == pytest.approx(event.impulses, rel=1e-9)
    assert event.after.u == pytest.approx(again.u, abs=1e-12)


def predicted(latched: fm.Scene, start: Real, slew: fm.SmoothStep, periods: int, delay: float) -> Real:
    """Rotation vector of the hub (periods+1, 3) in the discrete system that the open loop's linear model gives."""
    plant = fm.compile(fm.open_loop(latched))
    rest = np.zeros(plant.nu)
    rest[plant.speed("wheel_y")] = plant.initial_state.u[plant.speed("wheel_y")]  # the momentum of a steady spin
    model = fm.linearize(plant, plant.state(plant.initial_state.q, rest))
    names, inputs = [name for name, _ in model.states], [name for name, _ in model.inputs]
    n, motors = len(names), [inputs.index(f"{wheel}.angle") for wheel in WHEELS]
    whole = np.block([[model.A, -model.B[:, motors]], [np.zeros((3, n + 3))]])  # the motors' torque on the hub
    late, rest_of_period = expm(delay * whole), expm((PERIOD - delay) * whole)
    turned = [names.index(f"orbit.rotation.{axis}") for axis in XYZ]
    turning = [names.index(f"orbit.angular_velocity.{axis}") for axis in XYZ]
    x, held, found = np.zeros(n), np.zeros(3), [start]
    x[turned] = start
    for k in range(periods):
        angle, rate = aimed(slew, k * PERIOD)
        new = -STIFFNESS * (x[turned] - angle * AXIS) - DAMPING * (x[turning] - rate * AXIS)
        x = (late @ [*x, *held])[:n]
        x = (rest_of_period @ [*x, *new])[:n]
        held = new
        found.append(x[turned])
    return np.array(found)


def aimed(slew: fm.SmoothStep, t: float) -> tuple[float, float]:
    """Angle and rate of the profile, its polynomial of degree seven."""
    x = np.clip((t - slew.start_s) / slew.duration_s, 0.0, 1.0)
    rate = 140.0 * (x * (1.0 - x)) ** 3 / slew.duration_s
    return slew.end_value * x**4 * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x))), slew.end_value * rate


def test_the_linear_model_predicts_the_sampled_loop(run: fm.Trajectory) -> None:
    """To 1e-6 of a motion so small that its squares are less: release from an offset, then a slew."""
    size, periods = 1e-7, 200
    start = size * np.array([0.5, -0.7, 0.4])
    slew = fm.SmoothStep(start_value=0.0, end_value=size, start_s=4.0, duration_s=6.0)
    assert run.restart is not None
    latched = run.restart.scene.with_values({"slew.function": slew})
    rest = {"orbit": np.array([0.0, 0.0, 0.0, 1.0, *0.5 * start]), "orbit.speeds": np.zeros(6)}
    small = fm.simulate(latched, periods * PERIOD, samples=periods + 1, rtol=1e-12, atol=1e-17, state=rest)
    turned = 2.0 * small.markers["tracker"].quaternion[:, 1:]  # of a small rotation
    response = np.abs(turned).max()
    assert np.abs(turned - predicted(latched, start, slew, periods, DELAY)).max() < 1e-6 * response
    assert np.ptp(turned, axis=0).min() > 0.3 * size
    # without the delay the model would be another
    assert np.abs(turned - predicted(latched, start, slew, periods, 0.0)).max() > 1e-3 * response
