"""Derivatives under continuous controllers: against the linear model, springs that do the same, and differences."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.control.feedback import Feedback
from flexmb.control.loop_run import FreshStart
from flexmb.entry.tangent import tangent_workspace
from flexmb.system import algorithms
from tests.flexmb.closure import mechanisms
from tests.flexmb.control.scenes import pendulum, rotor, tossed
from tests.flexmb.control.test_closed_chains import controlled
from tests.flexmb.entry.dual_jacobian import jacobian

EXACT = 1e-11  # of the largest element: rounding of the drives' effect, and of laws of users
DIFFERENCE = 1e-8  # of extrapolated central differences over H: H**4, and rounding over H
H = 2.0**-9
STIFFNESS, DAMPING = 30.0, 0.7
DRIVE = fm.ControlSignal(source="law")
LAG = fm.StateSpace(name="law", inputs=("angle", "rate"), A=((-2.0,),), B=((1.0, 0.5),), C=((-3.0,),), initial=(0.2,))
PID = fm.Pid(name="law", inputs=("angle",), kp=4.0, ki=2.0, kd=1.0, filter_s=0.1, lower=-50.0, upper=50.0)
SPRING = fm.StateSpace(name="law", inputs=("angle", "rate"), D=((-STIFFNESS, -DAMPING),))
TIMED = fm.ProfileSensor(name="wish", function=fm.Sine(amplitude=0.3, angular_frequency_rad_s=4.0))
FOLLOWING = fm.Pid(name="law", inputs=("angle", "wish[0]"), kp=4.0, kd=1.0, filter_s=0.1)
SWINGING = fm.UserLaw(
    name="law", inputs=("angle",), function="tests.flexmb.control.laws:swinging", parameters=(6.0,), initial=(0.1,)
)
FEELING = fm.MarkerSensor(name="feel", marker="end", quantity="specific_force", frame="marker")
FILTERED = fm.StateSpace(
    name="law", inputs=("feel[0]", "feel[2]"), A=((-9.0,),), B=((1.0, 0.4),), C=((0.8,),), initial=(0.5,)
)
CLOCK = fm.TimeSensor(name="clock")
HURRYING = fm.StateSpace(name="law", inputs=("clock", "angle"), D=((2.0, -3.0),))


def hanging(*parts: Any) -> fm.Scene:
    return pendulum(*parts, torque=DRIVE).scene()


def started(scene: fm.Scene) -> fm.State:
    """With speeds, and not at time zero."""
    system = fm.compile(scene)
    return replace(system.state(system.initial_state.q, np.linspace(0.7, -0.4, system.nu)), t=0.3)


def close(found: Any, expected: Any, bound: float) -> bool:
    size = np.max(np.abs(expected), initial=1e-3)
    return bool(np.all(np.isfinite(found)) and np.max(np.abs(found - expected), initial=0.0) <= bound * size)


@pytest.mark.parametrize("law", [LAG, PID, SWINGING], ids=["lag", "pid", "user"])
def test_the_linear_model_has_the_same_rows(law):
    system = fm.compile(hanging(law))
    state = system.initial_state
    found = fm.ControlledMotion(system).acceleration_derivatives(state)
    model, n = fm.linearize(system, state), system.nu
    for of, rows in ((found.of_accelerations, model.A[n : 2 * n]), (found.of_rates, model.A[2 * n :])):
        assert close(np.hstack([of.by_displacement, of.by_speed, of.by_states]), rows, EXACT)
    assert close(found.accelerations, model.rates, EXACT)


def test_a_thrust_in_turning_axes():
    """Of a body on a quaternion, against its linear model, whose displacements are the same."""
    law = fm.StateSpace(name="law", inputs=("gyro[0]", "gyro[1]"), D=((2.0, -1.0),))
    gyro = fm.MarkerSensor(name="gyro", marker="tip", quantity="angular_velocity")
    scene = tossed(gyro, law).force("thrust", "hub", direction=(0, 0, 1), frame="node", function=DRIVE).scene()
    of = fm.ControlledMotion(scene).acceleration_derivatives(fm.compile(scene).initial_state).of_accelerations
    model = fm.linearize(scene)
    assert close(np.hstack([of.by_displacement, of.by_speed]), model.A[6:], EXACT)


@pytest.mark.parametrize("closed", [False, True], ids=["tree", "chain"])
def test_a_spring_and_damper_do_the_same(closed):
    """Everything observable, in a tree against dual numbers of the equivalent scene too; not so the spring's energy."""
    law, spring = SPRING, {"stiffness_Nm_rad": STIFFNESS, "damping_Nms_rad": DAMPING}
    if closed:
        bars = mechanisms.four_bar()
        driven = bars.hinges[0].name
        scene = controlled(bars, driven, law)
    else:
        scene, driven = hanging(law), "pivot"
    hinges = tuple(
        msgspec.structs.replace(hinge, rotation=msgspec.structs.replace(hinge.rotation, torque_Nm=None, **spring))
        if hinge.name == driven else hinge
        for hinge in scene.hinges
    )  # fmt: skip
    other = fm.compile(msgspec.structs.replace(fm.open_loop(scene), hinges=hinges))
    state = other.initial_state if closed else started(fm.open_loop(scene))
    if closed:
        state = other.admissible(state)
    own = fm.compile(scene)
    here = replace(own.state(state.q, state.u), t=state.t)
    found, expected = fm.ControlledMotion(own).evaluation_derivatives(here), other.evaluation_derivatives(state)
    for name in ("by_displacement", "by_speed", "by_force", "by_time"):
        pairs = [(found.accelerations, expected.accelerations), (found.momentum, expected.momentum)]
        pairs += [(found.loads[load], expected.loads[load]) for load in expected.loads if load != driven]
        pairs += [
            (found.markers[marker].acceleration, expected.markers[marker].acceleration) for marker in expected.markers
        ]
        for one, two in pairs:
            mine, its = getattr(one, name), getattr(two, name)
            known = np.isfinite(its)  # redundant closures leave loads open
            assert np.array_equal(np.isfinite(mine), known)
            assert close(mine[known], its[known], 1e-10 if closed else EXACT), name
    if not closed:
        J = np.empty((other.nq + other.nu + 1,) * 2)
        y = np.concatenate([state.q, state.u, [0.0]])
        jacobian(state.t, y, J, other.constants, tangent_workspace(other.constants, other.nq, other.nu))
        rows = J[other.nq : -1, :-1]
        of = found.accelerations
        assert close(np.hstack([of.by_displacement, of.by_speed]), rows, EXACT)
        of.by_displacement[0, 0] *= 1.0 + 1e-9
        assert not close(np.hstack([of.by_displacement, of.by_speed]), rows, EXACT)


