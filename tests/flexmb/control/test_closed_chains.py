"""Controllers in closed chains: against the chain with springs, one coordinate's equation, and loads that are known."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexmb as fm
from flexmb.control.feedback import Feedback
from flexmb.tables.status import Status
from tests.flexmb.closure import mechanisms as m

STIFFNESS, DAMPING, LAG = 3.0, 0.4, 0.3
RUNS: dict[str, dict[str, Any]] = {
    "dop853": {}, "rk4": {"method": "rk4", "step": 1e-3}, "stabilised": {"stabilise": 20.0},
    "radau5": {"method": "radau5"}, "exponential": {"method": "exponential"},
}  # fmt: skip
PD = fm.StateSpace(name="law", inputs=("angle", "rate"), D=((-STIFFNESS, -DAMPING),))
LAGGING = fm.StateSpace(name="law", inputs=("angle", "rate"), A=((-1 / LAG,),), B=((1 / LAG, 0.2),), C=((-STIFFNESS,),))
SAMPLED = msgspec.structs.replace(PD, period_s=0.05, delay_s=0.02)


def windows(count: int, law: Any, speed: float = 2.0) -> fm.Scene:
    """Four-bars in a row, which pass their singular position, with a law at the first foot."""
    return controlled(m.windows(count, speed), "foot 0", law)


def controlled(scene: fm.Scene, hinge: str, *parts: Any) -> fm.Scene:
    """With sensors of a hinge, and what drives it."""
    signal = fm.ControlSignal(source="law")
    hinges = tuple(
        msgspec.structs.replace(each, rotation=msgspec.structs.replace(each.rotation, torque_Nm=signal))
        if each.name == hinge else each
        for each in scene.hinges
    )  # fmt: skip
    kinds = fm.StateSpace | fm.Pid | fm.UserLaw | fm.GainTable
    return msgspec.structs.replace(
        scene, hinges=hinges, controllers=tuple(part for part in parts if isinstance(part, kinds)),
        sensors=(
            fm.CoordinateSensor(name="angle", of=hinge), fm.CoordinateSensor(name="rate", of=hinge, quantity="rate"),
            *(part for part in parts if not isinstance(part, kinds)),
        ),
    )  # fmt: skip


def single() -> fm.Scene:
    """One body with the inertia and weight of one window."""
    return (
        fm.SceneBuilder("one", gravity=(0.0, -9.81, 0.0))
        .rigid_body("bar", mass=4.0, com=(0.5, 0.0, 0.0), inertia=np.full(3, 2.0 / 3.0))
        .revolute("foot 0", "ground", "bar", angle=0.5 * np.pi, rate=-2.0)
        .scene()
    )


def turn(count: int, law: str, times: Any, speed: float = 2.0) -> Any:
    """Angle of the uprights while they stay parallel, under the law at one of them."""
    inertia, weight = (count + 1) / 3.0 + count, -9.81 * (0.5 * (count + 1) + count)

    def slope(t: float, y: Any) -> Any:
        torque = -STIFFNESS * y[0] - DAMPING * y[1] if law == "pd" else -STIFFNESS * y[2]
        if law == "pid":
            torque = 3.0 * -y[0] + 0.4 * (-y[0] - y[2]) / 2e-3
            return [y[1], (weight * np.cos(y[0]) + torque) / inertia, (-y[0] - y[2]) / 2e-3]
        return [y[1], (weight * np.cos(y[0]) + torque) / inertia, (y[0] - y[2]) / LAG + 0.2 * y[1]]

    start = [0.5 * np.pi, -speed, -0.5 * np.pi if law == "pid" else 0.0]
    return solve_ivp(slope, (0.0, times[-1]), start, "DOP853", times, rtol=1e-13, atol=1e-13).y


def feet(run: fm.Trajectory, scene: fm.Scene, count: int) -> Any:
    system = fm.compile(scene)
    return run.q[:, [system.coordinate(f"foot {i}").start for i in range(count + 1)]]


@pytest.mark.parametrize("settings", ["dop853", "rk4", "stabilised", "radau5", "exponential"])
@pytest.mark.parametrize("kind", ["pd", "lagging"])
@pytest.mark.parametrize("count", [1, 3])
def test_controlled_windows_pass_where_all_bars_lie_on_one_line(count: int, kind: str, settings: str) -> None:
    scene = windows(count, PD if kind == "pd" else LAGGING)
    run = fm.simulate(scene, 4.0, samples=41, **RUNS[settings])
    assert run.finished, run.message
    known = turn(count, kind, run.t)
    assert np.abs(feet(run, scene, count) - known[0][:, None]).max() < 1e-8
    assert np.abs(run.energy_drift).max() < 1e-7
    if kind == "lagging":
        assert np.abs(run.signals["law"][:, 0] + STIFFNESS * known[2]).max() < 1e-7


def crank_turn(rate: float, times: Any) -> Any:
    """Angle of a crank of 0.5 m whose rod is as long, under the lagging law: Lagrange's equation."""
    r, slider = 0.5, 0.4
    bar = 0.78 * r
    turning = 2.0 * bar * r**2 / 12.0

    def slope(t: float, y: Any) -> Any:
        c, s = r * np.cos(y[0]), r * np.sin(y[0])
        bodies = (bar, -0.5 * s, 0.5 * c), (bar, -1.5 * s, 0.5 * c), (slider, -2.0 * s, 0.0)  # mass, d(x, y)/dangle
        bends = (-0.5 * c, -0.5 * s), (-1.5 * c, -0.5 * s), (-2.0 * c, 0.0)
        inertia = turning + sum(mass * (x**2 + z**2) for mass, x, z in bodies)
        change = sum(mass * (x * dx + z * dz) for (mass, x, z), (dx, dz) in zip(bodies, bends, strict=True))
        weight = -9.81 * sum(mass * z for mass, _, z in bodies)
        torque = -STIFFNESS * y[2]
        return [y[1], (weight + torque - change * y[1] ** 2) / inertia, (y[0] - y[2]) / LAG + 0.2 * y[1]]

    return solve_ivp(slope, (0.0, times[-1]), [1.3, rate, 0.0], "DOP853", times, rtol=1e-13, atol=1e-13).y[0]


