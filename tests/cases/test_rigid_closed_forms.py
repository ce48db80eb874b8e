"""Closed forms of the rigid cases against the textbook's equations of motion, integrated here by SciPy; integrals of
motion and published equations against the stored references."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from crosscheck.library.find import load_case
from crosscheck.library.reference import load_reference
from crosscheck.references.tops import ACROSS, ALONG, HEIGHT, MARKERS, MASS
from flexmb.typing import Real
from tests.cases.shipped import CASES, closed_form

G = 9.81
RTOL = 1e-12
# A thousand steps of this tolerance each, and no motion here multiplies errors: but for the falling top, see there.
WITHIN = 1e-9

# Closed forms of flexible bodies leave something out and are tested by themselves.
EXACT = sorted(
    path.parent.relative_to(CASES).as_posix()
    for path in CASES.glob("*/*/exact.py")
    if "flexible" not in load_case(path.parent).run.tags
)


def integrate(rate: Callable[[float, Real], Real], start: Real, times: Real) -> Real:
    """States (T, n) at `times`."""
    run = solve_ivp(rate, (0.0, times[-1]), start, "DOP853", times, rtol=RTOL, atol=1e-13)
    assert run.success
    return run.y.T


def off(ours: Real, theirs: Real) -> float:
    """The largest distance relative to the largest value."""
    return float(np.max(np.abs(ours - theirs)) / np.max(np.abs(theirs)))


@pytest.mark.parametrize("case", EXACT)
def test_velocities_are_the_rates_of_positions(case: str) -> None:
    """By central differences, whose error is of order 4, at spacings of 0.3 ms: a fast top turns by 0.04 in one. Of
    shorter runs times and spacings are shorter in proportion."""
    module, shorter = closed_form(case), min(1.0, load_case(CASES / case).run.duration_s / 1.6)
    times, step = np.linspace(0.3, 1.5, 7) * shorter, 3e-4 * shorter
    grid = np.concatenate([[0.0], np.sort(np.concatenate([times + k * step for k in (-2, -1, 0, 1, 2)]))])
    channels = module.exact(grid)
    for name in (name for name in channels if name.endswith(".position")):
        rows = channels[name][1:].reshape(len(times), 5, 3)
        rate = (rows[:, 0] - 8.0 * rows[:, 1] + 8.0 * rows[:, 3] - rows[:, 4]) / (12.0 * step)
        velocity = channels[name.replace("position", "velocity")][1:].reshape(len(times), 5, 3)[:, 2]
        assert off(rate, velocity) < 1e-5, name


@pytest.mark.parametrize("case", EXACT)
def test_the_stored_reference_is_the_closed_form(case: str) -> None:
    stored = load_reference(CASES / case)
    for name, values in closed_form(case).exact(stored.times).items():
        known = stored.knowledge.channels[name]
        distance = np.max(np.abs(values.reshape(len(stored.times), -1) - stored.channels[name]))
        assert distance <= known.uncertainty, name


def test_the_simple_pendulum() -> None:
    times = np.linspace(0.0, 10.0, 21)
    angle = integrate(lambda t, y: np.array([y[1], -G * np.sin(y[0])]), np.array([-0.5 * np.pi, 0.0]), times)[:, 0]
    found = closed_form("pendulums/point_mass").exact(times)["marker:tip.position"]
    assert off(found[:, :2], np.stack([np.sin(angle), -np.cos(angle)], axis=1)) < WITHIN


def test_the_compound_pendulum() -> None:
    """The moment of gravity about the axis, at the turned mass centre, by vectors."""
    m = closed_form("pendulums/compound")
    axis = m.MOUNTING.apply(m.AXIS)
    inertia = m.AXIS @ m.INERTIA @ m.AXIS + m.MASS * np.sum(np.cross(m.AXIS, m.COM) ** 2)

    def rate(t: float, y: Real) -> Real:
        com = Rotation.from_rotvec(y[0] * axis).apply(m.MOUNTING.apply(m.COM))
        return np.array([y[1], axis @ np.cross(com, m.MASS * m.GRAVITY) / inertia])

    times = np.linspace(0.0, 6.0, 13)
    angle = integrate(rate, np.array([m.ANGLE, m.RATE]), times)[:, 0]
    corner = Rotation.from_rotvec(angle[:, None] * axis).apply(m.MOUNTING.apply(m.CORNER)) + m.PIVOT
    assert off(m.exact(times)["marker:corner.position"], corner) < WITHIN


def test_the_geared_pendulum() -> None:
    """The rotor is a body of its own about the shaft, whose gear turns it by the ratio: Lagrange's equation.

    The load on the arm is its rate of momentum less its weight, by differences of the closed form's own momentum.
    """
    m = closed_form("pendulums/geared")
    of_arm = m.AXIS @ m.INERTIA @ m.AXIS + m.MASS * np.sum(np.cross(m.AXIS, m.COM) ** 2)

    def rate(t: float, y: Real) -> Real:
        com = Rotation.from_rotvec(y[0] * m.AXIS).apply(m.COM)
        moment = m.AXIS @ np.cross(com, m.MASS * m.GRAVITY)
        return np.array([y[1], moment / (of_arm + m.ROTOR * m.RATIO**2)])

    times = np.linspace(0.0, 6.0, 13)
    angle, speed = integrate(rate, np.array([m.ANGLE, m.RATE]), times).T
    found = m.exact(times)
    tip = Rotation.from_rotvec(angle[:, None] * m.AXIS).apply(m.TIP) + m.PIVOT
    assert off(found["marker:tip.position"], tip) < WITHIN
    rotor_speed = m.RATIO * speed
    assert off(found["energy.kinetic"], 0.5 * of_arm * speed**2 + 0.5 * m.ROTOR * rotor_speed**2) < WITHIN
    h = 1e-4
    later, before = m.exact(times + h), m.exact(times - h)
    com = Rotation.from_rotvec(angle[:, None] * m.AXIS).apply(m.COM)
    rate_of_momentum = (later["momentum.angular"] - before["momentum.angular"]) / (2.0 * h)
    weight = np.cross(m.PIVOT + com, m.MASS * m.GRAVITY)
    load = found["load:shaft.torque"] + np.cross(m.PIVOT, found["load:shaft.force"])
    assert off(load, rate_of_momentum - weight) < 1e-6  # differences of second order


def turning(inertia: Real, rotor: Real, weight: Real, start: Rotation, omega: Real, times: Real) -> Rotation:
    """Attitudes of a body about a fixed point or its mass centre: Euler's equations with a rotor's momentum.

    `weight` is mass times mass centre, body axes; gravity is along -z.
    """

    def rate(t: float, y: Real) -> Real:
        x, s, w = y[:3], y[3], y[4:]
        up = 2.0 * (x[2] * x - s * np.array([x[1], -x[0], 0.0])) + (2.0 * s**2 - 1.0) * np.array([0.0, 0.0, 1.0])
        moment = np.cross(up, G * weight) - np.cross(w, inertia * w + rotor)
        return np.concatenate([0.5 * (s * w + np.cross(x, w)), [-0.5 * x @ w], moment / inertia])

    states = integrate(rate, np.concatenate([start.as_quat(), omega]), times)
    return Rotation.from_quat(states[:, :4])


@pytest.mark.parametrize(
    ("case", "within"),
    # near the upright position errors grow by exp(k t), k^2 = m g l/I1 - (I3 w/2 I1)^2 = (5 /s)^2: by 12 in 0.5 s
    [("lagrange", WITHIN), ("sleeping", WITHIN), ("falling_top", 12 * WITHIN)],
)
def test_heavy_tops(case: str, within: float) -> None:
    top, times = closed_form(f"tops/{case}").TOP, np.linspace(0.0, 0.5, 6)
    inertia, start = np.array([ACROSS, ACROSS, ALONG]), Rotation.from_rotvec([top.lean, 0.0, 0.0])
    attitudes = turning(
        inertia, np.zeros(3), np.array([0.0, 0.0, MASS * HEIGHT]), start, np.array([0.0, 0.0, top.spin]), times
    )
    found = top.exact(times)
    for name, point in MARKERS.items():
        assert off(found[f"marker:{name}.position"], attitudes.apply(point)) < within


def test_the_free_body() -> None:
    m, times = closed_form("tops/free_body"), np.linspace(0.0, 9.0, 10)
    start = Rotation.from_euler("XZ", [np.arctan2(m.I1 * m.W1, m.I3 * m.W3), 0.5 * np.pi])
    inertia = np.array([m.I1, m.I2, m.I3])
    attitudes = turning(inertia, np.zeros(3), np.zeros(3), start, np.array([m.W1, 0.0, m.W3]), times)
    assert off(m.exact(times)["marker:corner.position"], attitudes.apply(m.CORNER)) < WITHIN


def test_the_gyrostat() -> None:
    m, times = closed_form("tops/gyrostat"), np.linspace(0.0, 6.0, 11)
    across, rotor = m.ACROSS + m.TRANSVERSE, m.AXIAL * (m.RATE_ALONG + m.SPEED)
    lean = np.arctan2(across * m.RATE_ACROSS, m.ALONG * m.RATE_ALONG + rotor)
    attitudes = turning(
        np.array([across, across, m.ALONG]), np.array([0.0, 0.0, rotor]), np.zeros(3),
        Rotation.from_euler("XZ", [lean, 0.5 * np.pi]), np.array([m.RATE_ACROSS, 0.0, m.RATE_ALONG]), times,
    )  # fmt: skip
    assert off(m.exact(times)["marker:sensor.position"], attitudes.apply(m.SENSOR)) < WITHIN


def test_foucault() -> None:
    m, times = closed_form("pendulums/foucault"), np.linspace(0.0, 20.0, 21)

    def rate(t: float, y: Real) -> Real:
        """In the table's axes, with Coriolis and centrifugal terms."""
        (x, u), W = (y[:2], y[2:]), m.TURNING
        coriolis = 2.0 * W * np.array([u[1], -u[0]])
        stretch = x - np.array([m.CENTRE.real, m.CENTRE.imag])
        return np.concatenate([u, coriolis + W**2 * x - m.STIFFNESS / m.MASS * stretch])

    start = m.CENTRE + m.RELEASE
    states = integrate(rate, np.array([start.real, start.imag, 0.0, 0.0]), times)
    z = (states[:, 0] + 1j * states[:, 1] + m.MARKER) * np.exp(1j * m.TURNING * times)
    found = m.exact(times)["marker:tip.position"]
    assert off(found[:, :2], np.stack([z.real, z.imag], axis=1)) < WITHIN