@pytest.mark.parametrize("parts", [
    (LAG,), (PID,), (SWINGING,), (TIMED, FOLLOWING), (FEELING, FILTERED), (CLOCK, HURRYING),
], ids=["lag", "pid", "user", "profile", "accelerometer", "clock"])  # fmt: skip
def test_central_differences(parts):
    """By displacement, speed, states of controllers and time, of accelerations and of the rates of these states."""
    scene = hanging(*parts)
    state, motion = started(scene), fm.ControlledMotion(scene)
    x, nu = motion.initial_states(state) + 0.3, 2
    found = motion.acceleration_derivatives(state, x)

    def at(step: np.ndarray) -> np.ndarray:
        moved = replace(state, q=state.q + step[:nu], u=state.u + step[nu : 2 * nu], t=state.t + step[-1])
        there = motion.acceleration_derivatives(moved, x + step[2 * nu : -1])
        return np.r_[there.accelerations, there.rates]

    for place in range(2 * nu + len(x) + 1):
        unit = np.eye(2 * nu + len(x) + 1)[place]
        coarse, fine = ((at(h * unit) - at(-h * unit)) / (2.0 * h) for h in (H, 0.5 * H))
        columns = [
            np.column_stack([of.by_displacement, of.by_speed, of.by_states, of.by_time])[:, place]
            for of in (found.of_accelerations, found.of_rates)
        ]
        assert close(np.concatenate(columns), fine + (fine - coarse) / 3.0, DIFFERENCE), place


def test_the_values_are_those_of_a_run():
    scene = hanging(TIMED, FOLLOWING)
    system, state = fm.compile(scene), started(scene)
    chosen, route = algorithms.chosen("articulated"), system.route()

    expected = Feedback(system, chosen, route, route.tables()).accelerations(FreshStart(state))
    found = fm.ControlledMotion(scene).acceleration_derivatives(state)
    assert found.accelerations == pytest.approx(expected, rel=1e-14)


def test_a_force_reaches_an_accelerometer_through_its_filter():
    """By force, the rate of the filter changes by the acceleration that the force gives."""
    scene = hanging(FEELING, FILTERED)
    motion, state = fm.ControlledMotion(scene), started(scene)
    of = motion.acceleration_derivatives(state)
    push = motion.evaluation_derivatives(state).markers["end"].acceleration.by_force[3:]
    R = fm.compile(scene).evaluate(state.t, state.q, state.u).markers["end"].rotation
    assert close(of.of_rates.by_force, np.array([[1.0, 0.0, 0.4]]) @ R.T @ push, EXACT)
    assert np.abs(of.of_rates.by_force).max() > 0.1