@pytest.mark.parametrize("settings", RUNS)
def test_a_controlled_crank_turns_through_where_its_rod_lies_on_it(settings: str) -> None:
    """Accelerations depend on speeds here; the rod passes the crank back and forth."""
    scene = controlled(m.slider_crank(0.5, 0.5, angle=1.3, rate=1.894969), "drive", LAGGING)
    run = fm.simulate(scene, 1.0, samples=21, **RUNS[settings])
    assert run.finished, run.message
    assert np.sum(np.diff(np.sign(np.cos(run.q[:, 0]))) != 0.0) >= 2
    assert np.abs(run.q[:, 0] - crank_turn(run.u[0, 0], run.t)).max() < 1e-9


@pytest.mark.parametrize("settings", ["dop853", "rk4"])
def test_a_filter_as_short_as_a_leap_is_followed_through_it(settings: str) -> None:
    """A derivative filtered by 2 ms, where leaps take one."""
    law = fm.Pid(name="law", inputs=("angle",), kp=3.0, kd=0.4, filter_s=2e-3)
    scene = windows(1, law)
    step = {"step": 2e-4} if settings == "rk4" else {}
    run = fm.simulate(scene, 1.0, settings, samples=41, **step)
    assert run.finished and run.q[-1, 0] < -2.0  # beyond the first two of such positions
    assert np.abs(feet(run, scene, 1) - turn(1, "pid", run.t)[0][:, None]).max() < 1e-7


@pytest.mark.parametrize("settings", ["dop853", "rk4"])
def test_sampled_controllers_in_windows(settings: str) -> None:
    """Against one body with the inertia and weight of the windows, under the same law."""
    scene = windows(1, SAMPLED)
    run = fm.simulate(scene, 2.0, samples=41, **RUNS[settings])
    alone = fm.simulate(controlled(single(), "foot 0", SAMPLED), 2.0, samples=41, rtol=1e-12)
    assert run.finished and run.q[-1, 0] != pytest.approx(0.5 * np.pi)
    assert np.abs(feet(run, scene, 1) - alone.q).max() < 1e-8


def test_without_leaps_there_is_no_way_through(monkeypatch: pytest.MonkeyPatch) -> None:
    begin = Feedback.begin

    def grounded(self: Feedback, *given: Any) -> Any:
        self._leaping = None
        return begin(self, *given)

    monkeypatch.setattr(Feedback, "begin", grounded)
    run = fm.simulate(windows(1, PD), 2.0, max_steps=1000)
    assert not run.finished and run.stopped_at < 0.5


def derivative(filter_s: float) -> fm.Pid:
    return fm.Pid(name="law", inputs=("angle",), kp=3.0, kd=0.4, filter_s=filter_s)


def test_a_filter_that_follows_at_once_is_carried_along() -> None:
    """It settles in a hundredth of a leap, and long before it: what it leaves to be integrated is smooth."""
    run = fm.simulate(windows(1, derivative(1e-5)), 0.6, samples=13)
    alone = fm.simulate(controlled(single(), "foot 0", derivative(1e-5)), 0.6, samples=13)
    assert run.finished and run.q[-1, 0] < 0.0
    assert np.abs(feet(run, windows(1, PD), 1) - alone.q).max() < 1e-8


def ringing(speed: float, size: float) -> fm.StateSpace:
    """A torque that swings whatever the motion is."""
    return fm.StateSpace(
        name="law", inputs=("angle",), A=((0.0, speed), (-speed, 0.0)), B=((0.0,), (0.0,)), C=((1.0, 0.0),),
        initial=(size, 0.0),
    )  # fmt: skip


