"""Runs of closed loops that begin elsewhere, or are taken up where they ended."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb as fm
from tests.flexmb.control.scenes import pendulum, rotor

STEPS = {"dop853": None, "rk4": 0.01, "radau5": None, "generalised_alpha": 0.01, "exponential": None}
END = 1.3
SAMPLED = fm.StateSpace(
    name="law", inputs=("angle", "rate"), A=((0.5,),), B=((1.0, 0.0),), C=((-2.0,),), D=((-3.0, -0.5),), period_s=0.1,
    delay_s=0.05,
)  # fmt: skip
CONTINUOUS = fm.StateSpace(name="law", inputs=("angle", "rate"), A=((-2.0,),), B=((1.0, 0.3),), C=((-3.0,),))


def double(law: Any) -> fm.Scene:
    """The double pendulum, driven."""
    return pendulum(law, torque=fm.ControlSignal(source="law")).scene()


@pytest.mark.parametrize(("method", "law"), [
    (method, law) for law in (SAMPLED, CONTINUOUS) for method in STEPS
], ids=lambda each: each if isinstance(each, str) else "sampled" if each.period_s else "continuous")  # fmt: skip
@pytest.mark.parametrize("cut", [0.57, 0.6])
def test_a_loop_that_is_taken_up_is_one_that_had_never_ended(method: Any, law: Any, cut: float) -> None:
    """To the last bit, with what waits to be put out; at 0.6 s a controller is about to act."""
    times = np.array([0.0, 0.2, cut, 0.9, END])
    if cut == 0.6:
        times[2] = 6 * 0.1  # as instants are counted
    system, step = fm.compile(double(law)), STEPS[method]
    whole = fm.simulate(system, END, method, samples=times, step=step)
    first = fm.simulate(system, float(times[2]), method, samples=times[:3], step=step)
    second = fm.simulate(system, END, method, samples=times[2:], step=step, state=first.restart)
    assert np.array_equal(first.q[:2], whole.q[:2])  # its last step was cut, and reached the end in another way
    assert np.array_equal(second.q, whole.q[2:])
    assert np.array_equal(second.work, whole.work[2:])
    assert np.array_equal(second.signals["law"], whole.signals["law"][2:])
    joined = first.then(second)
    assert np.array_equal(joined.signals["law"], whole.signals["law"])
    assert np.array_equal(joined.power["law"], whole.power["law"])


@pytest.mark.parametrize("cut", [0.56, 0.58])
def test_two_sampled_controllers_are_taken_up_as_one_is(cut: float) -> None:
    """What one of them has put out waits where it is looked for, however long the run is that goes on."""
    aid = fm.StateSpace(name="aid", inputs=("rate",), D=((0.5,),), period_s=0.07, delay_s=0.06)
    scene = pendulum(aid, replace(SAMPLED, inputs=("angle", "aid")), torque=fm.ControlSignal(source="law")).scene()
    times = np.array([0.0, cut, 0.9, END])
    system = fm.compile(scene)
    whole = fm.simulate(system, END, samples=times)
    first = fm.simulate(system, cut, samples=times[:2])
    second = fm.simulate(system, END, samples=times[1:], state=first.restart)
    for name in ("aid", "law"):
        assert np.array_equal(first.then(second).signals[name], whole.signals[name])
    assert second.q == pytest.approx(whole.q[1:], abs=1e-9)


def test_a_loop_is_taken_up_from_a_file(tmp_path: Path) -> None:
    first = fm.simulate(double(SAMPLED), 0.57)
    assert first.restart is not None
    first.restart.save(tmp_path / "restart.npz")
    read = fm.Restart.load(tmp_path / "restart.npz")
    one, other = (fm.simulate(double(SAMPLED), END, state=each) for each in (first.restart, read))
    assert np.array_equal(one.q, other.q)


def test_without_what_it_knows_a_loop_goes_on_otherwise() -> None:
    """From the last state alone controllers begin anew: the negative control of the tests above."""
    first = fm.simulate(double(SAMPLED), 0.57)
    taken_up = fm.simulate(double(SAMPLED), END, state=first.restart)
    anew = fm.simulate(double(SAMPLED), END, state=first.last_state)
    assert abs(taken_up.q[-1] - anew.q[-1]).max() > 1e-3


def test_a_late_start_finds_the_next_instant() -> None:
    run = fm.simulate(rotor(SAMPLED), 1.0, t_start=0.33, samples=np.array([0.33, 0.38, 0.42, 0.44, 0.46, 1.0]))
    assert run.signals["law"][:4].tolist() == [[0.0]] * 4  # acts at 0.4 s, is heard of at 0.45 s
    assert run.signals["law"][4, 0] == pytest.approx(-0.9, abs=1e-12)
