"""Sampled controllers against the exact solution of a linear system between samples."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import flexmb as fm
from flexmb.control.schedule import MOST, instants
from flexmb.control.tables import APPLY, SAMPLE
from tests.flexmb.control.scenes import INERTIA, pendulum, rotor, tossed

STEPS = {"dop853": None, "rk4": 1e-3, "radau5": None, "exponential": None, "generalised_alpha": 1e-3}
STIFFNESS = 5.0
A = np.array([[0.0, 1.0], [-STIFFNESS / INERTIA, 0.0]])
GAINS = np.array([3.0, 1.2])


def flow(length: float, torque: float, x: Any) -> Any:
    """x = [angle, rate] after a time, under a torque that is held."""
    whole = np.zeros((3, 3))
    whole[:2, :2], whole[1, 2] = A, 1.0 / INERTIA
    return (expm(whole * length) @ [*x, torque])[:2]


def exact(period: float, delay: float, t_end: float, offset: float = 0.0) -> tuple[Any, list[tuple[float, float]]]:
    """[angle, rate] at the end, and the torques with the times at which they begin."""
    x, t, waiting, torque, log = np.array([0.3, 0.0]), 0.0, list[tuple[float, float]](), 0.0, []
    k = 0
    while True:
        next_sample = offset + k * period
        due = min([time for time, _ in waiting] + [next_sample, t_end])
        x, t = flow(due - t, torque, x), due
        if t >= t_end - 1e-12:
            return x, log
        for time, value in list(waiting):
            if time <= t + 1e-12:
                waiting.remove((time, value))
                torque = value
                log.append((t, torque))
        if next_sample <= t + 1e-12:
            value, k = -float(GAINS @ x), k + 1
            if delay:
                waiting.append((t + delay, value))
            else:
                torque = value
                log.append((t, torque))


def law(period: float, delay: float = 0.0, offset: float = 0.0) -> fm.StateSpace:
    """The gains, sampled."""
    return fm.StateSpace(
        name="law", inputs=("angle", "rate"), D=(tuple(-GAINS),), period_s=period, delay_s=delay, offset_s=offset
    )


@pytest.mark.parametrize(("period", "delay", "offset"), [
    (0.1, 0.0, 0.0), (0.1, 0.05, 0.0), (0.1, 0.1, 0.0), (0.1, 0.25, 0.0), (0.07, 0.02, 0.013)
])  # fmt: skip
def test_a_sampled_torque_is_held_and_late(period: float, delay: float, offset: float) -> None:
    run = fm.simulate(rotor(law(period, delay, offset), stiffness=STIFFNESS), 2.0)
    x, _ = exact(period, delay, 2.0, offset)
    assert run.q[-1, 0] == pytest.approx(x[0], abs=1e-9)  # rtol 1e-10 over some fifty steps
    assert run.u[-1, 0] == pytest.approx(x[1], abs=1e-9)
    assert np.abs(run.energy_drift).max() < 1e-10


@pytest.mark.parametrize("wrong", [(0.1, 0.0501, 0.0), (0.1001, 0.05, 0.0), (0.1, 0.05, 0.001)])
def test_another_instant_is_seen(wrong: tuple[float, float, float]) -> None:
    run = fm.simulate(rotor(law(*wrong), stiffness=STIFFNESS), 2.0)
    assert abs(run.q[-1, 0] - exact(0.1, 0.05, 2.0)[0][0]) > 1e-6


@pytest.mark.parametrize("method", STEPS)
def test_every_method_stops_at_the_instants(method: Any) -> None:
    """To its own accuracy: the torque's jumps cost none of it."""
    scene = rotor(law(0.1, 0.05), stiffness=STIFFNESS)
    run = fm.simulate(scene, 2.0, method, step=STEPS[method], samples=3)
    x, _ = exact(0.1, 0.05, 2.0)
    within = 2e-6 if method == "generalised_alpha" else 1e-8  # order 2: (1e-3)^2
    assert abs(run.q[-1, 0] - x[0]) < within


