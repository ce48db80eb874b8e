"""The dense route against equations written out by hand."""

import numpy as np
import pytest

from flexmb.dense import DenseSystem
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.modal_data import inertia_points
from tests.bounds import UNIT_ROUNDOFF, gamma

G = 9.81
# Every number below is a chain of fewer than 100 roundings of terms of the size of the result's largest term.
ROUNDINGS = 100


def same(found, expected, scale=None):
    """Equal within ROUNDINGS of the largest entry, or of `scale` where larger terms cancel."""
    found, expected = np.asarray(found), np.asarray(expected)
    return np.max(np.abs(found - expected)) <= gamma(ROUNDINGS) * (np.max(np.abs(expected)) if scale is None else scale)


def test_double_pendulum():
    """Two point masses on massless rods, angles from the downward vertical relative to each other."""
    m1, m2, l1, l2 = 1.3, 0.7, 0.9, 1.1
    scene = (
        SceneBuilder("double pendulum", gravity=(0.0, -G, 0.0))
        .rigid_body("a", mass=m1, com=(0.0, -l1, 0.0), inertia=(0, 0, 0), nodes={"end": (0.0, -l1, 0.0)})
        .rigid_body("b", mass=m2, com=(0.0, -l2, 0.0), inertia=(0, 0, 0))
        .revolute("shoulder", "ground", "a")
        .revolute("elbow", "a", "b", parent_node="end")
        .scene()
    )
    q, u = np.array([0.4, -0.9]), np.array([1.2, 2.1])
    c, sn = np.cos(q[1]), np.sin(q[1])
    M = [[m1 * l1**2 + m2 * (l1**2 + l2**2 + 2 * l1 * l2 * c), m2 * (l2**2 + l1 * l2 * c)],
         [m2 * (l2**2 + l1 * l2 * c), m2 * l2**2]]  # fmt: skip
    outer = m2 * G * l2 * np.sin(q[0] + q[1])
    bias = [-m2 * l1 * l2 * sn * (2 * u[0] * u[1] + u[1] ** 2) + (m1 + m2) * G * l1 * np.sin(q[0]) + outer,
            m2 * l1 * l2 * sn * u[0] ** 2 + outer]  # fmt: skip
    system = DenseSystem(scene)
    assert same(system.mass_matrix(q), M)
    assert same(system.bias(q, u), bias)
    rates = np.linalg.solve(M, -np.array(bias))
    assert same(system.accelerations(0.0, q, u), rates)
    # load across the elbow: what the outer mass needs, from its acceleration in polar form
    angle, spin, accel = q[0] + q[1], u[0] + u[1], rates[0] + rates[1]

    def polar(length, phi, w, alpha):
        along, across = np.array([np.sin(phi), -np.cos(phi), 0.0]), np.array([np.cos(phi), np.sin(phi), 0.0])
        return length * (alpha * across - w**2 * along)

    a = polar(l1, q[0], u[0], rates[0]) + polar(l2, angle, spin, accel)
    load = system.hinge_loads(0.0, q, u, rates)["elbow"]
    assert same(load[3:], m2 * (a + [0.0, G, 0.0]))
    # the elbow carries no torque: round-off of force times rod length
    assert np.max(np.abs(load[:3])) <= gamma(ROUNDINGS) * m2 * l2 * np.linalg.norm(a + [0.0, G, 0.0])


def test_heavy_top():
    """Euler's equations in body axes for a body on a spherical hinge, and the force that holds its tip."""
    mass, J0, com = 2.0, np.diag([0.05, 0.05, 0.02]), np.array([0.0, 0.0, 0.4])
    scene = (
        SceneBuilder("top", gravity=(0.0, 0.0, -G))
        .rigid_body("top", mass=mass, com=com, inertia=J0)
        .spherical("tip", "ground", "top")
        .scene()
    )
    q, w = np.array([np.cos(0.3), np.sin(0.3), 0.0, 0.0]), np.array([0.4, -0.7, 60.0])
    R = np.array([[1, 0, 0], [0, np.cos(0.6), -np.sin(0.6)], [0, np.sin(0.6), np.cos(0.6)]])
    J = J0 + mass * (com @ com * np.eye(3) - np.outer(com, com))
    g = R.T @ [0.0, 0.0, -G]
    rates = np.linalg.solve(J, np.cross(com, mass * g) - np.cross(w, J @ w))
    system = DenseSystem(scene)
    assert same(system.mass_matrix(q), J)
    assert same(system.bias(q, w), np.cross(w, J @ w) - np.cross(com, mass * g))
    assert same(system.accelerations(0.0, q, w), rates)
    force = mass * (np.cross(rates, com) + np.cross(w, np.cross(w, com)) - g)
    assert same(system.hinge_loads(0.0, q, w, rates)["tip"][3:], R @ force)
    assert system.energy(q, w)["kinetic"] == pytest.approx(0.5 * w @ J @ w, rel=gamma(ROUNDINGS))
    assert same(system.momentum(q, w)[:3], R @ J @ w)


