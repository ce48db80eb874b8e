"""Continuous controllers against motions that are known without them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import flexmb as fm
from tests.flexmb.control.scenes import DAMPING, INERTIA, STIFFNESS, pendulum, rotor

GAINS = ((-STIFFNESS, -DAMPING),)
LAW = {"name": "law", "inputs": ("angle", "rate")}
TORQUE = fm.ControlSignal(source="law")
RUN: dict[str, Any] = {"t_end": 2.0, "samples": 41}


@pytest.fixture(scope="module")
def sprung() -> fm.Trajectory:
    """The double pendulum with a spring and a damper in its first hinge."""
    return fm.simulate(pendulum(stiffness=STIFFNESS, damping=DAMPING).scene(), **RUN)


def spring_energy(run: fm.Trajectory) -> Any:
    """Of the spring that a controller stands for."""
    return 0.5 * STIFFNESS * run.q[:, 0] ** 2


@pytest.mark.parametrize("law", [
    fm.StateSpace(**LAW, D=GAINS),
    fm.UserLaw(**LAW, function="tests.flexmb.control.laws:proportional", parameters=(STIFFNESS, DAMPING)),
    fm.UserLaw(**LAW, function="tests.flexmb.control.laws:plainly_proportional", parameters=(STIFFNESS, DAMPING)),
], ids=["state space", "compiled", "plain"])  # fmt: skip
def test_a_pd_controller_is_a_spring_and_a_damper(law: Any, sprung: fm.Trajectory) -> None:
    """Steps are the same, sums are of another order: rounding, which the motion does not amplify a thousandfold."""
    run = fm.simulate(pendulum(law, torque=TORQUE).scene(), **RUN)
    assert run.statistics.evaluations == sprung.statistics.evaluations
    assert np.abs(run.q - sprung.q).max() < 1e-12
    assert np.abs(run.loads["pivot"] - sprung.loads["pivot"]).max() < 1e-11
    stored = spring_energy(run) - spring_energy(run)[0]
    assert np.abs(run.work + stored - sprung.work).max() < 1e-9  # quadratures of step errors of 1e-10
    assert np.abs(run.energy_drift).max() < 1e-9


def test_another_gain_is_seen(sprung: fm.Trajectory) -> None:
    law = fm.StateSpace(**LAW, D=((-STIFFNESS, -0.999 * DAMPING),))
    run = fm.simulate(pendulum(law, torque=TORQUE).scene(), **RUN)
    assert np.abs(run.q - sprung.q).max() > 1e-5


@pytest.mark.parametrize("method", ["dop853", "rk4"])
@pytest.mark.parametrize("kind", ["state space", "compiled"])
def test_states_of_a_controller_are_integrated_with_the_motion(kind: str, method: Any) -> None:
    """A lag between angle and torque: J theta'' = -k z, z' = (theta - z) / T, by the exponential of its matrix."""
    lag, k = 0.5, 2.0
    law: Any = fm.StateSpace(name="law", inputs=("angle",), A=((-1 / lag,),), B=((1 / lag,),), C=((-k,),))
    if kind == "compiled":
        law = fm.UserLaw(
            name="law", inputs=("angle",), function="tests.flexmb.control.laws:lagging", initial=(0.0,),
            parameters=(lag, -k),
        )  # fmt: skip
    run = fm.simulate(rotor(law), 3.0, method, samples=7, step=1e-3 if method == "rk4" else None)
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -k / INERTIA], [1 / lag, 0.0, -1 / lag]])
    expected = np.array([expm(A * t) @ [0.3, 0.0, 0.0] for t in run.t])
    assert np.abs(run.q[:, 0] - expected[:, 0]).max() < 1e-9  # of tolerances 1e-10, and of (1e-3)^4
    assert np.abs(run.signals["law"][:, 0] + k * expected[:, 2]).max() < 1e-9