def test_between_samples_a_sampled_controller_holds_its_output():
    """As a constant torque of that size does."""
    law = msgspec.structs.replace(SPRING, period_s=0.1)
    motion, state = fm.ControlledMotion(hanging(law)), started(hanging(law))
    constant = fm.compile(pendulum(torque=fm.Constant(value=2.5)).scene())
    expected = constant.acceleration_derivatives(replace(constant.state(state.q, state.u), t=state.t))
    found = motion.acceleration_derivatives(state, held={"law": 2.5})
    assert found.accelerations == pytest.approx(expected.accelerations, rel=1e-13)
    assert close(found.of_accelerations.by_speed, expected.by_speed, EXACT)
    assert found.of_rates.by_speed.shape == (0, 2)
    assert motion.acceleration_derivatives(state).accelerations != pytest.approx(expected.accelerations, rel=1e-3)


def limited(angle: float) -> tuple[fm.Scene, fm.State]:
    scene = rotor(fm.Saturation(name="law", inputs=("angle",), lower=-1.0, upper=0.4))
    return scene, fm.compile(scene).state(np.array([angle]), np.zeros(1))


def test_a_law_near_a_limit_and_on_it():
    """A thousandth from it, which differences over a larger step would straddle; beyond it; on it there is none."""
    slopes = []
    for angle in (0.4 - 1e-5, 0.4 + 1e-5):
        scene, state = limited(angle)
        of = fm.ControlledMotion(scene).acceleration_derivatives(state).of_accelerations
        slopes.append(of.by_displacement[0, 0])
        assert fm.linearize(scene, state).A[1, 0] == pytest.approx(slopes[-1], abs=1e-12)
    assert slopes == pytest.approx([1.0 / 0.8, 0.0], abs=1e-12)
    scene, state = limited(0.4)
    for ask in (fm.ControlledMotion(scene).acceleration_derivatives, lambda state: fm.linearize(scene, state)):
        with pytest.raises(fm.NotDifferentiableError, match='controller "law".*exactly at a limit'):
            ask(state)


def test_a_pid_on_its_limit_and_a_table_on_a_point():
    bounded = rotor(fm.Pid(name="law", inputs=("angle",), kp=2.0, upper=0.5))
    state = fm.compile(bounded).state(np.array([-0.25]), np.zeros(1))
    table = rotor(fm.GainTable(name="law", inputs=("angle",), points=(0.0, 0.5, 1.0), values=(0.0, 1.0, 4.0)))
    on_point = fm.compile(table).state(np.array([0.5]), np.zeros(1))
    for scene, at in ((bounded, state), (table, on_point)):
        with pytest.raises(fm.NotDifferentiableError, match='controller "law"'):
            fm.ControlledMotion(scene).acceleration_derivatives(at)
    straight = rotor(fm.GainTable(name="law", inputs=("angle",), points=(0.0, 0.5, 1.0), values=(0.0, 1.0, 2.0)))
    at = fm.compile(straight).state(np.array([0.5]), np.zeros(1))
    of = fm.ControlledMotion(straight).acceleration_derivatives(at)
    assert of.of_accelerations.by_displacement[0, 0] == pytest.approx(2.0 / 0.8)


def test_a_corner_in_the_law_of_a_user():
    law = fm.UserLaw(name="law", inputs=("angle",), function="tests.flexmb.control.laws:kinked", parameters=(0.3,))
    scene = rotor(law)
    state = fm.compile(scene).state(np.array([0.3 + 1e-9]), np.zeros(1))
    with pytest.raises(fm.NotDifferentiableError, match='controller "law".*no smooth function'):
        fm.ControlledMotion(scene).acceleration_derivatives(state)


@pytest.mark.parametrize(("given", "error", "message"), [
    ({"states": [1.0, 2.0, 3.0]}, ValueError, "states.*2"),
    ({"states": [np.nan, 0.0]}, ValueError, r"states\[0\] is nan"),
    ({"held": {"law": 1.0}}, KeyError, "no sampled controller"),
    ({"held": "wish"}, TypeError, "held is 'wish'.*by name.*wish"),
    ({"held": []}, TypeError, "held is .*by name"),
    ({"held": {"wish": [1.0, 2.0]}}, ValueError, "held.*wish.*1"),
    ({"held": {"wish": np.inf}}, ValueError, "held.*wish.*inf"),
], ids=["count", "nan", "text", "list", "held", "width", "infinite"])  # fmt: skip
def test_bad_arguments(given, error, message):
    sampled = fm.StateSpace(name="wish", inputs=("angle",), D=((1.0,),), period_s=0.1)
    scene = hanging(sampled, msgspec.structs.replace(PID, inputs=("angle", "wish")))
    with pytest.raises(error, match=message):
        fm.ControlledMotion(scene).acceleration_derivatives(started(scene), **given)


def test_a_system_says_where_controllers_are_chained_through():
    system = fm.compile(hanging(PID))
    with pytest.raises(NotImplementedError, match=r"flexmb\.open_loop.*flexmb\.ControlledMotion"):
        system.acceleration_derivatives(system.initial_state)
    with pytest.raises(TypeError, match="a System or a Scene is needed"):
        fm.ControlledMotion("scene")