def test_controllers_that_are_faster_than_any_leap_end_the_run() -> None:
    """Never wrong and finished: it swings a hundred times in a leap, before which its method takes long steps."""
    run = fm.simulate(windows(1, ringing(1e5, 0.1)), 0.6, "exponential", rtol=1e-6, samples=13)
    assert run.status is Status.CLOSURE_SINGULAR
    assert 0.45 < run.stopped_at < 0.55


CUT = fm.GainTable(name="law", inputs=("angle",), points=(0.0, 3e-4), values=(2.0, 3.0))


@pytest.mark.parametrize("law", [ringing(2.5e3, 2.0), CUT], ids=["swinging", "cut off"])
def test_what_swings_or_comes_to_a_limit_in_a_leap_acts_by_its_average(law: Any) -> None:
    """Against one body under the same law: a torque that swings in the time of a leap, and one at a limit in it."""
    alone = fm.simulate(controlled(single(), "foot 0", law), 1.0, samples=21, rtol=1e-12)
    run = fm.simulate(windows(1, law), 1.0, samples=21)
    assert run.finished and run.q[-1, 0] < -1.0, run.message
    assert np.abs(feet(run, windows(1, PD), 1) - alone.q).max() < 2e-8


GRASHOF = m.four_bar(gravity=-9.81)
LOADS = fm.LoadSensor(name="pin load", hinge="pin"), fm.LoadSensor(name="loop load", hinge="loop")


@pytest.mark.parametrize("algorithm", ["articulated", "composite"])
@pytest.mark.parametrize("period", [0.02, None])
def test_loads_of_hinges_and_closures_are_measured(period: float | None, algorithm: Any) -> None:
    """What sensors say is what is observed, and what a law makes of it acts: sampled at once, continuous by a lag."""
    read = {"name": "law", "inputs": ("pin load[3]", "loop load[4]")}
    law = (
        fm.StateSpace(**read, D=((0.02, -0.01),), period_s=period) if period
        else fm.StateSpace(**read, A=((-20.0,),), B=((0.4, -0.2),), C=((1.0,),))
    )  # fmt: skip
    run = fm.simulate(controlled(GRASHOF, "drive", law, *LOADS), 0.2, samples=11, algorithm=algorithm, rtol=1e-8)
    assert run.finished, run.message
    size = np.nanmax(np.abs(run.loads["loop"]))
    for name in ("pin", "loop"):  # out of the plane nothing determines them
        np.testing.assert_allclose(run.signals[f"{name} load"], run.loads[name], rtol=0.0, atol=1e-9 * size)
        assert np.array_equal(np.isnan(run.loads[name]).any(axis=0), [True, True, False, False, False, True])
    if period:  # samples of the output are instants of the law
        expected = 0.02 * run.loads["pin"][1:, 3] - 0.01 * run.loads["loop"][1:, 4]
        before = fm.simulate(controlled(GRASHOF, "drive", law, *LOADS), 0.2, samples=11, rtol=1e-8).signals["law"]
        assert np.abs(run.signals["law"] - before).max() < 1e-7 * np.abs(before).max()
        assert np.abs(run.signals["law"][1:, 0] - expected).max() < 0.1 * np.abs(expected).max()
    assert np.abs(run.energy_drift).max() < 1e-6
    assert np.abs(run.signals["law"][-1]).max() > 1e-3


def test_a_controlled_chain_has_the_linear_model_of_its_motion() -> None:
    """A proportional law is a spring, at rest and in motion; a lag's state acts as what it follows would."""
    rest, moving = m.four_bar(gravity=0.0, rate=0.0), m.four_bar()
    hinges = tuple(
        msgspec.structs.replace(
            hinge, rotation=msgspec.structs.replace(hinge.rotation, stiffness_Nm_rad=STIFFNESS)
        ) if hinge.name == "drive" else hinge
        for hinge in moving.hinges
    )  # fmt: skip
    proportional = fm.StateSpace(name="law", inputs=("angle", "rate"), D=((-STIFFNESS, 0.0),))
    spring = fm.linearize(msgspec.structs.replace(moving, hinges=hinges)).A
    law = fm.linearize(controlled(moving, "drive", proportional)).A
    assert np.abs(law - spring).max() < 1e-8 * np.abs(spring).max()
    assert np.abs(fm.linearize(moving).A - spring).max() > 1.0  # and without the law it is another model
    damper = fm.StateSpace(name="law", inputs=("angle", "rate"), D=((0.0, -STIFFNESS),))
    lag = fm.linearize(controlled(rest, "drive", LAGGING))
    assert [name for name, _ in lag.states] == ["drive.rotation", "drive.rotation.rate", "law.state[0]"]
    assert lag.A[2] == pytest.approx([1 / LAG, 0.2, -1 / LAG], abs=1e-9)
    assert lag.A[1, 2] == pytest.approx(fm.linearize(controlled(rest, "drive", damper)).A[1, 1], rel=1e-9)