def test_the_oscillator() -> None:
    m, times = closed_form("sliders/oscillator"), np.linspace(0.0, 10.0, 21)
    axis = m.MOUNTING.apply(m.AXIS)

    def rate(t: float, y: Real) -> Real:
        force = m.FORCE * np.sin(m.FREQUENCY * t + m.PHASE) - m.STIFFNESS * (y[0] - m.REST) - m.DAMPING * y[1]
        return np.array([y[1], force / m.MASS + m.GRAVITY @ axis])

    place = integrate(rate, np.array([m.START, m.RATE]), times)[:, :1]
    assert off(m.exact(times)["marker:mark.position"], m.ORIGIN + place * axis + m.MOUNTING.apply(m.MARK)) < WITHIN


def test_wheels_take_what_bodies_lose() -> None:
    """Motor and friction as torques on two inertias; only the couple changes the sum."""
    m, times = closed_form("wheels/desaturation"), np.linspace(0.0, 12.0, 13)

    def rate(t: float, y: Real) -> Real:
        drag = m.FRICTION * (y[1] - y[0])
        return np.array([(drag + m.COUPLE) / m.BUS, -drag / m.WHEEL])

    states = integrate(rate, np.array([m.RATE, m.RATE + m.SPEED]), times)
    assert off(m.exact(times)["marker:antenna.angular_velocity"][:, 2], states[:, 0]) < WITHIN
    spun = closed_form("wheels/spin_up").exact(times)
    wheel = spun["wheel_load:wheel.torque"][:, 2]
    bus = 2.5 + 20.0 * 0.05**2 + 4.0 * 0.25**2
    path = integrate(lambda t, y: np.array([-0.3 * (1.0 - np.cos(1.2 * t)) / bus]), np.array([0.2]), times)[:, 0]
    assert off(spun["marker:antenna.angular_velocity"][:, 2], path) < WITHIN
    assert off(wheel, 0.3 * (1.0 - np.cos(1.2 * times))) < WITHIN