def test_a_pid_controller_follows_its_differential_equation() -> None:
    """With the filtered derivative as a state, started at the first error, and a setpoint."""
    kp, ki, kd, tau, aim = 4.0, 2.0, 1.0, 0.1, 0.5
    law = fm.Pid(name="law", inputs=("angle",), kp=kp, ki=ki, kd=kd, filter_s=tau, setpoint=aim)
    run = fm.simulate(rotor(law), 3.0, samples=7)
    # states: error, its rate, integral, filtered error; torque = kp e + ki i + kd (e - f) / tau
    A = np.array([
        [0.0, 1.0, 0.0, 0.0],
        [-(kp + kd / tau) / INERTIA, 0.0, -ki / INERTIA, kd / tau / INERTIA],
        [1.0, 0.0, 0.0, 0.0],
        [1.0 / tau, 0.0, 0.0, -1.0 / tau],
    ])  # fmt: skip
    start = [aim - 0.3, 0.0, 0.0, aim - 0.3]
    errors = np.array([(expm(A * t) @ start)[0] for t in run.t])
    assert np.abs(aim - run.q[:, 0] - errors).max() < 1e-9


def test_a_limit_keeps_the_integral_from_winding_up() -> None:
    """A torque that is too weak for long: the overshoot with tracking is a fraction of that without."""
    def overshoot(tracking: float) -> float:
        law = fm.Pid(
            name="law", inputs=("angle",), kp=2.0, ki=1.0, kd=2.5, filter_s=0.02, setpoint=2.0, lower=-0.2, upper=0.2,
            tracking_s=tracking,
        )  # fmt: skip
        run = fm.simulate(rotor(law), 20.0)
        assert np.abs(run.signals["law"]).max() <= 0.2
        return float(run.q.max()) - 2.0

    assert overshoot(0.5) < 0.5 * overshoot(1e9)


def test_controllers_in_a_row() -> None:
    """A saturation behind a gain is a motor of limited torque; a table that is constant passes its input on."""
    parts = (
        fm.StateSpace(name="pd", inputs=("angle", "rate"), D=GAINS),
        fm.Saturation(name="limit", inputs=("pd",), lower=-0.1, upper=0.1),
        fm.GainTable(name="law", inputs=("angle", "limit"), points=(0.0, 1.0), values=(1.0, 1.0)),
    )
    run = fm.simulate(rotor(*parts), 1.0)
    assert np.array_equal(run.signals["law"], np.clip(run.signals["pd"], -0.1, 0.1))
    assert run.signals["law"].min() == -0.1
    # the torque is at its limit from the start until the gain asks for less
    early = run.t < 0.5
    assert np.abs(run.q[early, 0] - (0.3 - 0.05 / INERTIA * run.t[early] ** 2)).max() < 1e-12


def test_a_gain_by_a_table() -> None:
    law = fm.GainTable(name="law", inputs=("angle",), points=(-1.0, 0.0, 2.0), values=(1.0, 0.0, -4.0))
    run = fm.simulate(rotor(law), 1.0)
    expected = np.where(run.q[:, :1] > 0.0, -2.0 * run.q[:, :1], -run.q[:, :1])
    assert np.abs(run.signals["law"] - expected).max() < 1e-15


def test_an_accelerometer_is_filtered_before_it_is_fed_back() -> None:
    """Specific force at the rim through a lag: -r theta'^2 along its radius, r theta'' across."""
    lag = 0.2
    parts = (
        fm.MarkerSensor(name="felt", marker="rim", quantity="specific_force", frame="marker"),
        fm.StateSpace(name="law", inputs=("felt[1]",), A=((-1 / lag,),), B=((1 / lag,),), C=((-2.0,),)),
    )
    run = fm.simulate(rotor(*parts, rate=1.0), 2.0, samples=9)
    # J theta'' = -2 z, z' = (theta'' - z) / lag
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -2.0 / INERTIA], [0.0, 0.0, -(2.0 / INERTIA + 1.0) / lag]])
    expected = np.array([(expm(A * t) @ [0.3, 1.0, 0.0]) for t in run.t])
    assert np.abs(run.q[:, 0] - expected[:, 0]).max() < 1e-9
    assert np.abs(run.signals["felt"][:, 0] + run.u[:, 0] ** 2).max() < 1e-12
    assert np.abs(run.signals["felt"][:, 1] + 2.0 / INERTIA * expected[:, 2]).max() < 1e-9


