"""The wheel-gyrostat family against closed forms, and its folders judged as a user would."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crosscheck.engines.registry import engine
from flexmb.run.simulate import simulate
from flexmb.scene.build import SceneBuilder
from flexmb.scene.files import load_scene
from flexmb.scene.functions import Ramp
from flexmb.scene.schema import Scene
from flexmb.system.compile import compile
from tests.cases.shipped import noticed_controls

FAMILY = Path(__file__).parents[2] / "cases" / "wheel_gyrostat"
CONSERVATIVE_RTOL = 1e-11  # at which drifts are promised
POINTWISE = 1e-12  # some hundred roundings of a few bodies; a wrong sign or frame is wrong in the first digit

TRANSVERSE, AXIAL = 20.0, 12.0  # kg m^2, the whole body with its wheel
WHEEL_AXIAL, WHEEL_TRANSVERSE = 0.5, 0.3  # kg m^2
BODY_RATE = (0.3, 0.0, 0.7)  # rad/s


def symmetric_gyrostat(wheel_speed: float) -> Scene:
    """An axisymmetric body with a wheel on its axis z, at its mass centre."""
    return (
        SceneBuilder("symmetric gyrostat")
        .rigid_body(
            "body", mass=50.0,
            inertia=(TRANSVERSE - WHEEL_TRANSVERSE, TRANSVERSE - WHEEL_TRANSVERSE, AXIAL - WHEEL_AXIAL),
        )
        .free("flight", "ground", "body", angular_velocity=BODY_RATE)
        .wheel(
            "wheel", "body", axis=(0, 0, 1), mass=5.0, axial_inertia=WHEEL_AXIAL, transverse_inertia=WHEEL_TRANSVERSE,
            speed=wheel_speed,
        )
        .marker("body", "body")
        .scene()
    )  # fmt: skip


@pytest.mark.parametrize("wheel_speed", [0.0, 25.0, -60.0])
def test_transverse_rate_of_an_axisymmetric_gyrostat_turns_at_the_closed_form_rate(wheel_speed):
    """I_t w1' = -(H3 - I_t w3) w2: the transverse rate turns about the axis at H3/I_t - w3, with constant size."""
    run = simulate(symmetric_gyrostat(wheel_speed), 10.0, rtol=1e-12, atol=1e-14, samples=101)
    path = run.markers["body"]
    rate = Rotation.from_quat(path.quaternion, scalar_first=True).inv().apply(path.velocity[:, :3])
    axial_momentum = AXIAL * BODY_RATE[2] + WHEEL_AXIAL * wheel_speed
    nutation = axial_momentum / TRANSVERSE - BODY_RATE[2]
    angle = nutation * run.t
    expected = np.column_stack(
        [BODY_RATE[0] * np.cos(angle), BODY_RATE[0] * np.sin(angle), np.full_like(angle, BODY_RATE[2])]
    )
    # rtol of each step, over at most a thousand steps
    assert np.max(np.abs(rate - expected)) < 1e-9 * np.linalg.norm(BODY_RATE)


def test_momentum_and_energy_of_the_gyrostat_are_those_of_its_parts():
    """Hub and three wheels one by one, summed by hand: h = sum (m r x v + J w), T = 1/2 sum (m v.v + w.J w)."""
    scene = load_scene(FAMILY / "torque_free" / "scene.toml")
    hub, flight = scene.bodies[0], scene.hinges[0]
    omega, velocity = np.array(flight.angular_velocity_rad_s), np.array(flight.velocity_m_s)
    nodes = {"origin": np.zeros(3)} | {node.name: np.array(node.position_m) for node in hub.nodes}
    parts = [(hub.mass_kg, np.array(hub.com_m), np.array(hub.inertia_kg_m2), omega)]
    for wheel in scene.wheels:
        axis = np.array(wheel.axis)
        across = np.eye(3) - np.outer(axis, axis)
        inertia = wheel.axial_inertia_kg_m2 * np.outer(axis, axis) + wheel.transverse_inertia_kg_m2 * across
        centre = nodes[wheel.node] + wheel.offset_m
        parts.append((wheel.mass_kg, centre, inertia, omega + wheel.speed_rad_s * axis))
    angular, linear, energy = np.zeros(3), np.zeros(3), 0.0
    for mass, centre, inertia, rate in parts:
        v = velocity + np.cross(omega, centre)
        angular += mass * np.cross(centre, v) + inertia @ rate
        linear += mass * v
        energy += 0.5 * (mass * v @ v + rate @ inertia @ rate)
    system = compile(scene)
    seen = system.evaluate(0.0, system.initial_state.q, system.initial_state.u)
    assert seen.momentum[:3] == pytest.approx(angular, rel=POINTWISE, abs=POINTWISE * np.linalg.norm(angular))
    assert seen.momentum[3:] == pytest.approx(linear, rel=POINTWISE, abs=POINTWISE * np.linalg.norm(linear))
    assert seen.energy["kinetic"] == pytest.approx(energy, rel=POINTWISE)


@pytest.mark.parametrize("name", ["native", "pinocchio", "mujoco"])
def test_bearing_torque_at_constant_spin_and_constant_body_rate_is_rate_times_momentum(name):
    """Body turned steadily about z, wheel spinning about x: torque w x h = w J Omega along y, force -m w^2 r."""
    pytest.importorskip({"native": "flexmb", "pinocchio": "pinocchio", "mujoco": "mujoco"}[name])
    turn, spin, offset, mass = 0.8, 30.0, 0.4, 5.0
    scene = (
        SceneBuilder("turntable")
        .rigid_body("table", mass=20.0, inertia=(1.0, 1.0, 2.0))
        .revolute("turn", "ground", "table", rate=turn, prescribed=Ramp(rate=turn))
        .wheel(
            "wheel", "table", axis=(1, 0, 0), offset=(offset, 0, 0), mass=mass, axial_inertia=WHEEL_AXIAL,
            transverse_inertia=WHEEL_TRANSVERSE, speed=spin,
        )
        .scene()
    )  # fmt: skip
    load = engine(name).compile(scene).evaluate().wheel_loads["wheel"]
    torque = turn * WHEEL_AXIAL * spin
    expected = [0.0, torque, 0.0, -mass * turn**2 * offset, 0.0, 0.0]
    assert load == pytest.approx(expected, rel=POINTWISE, abs=POINTWISE * torque)


@pytest.mark.parametrize("case", ["torque_free", "torque_driven", "dual_spinner", "flexible_appendage"])
def test_momentum_and_energy_balance(case):
    run = simulate(load_scene(FAMILY / case / "scene.toml"), 10.0, rtol=CONSERVATIVE_RTOL, atol=1e-13)
    assert run.finished
    assert np.max(np.abs(run.energy_drift)) < 1e-9 * run.total_energy[0]
    for part in (slice(0, 3), slice(3, 6)):
        assert np.max(np.abs(run.momentum_drift[:, part])) < 1e-10 * np.linalg.norm(run.momentum[0, part])


def test_negative_controls_of_the_torque_free_case_are_noticed(tmp_path):
    assert noticed_controls("wheel_gyrostat/torque_free", tmp_path) == {
        "hub 1 % too heavy", "skew wheel on the opposite axis", "hub 1 % too much inertia",
    }  # fmt: skip