def test_drives_do_the_work() -> None:
    """The power of the drives, less the weight's, is the rate of the kinetic energy (differences of order 4)."""
    times = np.linspace(0.0, 5.0, 5001)
    m = closed_form("manipulators/two_joints")
    found = m.exact(times)
    (q1, v1, _), (q2, v2, _) = (m.motion(times, *sine) for sine in m.SINES)
    power = found["drive:shoulder"] * v1 + found["drive:elbow"] * v2
    h = times[1]
    energy = found["energy.kinetic"] + G * (3.0 * 0.3 * np.sin(q1) + 2.0 * (0.6 * np.sin(q1) + 0.25 * np.sin(q1 + q2)))
    rate = (energy[:-4] - 8.0 * energy[1:-3] + 8.0 * energy[3:-1] - energy[4:]) / (12.0 * h)
    assert off(power[2:-2], rate) < 1e-8


def test_kovalevskayas_integral_is_constant() -> None:
    """|(p + i q)^2 - c (g1 + i g2)|^2 with body axis 3 the axis of symmetry, g the direction up; and it is sharp."""
    stored = load_reference(CASES / "tops" / "kovalevskaya")
    attitude = Rotation.from_quat(stored.channels["marker:apex.orientation"][:, [1, 2, 3, 0]])
    p, q, _ = attitude.inv().apply(stored.channels["marker:apex.angular_velocity"]).T
    up = attitude.inv().apply([0.0, 0.0, 1.0]).T

    def integral(c: float) -> Real:
        return np.abs((p + 1j * q) ** 2 - c * (up[0] + 1j * up[1])) ** 2

    c = -1.0 * G * 0.3 / 0.2
    kept = min((np.ptp(integral(each)) / np.max(integral(each)), each) for each in (c, -c))
    assert kept[0] < 1e-9
    assert np.ptp(integral(1.01 * kept[1])) > 1e-3 * np.max(integral(kept[1]))