def test_outputs_see_what_is_held_from_an_instant_on() -> None:
    """Output times are those of the instants, k 0.1 s as they round: not one of them sees the torque before it."""
    run = fm.simulate(rotor(law(0.1), stiffness=STIFFNESS), 2.0, samples=np.linspace(0.0, 2.0, 21))
    _, log = exact(0.1, 0.0, 2.0)
    held = [torque for _, torque in log]
    assert run.signals["law"][:-1, 0] == pytest.approx(held, abs=1e-8)
    assert run.signals["law"][-1, 0] == -float(GAINS @ [run.q[-1, 0], run.u[-1, 0]])  # at the very end, too
    assert run.loads["pivot"][:-1, 2] == pytest.approx(-STIFFNESS * run.q[:-1, 0] + held, abs=1e-8)


def test_a_recursive_controller_keeps_its_state_between_samples() -> None:
    """Counting samples; and x+ = 0.5 x + angle, y = x."""
    parts = (
        fm.UserLaw(
            name="count", inputs=(), function="tests.flexmb.control.laws:counting", initial=(0.0,), period_s=0.25
        ),
        fm.StateSpace(name="smooth", inputs=("angle",), A=((0.5,),), B=((1.0,),), C=((1.0,),), period_s=0.25),
    )
    run = fm.simulate(rotor(*parts, stiffness=STIFFNESS), 2.0, samples=np.linspace(0.0, 2.0, 9))
    assert run.signals["count"][:, 0].tolist() == [0, 1, 2, 3, 4, 5, 6, 7, 8]
    x, expected = 0.0, []
    for angle in run.q[:-1, 0]:
        expected.append(x)
        x = 0.5 * x + angle
    assert run.signals["smooth"][:-1, 0] == pytest.approx(expected, abs=1e-14)


def test_rates_of_several_controllers_mix() -> None:
    """A fast inner one reads what a slow outer one holds, and of one instant what was just put out."""
    parts = (
        fm.StateSpace(name="outer", inputs=("angle",), D=((-2.0,),), period_s=0.3),
        fm.StateSpace(name="law", inputs=("outer", "rate"), D=((1.0, -0.5),), period_s=0.1),
    )
    run = fm.simulate(rotor(*parts), 1.8, samples=np.linspace(0.0, 1.8, 19))
    outer, angle = run.signals["outer"][:-1, 0], run.q[:-1, 0]
    assert outer == pytest.approx(np.repeat(-2.0 * angle[::3], 3), abs=1e-14)
    assert run.signals["law"][:-1, 0] == pytest.approx(outer - 0.5 * run.u[:-1, 0], abs=1e-14)


def test_sampled_loads_and_accelerations() -> None:
    """They are those just before the controller's own torque changes."""
    parts = (
        fm.LoadSensor(name="load", hinge="pivot"),
        fm.MarkerSensor(name="felt", marker="rim", quantity="acceleration"),
        fm.StateSpace(name="seen", inputs=("load[2]", "felt[0]", "felt[1]"), D=np.eye(3).tolist(), period_s=0.1),
        law(0.1),
    )
    run = fm.simulate(rotor(*parts, stiffness=STIFFNESS), 1.0, samples=np.linspace(0.0, 1.0, 11))
    before = np.array([0.0, *run.signals["law"][:-2, 0]])
    assert run.signals["seen"][:-1, 0] == pytest.approx(-STIFFNESS * run.q[:-1, 0] + before, abs=1e-10)
    across = (before - STIFFNESS * run.q[:-1, 0]) / INERTIA
    angle, rate = run.q[:-1, 0], run.u[:-1, 0]
    expected = np.column_stack([
        -rate**2 * np.cos(angle) - across * np.sin(angle), -(rate**2) * np.sin(angle) + across * np.cos(angle)
    ])  # fmt: skip
    assert run.signals["seen"][:-1, 1:] == pytest.approx(expected, abs=1e-10)
    assert run.signals["load"] == pytest.approx(run.loads["pivot"], abs=1e-12)


