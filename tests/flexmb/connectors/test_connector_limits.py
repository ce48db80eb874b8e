"""Connectors by closed forms, and where laws end: slack cables, ends that meet, stops, creeping, half a turn. Bodies
leave stops again, whatever the tolerance: what is exact on the stop must not carry steps beyond it."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from flexmb.entry import articulated
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.jit.counting import count
from flexmb.scene import schema as s
from tests.flexmb.connectors.connected_scenes import positive

EXACT = {"method": "dop853", "rtol": 1e-11, "atol": 1e-13}


def slider(mass: float = 2.0, **start) -> fm.SceneBuilder:
    """A body on a rail along x."""
    builder = fm.SceneBuilder("slider").rigid_body("body", mass=mass, inertia=(1, 1, 1))
    return builder.prismatic("rail", "ground", "body", axis=(1, 0, 0), **start).marker("body", "body")


def place(run: fm.Trajectory) -> np.ndarray:
    return run.markers["body"].position[:, 0]


def test_a_spring_without_free_length_swings_through_its_other_end():
    """x = cos(wt) from one side to the other: where the ends meet, the line has no direction and the load none."""
    scene = slider(position=1.0).spring_damper("spring", "ground", "body", stiffness=18.0).scene()
    run = fm.simulate(scene, 3.0, samples=31, **EXACT)
    assert run.finished and np.max(np.abs(place(run) - np.cos(3.0 * run.t))) <= 1e-9


def test_ends_that_meet_exert_nothing_and_leave_everything_finite():
    scene = slider().spring_damper("spring", "ground", "body", free_length=0.5, preload=3.0, stiffness=18.0).scene()
    system = fm.compile(scene)
    seen = system.evaluate(0.0, np.zeros(1), np.zeros(1))
    assert not np.any(seen.connectors["spring"]) and not np.any(seen.accelerations)
    assert np.isfinite(seen.energy["spring"])
    aside = system.evaluate(0.0, np.array([1e-3]), np.zeros(1)).connectors["spring"][3]
    assert abs(aside - (18.0 * (0.5 - 1e-3) - 3.0)) <= 1e-9  # pushed apart by what is left of it


def test_a_cable_holds_and_lets_go():
    """Taut for half a period, then free flight at the speed that it had."""
    scene = slider(rate=1.0).spring_damper("cable", "ground", "body", position_a=(-1.0, 0, 0), free_length=1.0,
                                           stiffness=18.0, acts="tension").scene()  # fmt: skip
    run = fm.simulate(scene, 2.0, samples=41, **EXACT)
    half = np.pi / 3.0
    expected = np.where(run.t < half, np.sin(3.0 * run.t) / 3.0, half - run.t)
    assert np.max(np.abs(place(run) - expected)) <= 1e-8
    pulled = run.connectors["cable"][:, 3]
    assert np.all(pulled <= 0.0) and not np.any(pulled[run.t > half])


def test_a_buffer_is_its_mirror_image():
    """Compression below a gap: the wall is touched at x = 0."""
    scene = slider(position=0.2, rate=-1.0).spring_damper(
        "buffer", "ground", "body", position_a=(-1.0, 0, 0), free_length=1.0, stiffness=18.0, acts="compression"
    ).scene()  # fmt: skip
    run = fm.simulate(scene, 1.6, samples=33, **EXACT)
    assert abs(place(run)[-1] - (1.6 - 0.2 - np.pi / 3.0)) <= 1e-8


def test_stops_return_what_their_dissipation_leaves():
    """1 - 2/3 e v to first order in e v; the next term is of the order of its square."""
    v, e = 0.5, 0.02
    scene = slider(rate=v).linear_spring("stops", "rail", lower=-0.1, upper=0.1, stop_stiffness=2e3,
                                         stop_dissipation=e).scene()  # fmt: skip
    run = fm.simulate(scene, 0.6, samples=61, **EXACT)
    back = abs(run.u[-1, 0]) / v
    hits = np.count_nonzero(np.diff(np.sign(run.u[:, 0])))
    assert hits == 1 and abs(back - (1.0 - 2.0 / 3.0 * e * v)) <= (e * v) ** 2
    assert abs(run.energy_drift[-1]) <= 1e-9 * run.energy_scale


def test_tables_are_the_derivative_of_their_energy():
    table, loads = (-0.3, -0.1, 0.0, 0.2, 0.5), (-5.0, -1.5, 0.0, 4.0, 4.5)
    scene = slider().linear_spring("curve", "rail", table=table, loads=loads).scene()
    system = fm.compile(scene)

    def at(x: float) -> tuple[float, float]:
        seen = system.evaluate(0.0, np.array([x]), np.zeros(1))
        return float(seen.hinge_forces["curve"][0]), seen.energy["spring"]

    assert all(abs(at(x)[0] + load) <= 1e-14 for x, load in zip(table, loads, strict=True))
    assert at(0.0)[1] == 0.0
    for x in (-0.7, -0.2, 0.05, 0.31, 0.9):  # beyond both ends too; a cubic's energy is exact by Simpson's rule
        h = 0.01
        area = -h / 3.0 * (at(x - h)[0] + 4.0 * at(x)[0] + at(x + h)[0])
        assert abs(at(x + h)[1] - at(x - h)[1] - area) <= 1e-13


def test_friction_brings_a_body_to_rest():
    """v falls by F/m to next to nothing; then it creeps, under a load by v_r P / sqrt(F^2 - P^2)."""
    scene = slider(rate=1.0).linear_friction("guide", "rail", sliding=4.0, smoothing=1e-3).scene()
    run = fm.simulate(scene, 1.0, samples=11, **EXACT)
    moving = run.t < 0.45
    assert np.max(np.abs(run.u[moving, 0] - (1.0 - 2.0 * run.t[moving]))) <= 1e-4
    assert abs(run.u[-1, 0]) <= 1e-9
    pushed = slider().linear_friction("guide", "rail", sliding=4.0, smoothing=1e-3)
    pushed.force("push", "body", direction=(1, 0, 0), function=s.Constant(value=3.0))
    creep = fm.simulate(pushed.scene(), 0.2, method="radau5", samples=3, rtol=1e-9, atol=1e-12).u[-1, 0]
    assert abs(creep - 1e-3 * 3.0 / np.sqrt(16.0 - 9.0)) <= 1e-9


def test_a_wheel_s_bearing_brings_wheel_and_body_to_one_rate():
    """Momentum stays, the relative rate falls by F (1/J + 1/I), and what is lost is 1/2 JI/(J+I) s^2."""
    J, I, F, s0 = 0.05, 0.4, 0.02, 3.0
    builder = fm.SceneBuilder("wheel").rigid_body("body", mass=1.0, inertia=(1.0, 1.0, I))
    builder.revolute("pivot", "ground", "body", axis=(0, 0, 1))
    builder.wheel("wheel", "body", axis=(0, 0, 1), mass=0.1, axial_inertia=J, transverse_inertia=0.03, speed=s0)
    builder.angular_friction("bearing", "wheel", sliding=F, smoothing=1e-4)
    run = fm.simulate(builder.scene(), 8.0, samples=33, **EXACT)
    stop = s0 / (F * (1.0 / J + 1.0 / I))
    slipping = run.t < 0.98 * stop
    assert 5.0 < stop < 7.5 and run.finished
    falling = s0 - F * (1.0 / J + 1.0 / I) * run.t
    assert np.max(np.abs(run.u[slipping, 1] - falling[slipping])) <= 1e-6
    assert abs(run.u[-1, 1]) <= 1e-9 and abs(run.u[-1, 0] - J * s0 / (J + I)) <= 1e-9
    assert np.max(np.abs(run.momentum[:, 2] - J * s0)) <= 1e-11
    assert abs(run.work[-1] + 0.5 * J * I / (J + I) * s0**2) <= 1e-9
    assert np.max(np.abs(run.energy_drift)) <= 1e-9 * run.energy_scale


def test_each_connector_costs_what_the_one_before_it_does():
    """Operations of the right-hand side, counted: of first order in the number of connectors."""

    def operations(connectors: int) -> int:
        builder = slider(position=0.3)
        for i in range(connectors):
            end = (-1.0, 0.1 * i, 0.0)
            builder.spring_damper(f"s{i}", "ground", "body", position_a=end, stiffness=2.0, damping=0.1)
        system = fm.compile(builder.scene())
        y = system.initial_state.y
        counted = count(articulated.rhs, 0.0, y, np.empty_like(y), system.constants, system.workspace())
        return counted.operations.total

    none, one, two, twenty = map(operations, (0, 1, 2, 20))
    assert one > none and twenty - one == 19 * (two - one)


def test_static_friction_is_higher_near_rest():
    scene = slider().linear_friction("guide", "rail", sliding=4.0, static=7.0, stribeck=0.1, smoothing=1e-6).scene()
    system = fm.compile(scene)
    seen = [system.evaluate(0.0, np.zeros(1), np.array([v])) for v in (1e-3, 0.1, 10.0)]
    loads = [float(each.hinge_forces["guide"][0]) for each in seen]
    assert np.allclose(loads, (-7.0, -5.5, -4.0), atol=1e-3)


def test_a_bushing_that_turns_over_ends_the_run():
    builder = fm.SceneBuilder("turning").rigid_body("body", mass=1.0, inertia=(0.1, 0.1, 0.1))
    builder.revolute("hinge", "ground", "body", axis=(0, 0, 1), rate=10.0)
    builder.bushing("mount", "ground", "body", stiffness=0.1 * np.eye(6))
    run = fm.simulate(builder.scene(), 2.0, samples=201)
    assert run.status is fm.Status.CONNECTOR_OVERTURNED
    assert 'bushing "mount"' in run.message and "170 degrees" in run.message
    assert np.radians(165.0) < run.q[-1, 0] < np.radians(171.0)


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 0.7, 1.2, 2.5, 2.9])
def test_a_bushing_s_moment_is_the_derivative_of_its_energy(angle):
    """Along every rotation rate: central differences of the energy against the power of the moment."""
    K = positive(7, 2.0)
    builder = fm.SceneBuilder("ball").rigid_body("body", mass=1.0, inertia=(0.1, 0.2, 0.3))
    builder.free("flight", "ground", "body").bushing("mount", "ground", "body", stiffness=K)
    system, axis = fm.compile(builder.scene()), np.array([0.6, -0.48, 0.64])
    quaternion = np.concatenate([[np.cos(angle / 2.0)], np.sin(angle / 2.0) * axis])
    q = np.concatenate([[0.3, -0.2, 0.1], quaternion])
    load = system.evaluate(0.0, q, np.zeros(6)).connectors["mount"]

    def energy(turn: np.ndarray, step: np.ndarray) -> float:
        half = 0.5 * float(np.linalg.norm(turn))
        left = np.concatenate([[np.cos(half)], np.sin(half) / max(2.0 * half, 1e-300) * turn])
        w, v = left[0], left[1:]
        x, y = quaternion[0], quaternion[1:]
        turned = np.concatenate([[w * x - v @ y], w * y + x * v + np.cross(v, y)])
        return system.evaluate(0.0, np.concatenate([q[:3] + step, turned]), np.zeros(6)).energy["spring"]

    h, none = 1e-5, np.zeros(3)
    for i, e in enumerate(np.eye(3)):
        turning = (energy(h * e, none) - energy(-h * e, none)) / (2.0 * h)
        moving = (energy(none, h * e) - energy(none, -h * e)) / (2.0 * h)
        assert abs(load[i] + turning) <= 1e-8 and abs(load[3 + i] + moving) <= 1e-8


ADAPTIVE = [name for name, integrator in INTEGRATORS.items() if integrator.linearises and not integrator.fixed]
MASS, STIFFNESS, HEIGHT, G = 2.0, 1e6, 0.5, 9.81


def falling() -> fm.Scene:
    """A ball on a vertical rail, over a stop without dissipation."""
    return (
        fm.SceneBuilder("drop", gravity=(0.0, 0.0, -G))
        .rigid_body("ball", mass=MASS, inertia=(1.0, 1.0, 1.0))
        .prismatic("rail", "ground", "ball", axis=(0, 0, 1), position=HEIGHT)
        .linear_spring("floor", "rail", lower=0.0, stop_stiffness=STIFFNESS, stop_dissipation=0.0)
        .scene()
    )


def height(t: float) -> float:
    """Closed form: free fall, and vibration about the depth at which the stop carries the ball, in turns."""
    fall, speed = np.sqrt(2.0 * HEIGHT / G), np.sqrt(2.0 * G * HEIGHT)
    frequency, sag = np.sqrt(STIFFNESS / MASS), G * MASS / STIFFNESS
    contact = (2.0 * np.pi - 2.0 * np.arctan2(speed / frequency, sag)) / frequency
    since = (t - fall) % (2.0 * fall + contact)
    if since < contact:
        return float(sag * (np.cos(frequency * since) - 1.0) - speed / frequency * np.sin(frequency * since))
    return float(speed * (since - contact) - 0.5 * G * (since - contact) ** 2)


@pytest.mark.parametrize("method", ADAPTIVE)
def test_a_ball_leaves_the_stop(method: str) -> None:
    """After two contacts. 200 tolerances had errors of at most 24 rtol; a ball that sticks is 0.1 m off."""
    system = fm.compile(falling())
    for rtol in np.logspace(-3, -8, 100):
        run = fm.simulate(system, 1.0, method, rtol=rtol, atol=1e-2 * rtol, samples=2)
        assert run.finished and abs(run.q[-1, 0] - height(1.0)) < 100.0 * rtol
    assert abs(height(1.0) + 0.0044) > 0.1
