"""Linear models of closed loops, and what small motions make of them."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest
from scipy.linalg import expm

import flexmb as fm
from tests.flexmb.control.scenes import INERTIA, pendulum, rotor, tossed

SMALL = 1e-4  # rad: about an equilibrium that is symmetric, what is not linear is 1e-8 of it
HANGING = np.pi / 2
ONE = fm.ProfileSensor(name="one", function=fm.Constant(value=1.0))


def test_the_closed_loop_has_the_poles_of_its_equations() -> None:
    """PID: J s^2 = -(kp + ki / s + kd s / (1 + tau s))."""
    kp, ki, kd, tau = 4.0, 2.0, 1.0, 0.1
    law = fm.Pid(name="law", inputs=("angle",), kp=kp, ki=ki, kd=kd, filter_s=tau)
    model = fm.linearize(rotor(law))
    poles = np.roots([INERTIA * tau, INERTIA, kp * tau + kd, kp + ki * tau, ki])
    assert np.sort_complex(model.eigenvalues) == pytest.approx(np.sort_complex(poles), rel=1e-9)
    assert [name for name, _ in model.states[2:]] == ["law.state[0]", "law.state[1]"]
    assert model.C.shape == (len(model.outputs), 4)


def test_a_small_motion_follows_the_closed_loop() -> None:
    """Of a double pendulum about where it hangs, with a lag in its loop."""
    law = fm.StateSpace(
        name="law", inputs=("angle", "rate", "one[0]"), A=((-2.0,),), B=((1.0, 0.5, -HANGING),), C=((-3.0,),)
    )
    system = fm.compile(pendulum(ONE, law, torque=fm.ControlSignal(source="law")).scene())
    model = fm.linearize(system, system.state(np.array([HANGING, 0.0]), np.zeros(2)))
    assert model.rates == pytest.approx([0.0, 0.0], abs=1e-12)
    start = np.array([SMALL, -SMALL, 0.0, 0.0, 0.0])
    run = fm.simulate(_started(system.scene, [HANGING + SMALL, -SMALL]), 2.0, samples=21, rtol=1e-12)
    expected = np.array([(expm(model.A * t) @ start)[:2] for t in run.t])
    assert np.abs(run.q - [HANGING, 0.0] - expected).max() < 1e-6 * SMALL


def test_a_force_in_turning_axes_turns_with_its_body() -> None:
    """Thrust along a body axis, held by a controller: attitude changes what it does, as in the model of a thruster."""
    steady = fm.UserLaw(
        name="law", inputs=("gyro[0]",), function="tests.flexmb.control.laws:proportional", parameters=(-2.0,)
    )
    parts = fm.MarkerSensor(name="gyro", marker="tip", quantity="angular_velocity"), steady
    builder = tossed(*parts)
    builder.force("thrust", "hub", direction=(0, 0, 1), frame="node", function=fm.ControlSignal(source="law"))
    system = fm.compile(builder.scene())
    model = fm.linearize(system)
    fixed = tossed().force("thrust", "hub", direction=(0, 0, 1), frame="node", function=fm.Constant(value=2.0 * 0.4))
    by_itself = fm.linearize(fixed.scene())
    gyro = model.A - by_itself.A
    assert np.abs(gyro).max() > 0.1
    assert np.abs(gyro[:9]).max() < 1e-9  # all but the velocity along z, which the thrust drives
    # World x of the angular velocity [0.4, -1, 2] in body axes that coincide with World's
    assert gyro[11, 6:9] == pytest.approx([2.0 / 2.0, 0.0, 0.0], abs=1e-9)
    assert gyro[11, :3] == pytest.approx([0.0, 2.0, 1.0], abs=1e-9)  # (theta x w)_x


def test_a_sampled_loop_is_closed_on_the_model_of_the_open_one() -> None:
    """Small motions of a double pendulum, by the discrete system that its linear model gives: 1e-6 of their size."""
    period, delay, gains = 0.1, 0.05, np.array([4.0, 1.0])
    law = fm.StateSpace(
        name="law", inputs=("angle", "rate", "one[0]"), D=((-gains[0], -gains[1], gains[0] * HANGING),),
        period_s=period, delay_s=delay,
    )  # fmt: skip
    scene = pendulum(ONE, law, torque=fm.ControlSignal(source="law")).scene()
    plant = fm.compile(fm.open_loop(scene))
    model = fm.linearize(plant, plant.state(np.array([HANGING, 0.0]), np.zeros(2)))
    b = model.B[:, [name for name, _ in model.inputs].index("pivot.rotation")]

    def flow(length: float, torque: float, x: Any) -> Any:
        whole = np.zeros((5, 5))
        whole[:4, :4], whole[:4, 4] = model.A, b
        return (expm(whole * length) @ [*x, torque])[:4]

    x, torque = np.array([SMALL, -SMALL, 0.0, 0.0]), 0.0
    expected = [x]
    for _ in range(20):
        new = -float(gains @ [x[0], x[2]])
        x = flow(period - delay, new, flow(delay, torque, x))
        torque = new
        expected.append(x)
    started = _started(scene, [HANGING + SMALL, -SMALL])
    run = fm.simulate(started, 2.0, samples=np.linspace(0.0, 2.0, 21), rtol=1e-12)
    assert np.abs(run.q - [HANGING, 0.0] - np.array(expected)[:, :2]).max() < 1e-6 * SMALL


def _started(scene: fm.Scene, q: Any) -> fm.Scene:
    """The same scene with other angles at the start."""
    hinges = tuple(
        msgspec.structs.replace(hinge, rotation=msgspec.structs.replace(hinge.rotation, angle_rad=float(angle)))
        for hinge, angle in zip(scene.hinges, q, strict=True)
    )
    return msgspec.structs.replace(scene, hinges=hinges)


@pytest.mark.parametrize(("ask", "reason"), [
    (fm.linearize, "is sampled"), (fm.equilibrium, "is sampled"), (lambda s: fm.advise(s, 1e-3), "has controllers"),
    (lambda s: fm.steady_spin(s, "pivot", 1.0), "spin.*does not support.*linearize"),
    (lambda s: fm.campbell(s, "pivot", [0.0, 1.0]), "Campbell.*does not support.*linearize"),
], ids=["linearize", "equilibrium", "advise", "steady_spin", "campbell"])  # fmt: skip
def test_what_knows_of_no_controllers_says_so(ask: Any, reason: str) -> None:
    scene = rotor(fm.StateSpace(name="law", inputs=("angle",), D=((-1.0,),), period_s=0.1))
    with pytest.raises(NotImplementedError, match=reason) as error:
        ask(scene)
    assert "flexmb.open_loop(scene)" in str(error.value)


def test_an_open_loop_is_the_scene_without_its_controllers() -> None:
    law = fm.StateSpace(name="law", inputs=("angle",), D=((-1.0,),))
    opened = fm.open_loop(rotor(law, stiffness=2.0))
    assert not opened.controllers and not opened.sensors
    assert fm.linearize(opened).eigenvalues.imag.max() == pytest.approx(np.sqrt(2.0 / INERTIA))
    assert fm.linearize(rotor(law, stiffness=2.0)).eigenvalues.imag.max() == pytest.approx(np.sqrt(3.0 / INERTIA))


def test_a_loop_rests_where_its_law_balances_the_weight() -> None:
    """A proportional law sags by the weight it carries; an integral leaves nothing of it; run there, nothing moves."""
    proportional = fm.StateSpace(name="law", inputs=("angle", "rate"), D=((-40.0, -4.0),))
    system = fm.compile(pendulum(proportional, torque=fm.ControlSignal(source="law")).scene())
    state = fm.equilibrium(system)
    weight = 9.81 * (1.0 * 0.5 + 0.5 * 1.0) * np.cos(state.q[0])  # the lower arm hangs: its weight is at the elbow
    assert state.q[0] + state.q[1] == pytest.approx(np.pi / 2, abs=1e-9)
    assert 40.0 * state.q[0] == pytest.approx(weight, rel=1e-9)
    assert state.q[0] > 0.1  # what it would be without weight is 0
    run = fm.simulate(system, 1.0, state=state)
    assert np.abs(run.q - state.q).max() < 1e-8
    whole = fm.Pid(name="law", inputs=("angle",), kp=40.0, ki=60.0, kd=4.0, filter_s=0.05, setpoint=0.2)
    held = fm.equilibrium(pendulum(whole, torque=fm.ControlSignal(source="law")).scene())
    assert held.q == pytest.approx([0.2, np.pi / 2 - 0.2], abs=1e-9)


def test_a_law_that_nothing_balances_rests_nowhere() -> None:
    """A steady torque on a free rotor; and an integral of an error that no displacement changes."""
    steady = fm.StateSpace(name="law", inputs=("one[0]",), D=((1.0,),))
    summing = fm.StateSpace(name="law", inputs=("one[0]",), A=((0.0,),), B=((1.0,),), C=((0.0,),))
    for law in (steady, summing):
        with pytest.raises(fm.EquilibriumError, match="are left that no displacement removes"):
            fm.equilibrium(rotor(ONE, law))


def test_a_batch_of_controlled_scenes_is_their_runs() -> None:
    """Each as `simulate` runs it, controllers of its own; other gains move otherwise."""
    scenes = [
        rotor(fm.StateSpace(name="law", inputs=("angle",), A=((-2.0,),), B=((1.0,),), C=((-k,),), period_s=period))
        for k, period in ((1.0, None), (2.0, None), (2.0, None))
    ]
    found = fm.simulate_batch(scenes, 1.0, samples=5)
    assert found.finished
    for i, scene in enumerate(scenes):
        run = fm.simulate(scene, 1.0, samples=5)
        assert np.array_equal(found.q[i], run.q) and np.array_equal(found.work[i], run.work)
    assert np.abs(found.q[1] - found.q[0]).max() > 1e-3
    sampled = rotor(fm.StateSpace(name="law", inputs=("angle",), D=((-1.0,),), period_s=0.1))
    angles = np.array([[0.1], [0.3]])
    several = fm.simulate_batch(fm.compile(sampled), 1.0, q=angles, samples=5)
    assert np.array_equal(several.q[1], fm.simulate(sampled, 1.0, samples=5).q)
    assert np.abs(several.q[0] - several.q[1] / 3.0).max() < 1e-9