@pytest.mark.parametrize("level", ["full", "ruthless"])
def test_pendulum_with_one_mode(level):
    """Masses on a line that a mode moves sideways: the hub turns, the beam bends; spin softens `full`."""
    m, x, phi, k, d = np.array([0.5, 0.4, 0.3]), np.array([0.3, 0.8, 1.4]), np.array([0.1, 0.5, 1.2]), 30.0, 0.2
    zero = np.zeros_like(x)
    points = inertia_points(m, np.stack([x, zero, zero], axis=1), np.stack([zero, phi, zero], axis=1)[:, :, None])
    scene = (
        SceneBuilder("bending pendulum", gravity=(0.0, -G, 0.0))
        .modal_body("beam", points=points, stiffness=[[k]], damping=[[d]], level=level)
        .revolute("hinge", "ground", "beam")
        .scene()
    )
    q, u = np.array([0.6, 0.15]), np.array([1.7, -0.8])
    theta, (w, v), eta = q[0], u, q[1]
    s2, sx, s1 = m @ phi**2, m @ (x * phi), m @ phi
    seen, rate = (eta, v) if level == "full" else (0.0, 0.0)
    M = [[m @ x**2 + seen**2 * s2, sx], [sx, s2]]
    weight = G * ((m @ x) * np.cos(theta) - seen * s1 * np.sin(theta))
    bias = [2 * seen * rate * w * s2 + weight, -(w**2) * seen * s2 + k * eta + d * v + G * s1 * np.cos(theta)]
    system = DenseSystem(scene)
    assert same(system.mass_matrix(q), M)
    assert same(system.bias(q, u), bias)
    assert system.energy(q, u)["strain"] == pytest.approx(0.5 * k * eta**2, rel=gamma(ROUNDINGS))
    assert system.energy(q, u)["kinetic"] == pytest.approx(0.5 * u @ M @ u, rel=gamma(ROUNDINGS))


def test_gyrostat():
    """A free body with a wheel: J dw/dt + w x (J w + h) = -dh/dt, and the wheel turns by its torque."""
    J, axial, torque, spin = np.diag([3.0, 2.0, 1.5]), 0.2, 0.05, 40.0
    scene = (
        SceneBuilder("gyrostat")
        .rigid_body("hub", mass=5.0, inertia=J)
        .free("base", "ground", "hub")
        .wheel("wheel", "hub", axis=(0, 0, 1), mass=0.5, axial_inertia=axial, transverse_inertia=0.12,
               torque=s.Constant(value=torque))
        .scene()
    )  # fmt: skip
    w = np.array([0.3, -0.2, 0.1])
    q, u = np.array([0, 0, 0, 1.0, 0, 0, 0, 0.7]), np.array([*w, 0, 0, 0, spin])
    total = J + np.diag([0.12, 0.12, axial])
    h = axial * spin * np.array([0.0, 0.0, 1.0])
    # about the axis of spin the wheel is driven by its torque alone: take its axial inertia out of the body's row
    right = -np.cross(w, total @ w + h) - [0.0, 0.0, torque]
    expected = right / np.array([total[0, 0], total[1, 1], J[2, 2]])
    system = DenseSystem(scene)
    rates = system.accelerations(0.0, q, u)
    # Euler's equations of the wheel by itself have products w_i J w_j of the size of axial spin^2, which cancel
    assert same(rates[:3], expected, axial * spin**2 / J[2, 2])
    assert same(rates[6], torque / axial - expected[2], spin**2)
    bearing = system.wheel_loads(0.0, q, u, rates)["wheel"]
    wheel = np.diag([0.12, 0.12, axial])
    assert same(
        bearing[:3], wheel @ (expected + [0, 0, rates[6]]) + np.cross(w, wheel @ (w + [0, 0, spin])), axial * spin**2
    )
    assert np.max(np.abs(system.hinge_loads(0.0, q, u, rates)["base"])) <= gamma(ROUNDINGS) * axial * spin**2


def test_prescribed_hinge_needs_the_torque_of_its_acceleration():
    J, amplitude, omega = 0.3, 0.8, 2.0
    scene = (
        SceneBuilder("driven wheel")
        .rigid_body("disc", mass=1.0, inertia=(J, J, J))
        .revolute("drive", "ground", "disc", damping=0.1,
                  prescribed=s.Sine(amplitude=amplitude, angular_frequency_rad_s=omega))
        .scene()
    )  # fmt: skip
    system, t = DenseSystem(scene), 0.4
    q, u = np.zeros(1), np.zeros(1)
    rates = system.accelerations(t, q, u)
    expected = -amplitude * omega**2 * np.sin(omega * t)
    assert rates[0] == pytest.approx(expected, rel=8 * UNIT_ROUNDOFF)
    drive = J * expected + 0.1 * amplitude * omega * np.cos(omega * t)
    assert system.drives(t, q, u, rates)["drive"][0] == pytest.approx(drive, rel=gamma(ROUNDINGS))