def test_a_wheel_turns_its_body_and_keeps_the_momentum() -> None:
    """Three wheels on a free body, sampled with a delay: no momentum but what was there."""
    parts = (
        fm.MarkerSensor(name="gyro", marker="tip", quantity="angular_velocity", frame="marker"),
        fm.StateSpace(name="law", inputs=("gyro",), D=(0.3 * np.eye(3)).tolist(), period_s=0.1, delay_s=0.05),
    )
    builder = tossed(*parts)
    for i, axis in enumerate(np.eye(3)):
        builder.wheel(
            f"wheel {i}", "hub", axis=axis, mass=0.1, axial_inertia=0.05, transverse_inertia=0.03,
            torque=fm.ControlSignal(source=f"law[{i}]"),
        )  # fmt: skip
    run = fm.simulate(builder.scene(), 5.0)
    centre = run.momentum_drift[:, 3:] + np.outer(run.t, [0.0, 0.0, 9.81 * 2.3])
    assert np.abs(centre).max() < 1e-8
    assert np.linalg.norm(run.signals["gyro"][-1]) < 0.5 * np.linalg.norm(run.signals["gyro"][0])
    assert np.abs(run.energy_drift).max() < 1e-9 * run.energy_scale
    assert [name for name, _ in run.u_names[6:]] == ["wheel 0.speed", "wheel 1.speed", "wheel 2.speed"]
    assert run.power["law"] == pytest.approx(run.signals["law"] * run.u[:, 6:], rel=1e-15)


def test_instants_that_differ_by_rounding_are_one() -> None:
    """0.1 * 3 is not 0.3."""
    controllers = law(0.1), law(0.3)
    table = instants(controllers, 0.0, 0.9, (0.6,))
    assert len(set(table["time"].tolist())) == 10
    assert {0.6, 0.9} <= set(table["time"].tolist())
    assert sorted(table["row"].tolist()) == list(range(len(table)))


def test_what_waits_is_put_out_before_who_acts_at_the_same_instant() -> None:
    table = instants((law(0.1, 0.1),), 0.0, 0.35, ())
    assert table["kind"].tolist() == [SAMPLE, APPLY, SAMPLE, APPLY, SAMPLE, APPLY, SAMPLE]


@pytest.mark.parametrize("t_end", [0.9, 1.0, 1.05])
def test_samples_are_numbered_as_they_come_however_long_the_run_is(t_end: float) -> None:
    """Rows of those before the end follow each other from 0: there is room for so many. A longer run has the same."""
    controllers = law(0.1, 0.03), law(0.25, 0.1), law(0.2)
    table, longer = (instants(controllers, 0.0, end, ()) for end in (t_end, 2.0))
    due = table[table["time"] < t_end]
    sampled = due["kind"] == SAMPLE
    assert due["row"][sampled].tolist() == list(range(sampled.sum()))
    assert set(due["row"][~sampled]) <= set(due["row"][sampled])
    assert longer[: len(due)]["row"].tolist() == due["row"].tolist()


def test_more_instants_than_memory_are_refused() -> None:
    with pytest.raises(ValueError, match=rf"act .* times in 100 s, and {MOST} are allowed"):
        fm.simulate(rotor(law(1e-6)), 100.0)


def test_a_long_run_costs_little_beyond_its_steps() -> None:
    """A hundred seconds at 10 Hz with 50 ms: two segments a period, each with one evaluation that a step has not."""
    builder = pendulum(law(0.1, 0.05), torque=fm.ControlSignal(source="law"))
    run = fm.simulate(builder.scene(), 20.0, samples=3)
    steps = run.statistics.accepted_steps + run.statistics.rejected_steps
    assert run.statistics.evaluations <= 11 * run.statistics.rejected_steps + 12 * steps + 3 * 8 + 400 + 2
