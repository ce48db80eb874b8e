"""Continuous controllers with the methods that need Jacobians."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest

import flexmb as fm
from flexmb.control.feedback import Feedback
from flexmb.control.loop import rhs
from flexmb.control.tables import Loop, LoopTangent
from flexmb.control.tangent import jacobian
from flexmb.integrate.problem import Accuracy, Clock
from flexmb.run.origin import origin
from flexmb.scene.schema import Modes
from flexmb.scene.shapes import beam_section
from flexmb.system import algorithms
from flexmb.tables.status import OK
from tests.bounds import observed_order
from tests.flexmb.control.scenes import DAMPING, STIFFNESS, pendulum, rotor, tossed

pytestmark = pytest.mark.filterwarnings("ignore:.*leaves out that this pulls it straight")  # fast turns are meant

ADAPTIVE = ("radau5", "exponential")
TORQUE = fm.ControlSignal(source="law")
PID = fm.Pid(name="law", inputs=("angle",), kp=4.0, ki=3.0, kd=1.0, filter_s=1e-3, setpoint=0.2)
PD = fm.StateSpace(name="law", inputs=("angle", "rate"), D=((-STIFFNESS, -DAMPING),))
LAGGING = {"name": "law", "inputs": ("angle",), "initial": (0.0,), "parameters": (0.5, -2.0)}


def link(*parts: Any, **hinge: Any) -> fm.Scene:
    """A strip with bending, static and axial modes, up to 8800 rad/s, that a hinge turns."""
    strip = beam_section(E=7e10, G=2.7e10, A=6e-5, Iy=4.5e-11, Iz=2e-9, rho=2700)
    modes = Modes(count=2, families=("bending_z", "axial"), static=True, damping_ratio=0.01)
    return (
        fm.SceneBuilder("link", gravity=(0, 0, -9.81))
        .beam("beam", length=1.0, elements=8, section=strip, modes=modes)
        .revolute("pivot", "ground", "beam", axis=(0, 1, 0), angle=0.3, **hinge)
        .marker("end", "beam", node="tip")
        .sense_coordinate("angle", "pivot").sense_coordinate("rate", "pivot", quantity="rate")
        .add(*parts)
        .scene()
    )  # fmt: skip


class Posed(NamedTuple):
    """The closed loop of a scene with what its Jacobian needs, y at the start, and who holds what is at an address."""

    loop: Loop
    moving: LoopTangent
    y: Any
    held: tuple[Any, ...]


def posed(scene: fm.Scene) -> Posed:
    plant = fm.compile(scene)
    chosen = algorithms.chosen("articulated")
    route = plant.route()
    tables = route.tables()
    feedback = Feedback(plant, chosen, route, tables)
    assert route.linear is not None
    linear = route.linear(*tables)
    feedback.with_retraction(linear)
    begun = feedback.begin(
        origin(plant, 0.0, None, "radau5"), Clock(np.array([0.0, 1.0]), np.array([1.0])),
        Accuracy(1e-8, 1e-8, plant.nq + plant.nu, 1), linear,
    )  # fmt: skip
    return Posed(feedback.running, feedback._tangent(linear, len(begun.y)), begun.y, (feedback, linear))


def by_differences(loop: Loop, y: Any) -> Any:
    """df/dy of the whole closed loop, of fourth order."""
    def slope(j: int, size: float) -> Any:
        moved, found = y.copy(), np.empty(len(y))
        moved[j] += size
        assert rhs(0.3, moved, found, loop, loop) == OK
        return found

    step = 1e-3
    return np.column_stack([
        (slope(j, -2 * step) - slope(j, 2 * step) + 8.0 * (slope(j, step) - slope(j, -step))) / (12.0 * step)
        for j in range(len(y))
    ])  # fmt: skip


ACCELEROMETER = (
    fm.MarkerSensor(name="felt", marker="end", quantity="specific_force", frame="marker"),
    fm.StateSpace(name="law", inputs=("felt[2]", "angle"), A=((-5.0,),), B=((5.0, 1.0),), C=((-0.2,),)),
)
CHAIN = (
    fm.MarkerSensor(name="tip", marker="end", quantity="position"),
    fm.StateSpace(name="filter", inputs=("tip[0]", "tip[2]"), A=((-9.0, 1.0), (0.0, -7.0)), B=((3.0, 0.2), (0.1, 4.0)),
                  C=((1.0, 2.0),), initial=(0.3, -0.2)),
    fm.GainTable(name="law", inputs=("angle", "filter"), points=(-3.0, 3.0), values=(-6.0, 6.0)),
)  # fmt: skip


@pytest.mark.parametrize("parts", [(PID,), (PD,), ACCELEROMETER, CHAIN], ids=["pid", "pd", "accelerometer", "chain"])
def test_the_jacobian_is_that_of_the_closed_loop(parts: Any) -> None:
    loop, moving, y, _held = posed(pendulum(*parts, torque=TORQUE).scene())
    y[2:4] = 0.4, -0.7
    found, expected = np.empty((len(y), len(y))), by_differences(loop, y)
    assert jacobian(0.3, y, found, loop, moving) == OK
    assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()
    expected[:4, :4] -= moving.of_motion[:4, :4]  # and it is not that of the motion alone
    assert np.abs(expected).max() > 0.5


def test_a_force_in_node_axes_has_its_derivative_by_orientation() -> None:
    parts = fm.MarkerSensor(name="seen", marker="tip", quantity="orientation"), fm.StateSpace(
        name="law", inputs=("seen[1]", "seen[2]"), D=((3.0, -2.0),)
    )
    scene = tossed(*parts).force("thrust", "hub", direction=(0, 0, 1), frame="node", function=TORQUE).scene()
    loop, moving, y, _held = posed(scene)
    y[3:7] = np.array([0.8, 0.3, -0.4, 0.2]) / np.linalg.norm([0.8, 0.3, -0.4, 0.2])
    found, expected = np.empty((len(y), len(y))), by_differences(loop, y)
    assert jacobian(0.3, y, found, loop, moving) == OK
    unit = np.eye(len(y))  # along the quaternion itself nothing moves
    unit[3:7, 3:7] -= np.outer(y[3:7], y[3:7])
    assert np.abs((found - expected) @ unit).max() < 1e-7


@pytest.fixture(scope="module")
def known() -> fm.Trajectory:
    return fm.simulate(link(PID, torque=TORQUE), 0.3, rtol=1e-12, atol=1e-12, samples=7)


@pytest.mark.parametrize("method", ADAPTIVE)
def test_a_stiff_link_with_a_pid_controller(method: Any, known: fm.Trajectory) -> None:
    """Each ten times finer tolerance is ten times closer to DOP853 at 1e-12, about: errors are those of the method."""
    errors = [
        np.abs(fm.simulate(link(PID, torque=TORQUE), 0.3, method, samples=7, rtol=rtol, atol=1e-2 * rtol).q - known.q)
        .max()
        for rtol in (1e-6, 1e-8)
    ]  # fmt: skip
    assert errors[1] < 1e-9
    assert errors[1] < 0.1 * errors[0] or errors[0] < 1e-9


def test_the_stiff_link_with_another_gain_is_another_motion(known: fm.Trajectory) -> None:
    other = fm.Pid(name="law", inputs=("angle",), kp=4.0, ki=3.0, kd=1.001, filter_s=1e-3, setpoint=0.2)
    run = fm.simulate(link(other, torque=TORQUE), 0.3, "radau5", samples=7, rtol=1e-8)
    assert np.abs(run.q - known.q).max() > 1e-6


@pytest.mark.parametrize("method", ADAPTIVE)
def test_a_controller_takes_the_steps_of_the_spring_that_it_stands_for(method: Any) -> None:
    stiff = fm.StateSpace(name="law", inputs=("angle", "rate"), D=((-2e5, -2e3),))
    run = fm.simulate(link(stiff, torque=TORQUE), 0.5, method, rtol=1e-6, atol=1e-8)
    sprung = fm.simulate(link(stiffness=2e5, damping=2e3), 0.5, method, rtol=1e-6, atol=1e-8)
    assert run.finished and np.abs(run.q - sprung.q).max() < 1e-7
    assert run.statistics.accepted_steps == pytest.approx(sprung.statistics.accepted_steps, rel=0.05, abs=3)


def test_without_the_controller_in_the_jacobian_steps_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    stiff = fm.StateSpace(name="law", inputs=("angle", "rate"), D=((-2e5, -2e3),))
    complete = fm.simulate(link(stiff, torque=TORQUE), 5e-3, "radau5", rtol=1e-6, atol=1e-8)
    whole = Feedback._tangent
    monkeypatch.setattr(Feedback, "_tangent", lambda *given: replace(whole(*given), column=np.zeros(0, np.int64)))
    incomplete = fm.simulate(link(stiff, torque=TORQUE), 5e-3, "radau5", rtol=1e-6, atol=1e-8)
    assert incomplete.statistics.evaluations > 5 * complete.statistics.evaluations


@pytest.mark.parametrize("kind", ["lagging", "plainly_lagging"])
@pytest.mark.parametrize("method", [*ADAPTIVE, "generalised_alpha"])
def test_laws_of_the_users_own(method: Any, kind: str) -> None:
    law = fm.UserLaw(function=f"tests.flexmb.control.laws:{kind}", **LAGGING)
    settings: dict[str, Any] = {"step": 1e-3} if method == "generalised_alpha" else {}
    run = fm.simulate(rotor(law), 1.0, method, samples=5, **settings)
    known = fm.simulate(rotor(law), 1.0, samples=5)
    assert run.statistics.jacobians > 0
    bound = 1e-6 if settings else 1e-9
    assert np.abs(run.q - known.q).max() < bound
    assert np.abs(run.signals["law"] - known.signals["law"]).max() < 10 * bound


@pytest.mark.parametrize("radius", [0.0, 0.8, 1.0])
def test_generalised_alpha_is_of_order_2_in_states_of_controllers_too(radius: float) -> None:
    """States are integrated by the rule of the speeds, which is of order 2 for any equation of first order."""
    slow = fm.Pid(name="law", inputs=("angle",), kp=4.0, ki=3.0, kd=1.0, filter_s=0.1, setpoint=0.2)
    scene = pendulum(slow, torque=TORQUE).scene()
    exact = fm.simulate(scene, 0.5, rtol=1e-12, atol=1e-12, samples=2)
    steps = 0.5 / 2.0 ** np.arange(6, 10)
    runs = [
        fm.simulate(scene, 0.5, "generalised_alpha", samples=2, step=h, spectral_radius=radius) for h in steps
    ]
    for error in (
        [np.abs(run.u[-1] - exact.u[-1]).max() for run in runs],
        [abs(run.signals["law"][-1, 0] - exact.signals["law"][-1, 0]) for run in runs],
    ):
        assert observed_order(steps, error, 1e-9) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("method", [*ADAPTIVE, "generalised_alpha"])
def test_a_limit_is_no_obstacle(method: Any) -> None:
    """A kink in the equations: the torque is at its limit first, then linear."""
    law = fm.Pid(name="law", inputs=("angle",), kp=40.0, ki=3.0, kd=9.0, filter_s=1e-2, lower=-2.0, upper=2.0)
    settings: dict[str, Any] = {"step": 5e-4} if method == "generalised_alpha" else {"rtol": 1e-8}
    run = fm.simulate(pendulum(law, torque=TORQUE).scene(), 1.0, method, samples=11, **settings)
    known = fm.simulate(pendulum(law, torque=TORQUE).scene(), 1.0, samples=11)
    assert np.abs(run.q - known.q).max() < 1e-5
    assert np.abs(run.signals["law"]).max() == 2.0
