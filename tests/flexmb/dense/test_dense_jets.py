"""Jets are what they say: each part is the derivative of the one before, on every path of the kinematics."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexmb.dense import DenseSystem
from flexmb.dense.body_frames import Motions, member_frames, point_frames
from flexmb.dense.jets import Jet, MovingFrame, constant, profile, rotation_exponential, turn
from flexmb.scene import schema as s
from tests.bounds import UNIT_ROUNDOFF, observed_order
from tests.trees import Recipe, random_scene

STEPS = np.array([4e-3, 2e-3, 1e-3])
FUNCTIONS = [
    s.Constant(value=2.0),
    s.Ramp(value=0.3, rate=1.5, start_s=0.2),
    s.Sine(amplitude=0.7, angular_frequency_rad_s=3.0, phase_rad=0.4, offset=0.1),
    s.SmoothStep(start_value=-0.4, end_value=1.1, start_s=0.1, duration_s=2.0),
    s.SpinUp(rate=4.0, duration_s=2.5),
    s.Table(times_s=tuple(np.linspace(0.0, 3.0, 8)), values=(0.0, 0.4, -0.2, 0.3, 0.9, 0.1, -0.5, 0.2)),
]


def difference_errors(value, rate, scale):
    """|central difference - rate| for STEPS; `value(h)` and its derivative `rate` at 0. Exact ones return no error."""
    errors = np.array([np.max(np.abs((value(h) - value(-h)) / (2.0 * h) - rate)) for h in STEPS])
    floor = 10.0 * UNIT_ROUNDOFF * scale / STEPS[-1]  # rounding of the two values, divided by the step
    return errors, floor


def assert_derivative(value, rate):
    """Central differences converge to `rate` with order 2, or are exact to round-off (polynomials up to degree 2)."""
    errors, floor = difference_errors(value, rate, 1.0 + float(np.max(np.abs(value(0.0)))))
    if errors[0] > floor:
        assert observed_order(STEPS, errors, floor / 10.0) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: type(f).__name__)
def test_profiles(function):
    t = 0.83
    now = profile(function, t)
    assert_derivative(lambda h: profile(function, t + h).value, now.rate)
    assert_derivative(lambda h: profile(function, t + h).rate, now.acceleration)


def test_a_pulse_is_on_and_off():
    pulse = s.Pulse(value=3.0, start_s=1.0, duration_s=0.5)
    assert [float(profile(pulse, t).value) for t in (0.99, 1.0, 1.49, 1.5)] == [0.0, 3.0, 3.0, 0.0]


def test_products_with_constants_are_those_of_jets_whose_derivatives_are_zero():
    """To the bit; what moves is not said to be still. Negative control: a jet that only says so loses its rate."""
    rng = np.random.default_rng(0)
    R, x = (Jet(*rng.normal(size=(3, 4, *shape))) for shape in ((3, 3), (3,)))
    fixed, place = constant(rng.normal(size=(3, 3))), constant(rng.normal(size=3))
    for a, b in ((fixed, x), (R, place), (fixed, place), (-fixed, place + place), (fixed.transpose, x[..., ::-1])):
        found, whole = turn(a, b), turn(replace(a, still=False), replace(b, still=False))
        for part in ("value", "rate", "acceleration"):
            assert np.array_equal(*np.broadcast_arrays(getattr(found, part), getattr(whole, part)))
        assert found.still == (a.still and b.still) and not whole.still
    assert not (place + x).still and not np.array_equal(turn(fixed, replace(x, still=True)).rate, turn(fixed, x).rate)


@pytest.mark.parametrize("length", [0.0, 1e-9, 0.3, 2.0, np.pi])
def test_rotation_exponential_is_the_rotation_of_the_vector(length):
    theta = length * np.array([2.0, -1.0, 2.0]) / 3.0
    found = rotation_exponential(Jet(theta, np.zeros(3), np.zeros(3))).value
    # the largest term of the series is 1, and at most 24 of them are summed
    assert np.max(np.abs(found - Rotation.from_rotvec(theta).as_matrix())) < 24 * 2 * UNIT_ROUNDOFF


def advanced(system, q, u, rates, h):
    """The state a time h later, for speeds u + rates h: quaternions turn by the exponential of their mean angular
    velocity (exact to second order), positions of free hinges by their velocity in turning axes."""
    later, mean = q.copy(), u + 0.5 * h * rates
    for x in system.tree.scalars:
        later[x.q] += h * mean[x.u]
    for member in system.tree.members:
        later[member.q_modes] += h * mean[member.u_modes]
        place, w = member.q_hinge, mean[member.u_hinge][:3]
        if isinstance(member.hinge, s.Spherical | s.Free):
            attitude = Rotation.from_quat(q[place][-4:], scalar_first=True)
            half = attitude * Rotation.from_rotvec(0.5 * h * w)
            later[place.stop - 4 : place.stop] = (attitude * Rotation.from_rotvec(h * w)).as_quat(scalar_first=True)
            if isinstance(member.hinge, s.Free):
                later[place.start : place.start + 3] += h * half.apply(mean[member.u_hinge][3:])
    return later, u + h * rates


@pytest.mark.parametrize("seed", range(3))
def test_every_inertia_point_of_a_random_tree(seed):
    """Positions and rotations of all points against differences along the motion, through all kinds of hinges."""
    system = DenseSystem(random_scene(seed, Recipe(prescribed=False)))
    rng = np.random.default_rng(seed)
    q, u, rates = rng.normal(size=system.nq) * 0.3, rng.normal(size=system.nu), rng.normal(size=system.nu)
    for member in system.tree.members:
        if isinstance(member.hinge, s.Spherical | s.Free):
            place = slice(member.q_hinge.stop - 4, member.q_hinge.stop)
            q[place] /= np.linalg.norm(q[place])

    def frames(h: float) -> MovingFrame:
        later, speeds = advanced(system, q, u, rates, h)
        motion = Motions(later, speeds[None], rates[None])
        return point_frames(system.tree, member_frames(system.tree, motion), motion).first

    now = frames(0.0)
    assert_derivative(lambda h: frames(h).position.value, now.position.rate)
    assert_derivative(lambda h: frames(h).rotation.value, now.rotation.rate)
    assert_derivative(lambda h: frames(h).position.rate, now.position.acceleration)
    assert_derivative(lambda h: frames(h).rotation.rate, now.rotation.acceleration)
    assert_derivative(lambda h: frames(h).angular_velocity(), now.angular_acceleration())