def test_the_bar_and_plate_obeys_the_textbook() -> None:
    """The two equations of the 'babyboot', until 6 s: later its chaos outgrows what two integrators can share."""
    stored = load_reference(CASES / "pendulums" / "bar_and_plate")
    times = stored.times[stored.times <= 6.0]
    Ax, Bx, By, Bz, mA, mB, LA, LB = 5e-6, 2.5e-4, 5e-5, 2e-4, 0.01, 0.1, 0.075, 0.2

    def rate(t: float, y: Real) -> Real:
        a, b, va, vb = y
        across = Ax + mA * LA**2 + mB * LB**2 + Bx * np.cos(b) ** 2 + By * np.sin(b) ** 2
        mixed = (Bx - By) * np.sin(b) * np.cos(b)
        return np.array([va, vb, (2.0 * mixed * va * vb - (mA * LA + mB * LB) * G * np.sin(a)) / across,
                         -mixed * va**2 / Bz])  # fmt: skip

    states = integrate(rate, np.array([0.5 * np.pi, np.deg2rad(1.0), 0.0, 0.0]), times)
    a, b = states[:, 0], states[:, 1]
    zero = np.zeros_like(a)
    end = LB * np.stack([zero, np.sin(a), -np.cos(a)], axis=1)
    edge = np.stack([np.cos(b), np.cos(a) * np.sin(b), np.sin(a) * np.sin(b)], axis=1)
    assert off(stored.channels["marker:edge.position"][: len(times)], end + 0.05 * edge) < 1e-6