def test_signals_of_sensors_are_what_is_observed() -> None:
    parts = tuple(
        fm.MarkerSensor(name=quantity, marker="end", quantity=quantity)
        for quantity in ("position", "orientation", "velocity", "angular_velocity", "acceleration")
    )
    law = fm.StateSpace(**LAW, D=GAINS)
    profile = fm.ProfileSensor(name="profile", function=fm.Ramp(rate=2.0))
    clock = fm.TimeSensor(name="clock")
    run = fm.simulate(pendulum(*parts, profile, clock, law, torque=TORQUE).scene(), **RUN)
    end, seen = run.markers["end"], run.signals
    assert np.array_equal(seen["position"], end.position)
    assert np.abs(np.abs(np.sum(seen["orientation"] * end.quaternion, axis=1)) - 1.0).max() < 1e-14
    assert np.array_equal(seen["velocity"], end.velocity[:, 3:])
    assert np.array_equal(seen["angular_velocity"], end.velocity[:, :3])
    assert np.abs(seen["acceleration"] - end.acceleration[:, 3:]).max() < 1e-12
    assert np.array_equal(seen["angle"], run.q[:, :1])
    assert np.array_equal(seen["clock"][:, 0], run.t)
    assert np.array_equal(seen["profile"], np.column_stack([2.0 * run.t, np.full(len(run.t), 2.0)]))
    names = [name for name, _, _ in run.columns()]
    assert "signal.position[2]" in names


def test_force_at_a_node_by_a_controller() -> None:
    """A spring to World's origin, made of a sensor of position and three forces, conserves its energy."""
    k = 5.0
    law = fm.StateSpace(name="law", inputs=("where",), D=(-k * np.eye(3)).tolist())
    builder = (
        fm.SceneBuilder("held").rigid_body("hub", mass=2.0, inertia=(0.3, 0.5, 0.7), nodes={"eye": (0.3, -0.2, 0.5)})
        .free("float", "ground", "hub", angular_velocity=(0.4, -1.0, 2.0), velocity=(1.0, 0.5, 3.0))
        .marker("eye", "hub", node="eye")
        .add(fm.MarkerSensor(name="where", marker="eye", quantity="position"), law)
    )  # fmt: skip
    for i, direction in enumerate(np.eye(3)):
        pull = fm.ControlSignal(source=f"law[{i}]")
        builder.force(f"pull {i}", "hub", node="eye", direction=direction, function=pull)
    run = fm.simulate(builder.scene(), 3.0)
    energy = run.total_energy + 0.5 * k * np.sum(run.markers["eye"].position ** 2, axis=1)
    assert np.abs(energy - energy[0]).max() < 1e-9 * energy[0]
    assert np.abs(run.energy_drift).max() < 1e-8
    assert np.abs(run.momentum_drift[:, :3]).max() < 1e-8  # a central force
    stored = -k * np.sum(run.markers["eye"].position * run.markers["eye"].velocity[:, 3:], axis=1)
    assert run.power["law"].sum(axis=1) == pytest.approx(stored, abs=1e-12 * np.abs(stored).max())


def test_a_scene_without_controllers_knows_of_none() -> None:
    """Neither a loop, nor a copy of its system, nor other kernels."""
    system = fm.compile(rotor())
    fm.simulate(system, 0.1)
    (kept,) = (value for key, value in system.kept.items() if isinstance(key, tuple) and "dop853" in key)
    assert kept[0].feedback is None
    assert not system.signals


def test_outside_of_a_run_the_loop_is_open() -> None:
    law = fm.StateSpace(**LAW, D=GAINS)
    system = fm.compile(rotor(law))
    fm.simulate(system, 0.5)
    assert system.accelerations(system.initial_state)[0] == 0.0


@pytest.mark.parametrize("algorithm", ["composite", "frisch", "frisch_as_printed"])
@pytest.mark.parametrize("period", [0.05, None])
def test_loads_are_measured_by_every_algorithm(period: float | None, algorithm: Any) -> None:
    """As the recursion measures them, by laws that only the measured load moves."""
    sensor = fm.LoadSensor(name="load", hinge="elbow")
    read = {"name": "law", "inputs": ("load[0]", "load[5]")}
    law = (
        fm.StateSpace(**read, D=((0.0, 0.1),), period_s=period, delay_s=0.01) if period
        else fm.StateSpace(**read, A=((-5.0,),), B=((0.0, 0.5),), C=((1.0,),))
    )  # fmt: skip
    scene = pendulum(sensor, law, torque=TORQUE).scene()
    known, run = fm.simulate(scene, 0.5, samples=11), fm.simulate(scene, 0.5, samples=11, algorithm=algorithm)
    assert np.abs(known.signals["law"]).max() > 0.1
    assert np.abs(run.q - known.q).max() < 1e-9
    assert np.abs(run.signals["load"] - run.loads["elbow"]).max() < 1e-10
    assert np.abs(run.signals["law"] - known.signals["law"]).max() < 1e-8
