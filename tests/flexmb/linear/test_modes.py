"""Eigenvalues of linear models against closed forms and against the modal data they are made from."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh, expm
from scipy.spatial.transform import Rotation

import flexmb as fm
from flexmb.entry import articulated
from flexmb.scene.shapes import beam_section
from tests.bounds import UNIT_ROUNDOFF, observed_order

ROUNDING = 2.0**10 * UNIT_ROUNDOFF  # of some hundred operations, each on numbers of the size of the result
G = 9.81


def section(flat: float = 1.0):
    return beam_section(E=7e10, G=2.7e10, A=1e-3, Iy=2e-7 * flat, Iz=1e-7, rho=2700.0)


def frequencies(model: fm.LinearModel) -> np.ndarray:
    return np.array([mode.frequency_rad_s for mode in model.modes if mode.frequency_rad_s > 0.0])


def pendulum(**hinge) -> fm.Scene:
    return (
        fm.SceneBuilder("pendulum", gravity=(G, 0.0, 0.0))
        .rigid_body("bob", mass=2.0, com=(0.7, 0.0, 0.0), inertia=(0.05, 0.05, 0.05))
        .revolute("pivot", "ground", "bob", **hinge)
        .marker("centre", "bob", offset=(0.7, 0.0, 0.0))
        .scene()
    )


def test_damped_pendulum():
    """lambda^2 + 2 zeta w0 lambda + w0^2 = 0, by names: one displacement, one speed, one input."""
    k, d, inertia = 3.0, 0.8, 0.05 + 2.0 * 0.7**2
    model = fm.linearize(pendulum(stiffness=k, damping=d))
    w0 = np.sqrt((k + 2.0 * G * 0.7) / inertia)
    (mode,) = model.modes
    assert mode.natural_rad_s == pytest.approx(w0, rel=ROUNDING)
    assert mode.damping_ratio == pytest.approx(d / (2.0 * inertia * w0), rel=ROUNDING)
    assert mode.frequency_hz == pytest.approx(w0 * np.sqrt(1.0 - mode.damping_ratio**2) / (2.0 * np.pi), rel=ROUNDING)
    assert [name for name, _ in model.states] == ["pivot.rotation", "pivot.rotation.rate"]
    assert model.inputs == (("pivot.rotation", "N m"),)
    assert model.stability.verdict == "asymptotically stable"
    assert not model.rates.any()


@pytest.mark.parametrize("level", ["ruthless", "linear", "full", "stiffened"])
def test_clamped_beam_has_its_modal_frequencies(level):
    """Those of its own K and M to rounding, and (beta L)^2 sqrt(EI / rho A L^4) as far as 16 elements know them."""
    scene = (
        fm.SceneBuilder("cantilever")
        .beam("beam", length=8.0, elements=16, section=section(), modes=6, level=level, points="line")
        .weld("clamp", "ground", "beam")
        .scene()
    )
    system = fm.compile(scene)
    found = frequencies(fm.linearize(system))
    c, n = system.constants, system.constants.body["modes"][0]
    expected = np.sqrt(eigh(c.stiffness[0, :n, :n], c.mff[0, :n, :n], eigvals_only=True))
    np.testing.assert_allclose(found, expected, rtol=ROUNDING * expected[-1] / expected[0])
    exact = 1.875104069**2 * np.sqrt(7e10 * 1e-7 / (2.7 * 8.0**4))
    assert found[0] == pytest.approx(exact, rel=1e-5)


@pytest.mark.parametrize("axis", range(3))
def test_free_asymmetric_body_about_its_axes(axis):
    """+- Omega sqrt((I_a - I_c)(I_c - I_b) / (I_a I_b)): real about the intermediate axis only; in turning axes a
    displacement turns with -Omega."""
    I, Omega = np.array([1.5, 2.0, 3.0]), 1.3
    spin = Omega * np.eye(3)[axis]
    scene = fm.SceneBuilder("top").rigid_body("body", mass=2.0, inertia=tuple(I))
    model = fm.linearize(scene.free("fly", "ground", "body", angular_velocity=spin).scene())
    a, b = (i for i in range(3) if i != axis)
    square = Omega**2 * (I[a] - I[axis]) * (I[axis] - I[b]) / (I[a] * I[b])
    root = np.emath.sqrt(square)
    assert len(model.eigenvalues) == 12  # 6 displacements, no quaternion's norm
    assert np.min(np.abs(model.eigenvalues - root)) < 1e-14
    others = {round(abs(x.imag), 5) for x in model.eigenvalues if abs(x - root) > 1e-6 and abs(x + root) > 1e-6}
    assert others == {0.0, Omega}
    assert model.stability.verdict == ("unstable" if axis == 1 else "neutral")
    assert not model.rates.any()


def test_spherical_pendulum_is_two_plane_ones():
    """A rotation vector stands for the quaternion: three displacements, one of them without a frequency."""
    scene = (
        fm.SceneBuilder("spherical", gravity=(G, 0.0, 0.0))
        .rigid_body("bob", mass=2.0, com=(0.7, 0.0, 0.0), inertia=(0.03, 0.04, 0.05))
        .spherical("pivot", "ground", "bob", stiffness=0.0)
        .scene()
    )
    model = fm.linearize(scene)
    assert model.displacements == ("pivot.rotation.x", "pivot.rotation.y", "pivot.rotation.z")
    expected = sorted(np.sqrt(2.0 * G * 0.7 / (I + 2.0 * 0.7**2)) for I in (0.04, 0.05))
    np.testing.assert_allclose(frequencies(model), expected, rtol=ROUNDING)


def test_flow_of_a_free_flying_spinner():
    """exp(A T) x0 against two runs whose starts differ by eps x0: what is left of the difference is of order eps^2.

    A free body with a wheel and a swinging arm screws along its axis: a relative equilibrium, hence constant A, in axes
    that turn and move.
    """
    scene = (
        fm.SceneBuilder("screw")
        .rigid_body("bus", mass=3.0, inertia=(2.0, 2.0, 1.5))
        .free("fly", "ground", "bus", position=(0.3, 0.1, -0.2), angular_velocity=(0.0, 0.0, 1.1), velocity=(0, 0, 0.7))
        .wheel("w", "bus", axis=(0, 0, 1), mass=0.0, axial_inertia=0.1, transverse_inertia=0.05, speed=5.0)
        .rigid_body("arm", mass=0.5, com=(0.0, 0.0, 0.2), inertia=(0.02, 0.02, 0.02))
        .spherical("ball", "bus", "arm", parent_position=(0.0, 0.0, 0.4), stiffness=0.8)
        .scene()
    )
    system = fm.compile(scene)
    model, start = fm.linearize(system), system.initial_state
    assert not model.rates.any() and not model.drift.any()
    x0, T, n = np.random.default_rng(5).normal(size=len(model.A)), 1.5, len(model.rates)
    expected = expm(T * model.A) @ x0
    sizes, errors = np.array([4e-2, 2e-2, 1e-2, 5e-3]), []
    base = ends(system, start, T)
    for size in sizes:
        y = np.concatenate([start.q + size * model.motion @ x0[:n], start.u + size * x0[n:], [0.0]])
        system.project(0.0, y, system.constants)
        moved = ends(system, fm.State(y[: system.nq], y[system.nq : -1]), T)
        found = np.concatenate([displacement(system, base[0], moved[0]), moved[1] - base[1]])
        errors.append(np.max(np.abs(found - size * expected)))
    assert observed_order(sizes, errors, 1e-10) == pytest.approx(2.0, abs=0.1)


def ends(system: fm.System, start: fm.State, T: float) -> tuple[np.ndarray, np.ndarray]:
    """q and u after a time T."""
    nq, w = system.nq, system.workspace()

    def rhs(t, y):
        dy = np.empty(len(y) + 1)
        assert articulated.rhs(t, np.append(y, 0.0), dy, system.constants, w) == 0
        return dy[:-1]

    y = solve_ivp(rhs, (0.0, T), np.concatenate([start.q, start.u]), "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return y[:nq], y[nq:]


def displacement(system: fm.System, q0: np.ndarray, q: np.ndarray) -> np.ndarray:
    """xi from q0 to q: rotation vectors R0'R, positions in the axes of q0."""
    out = np.zeros(system.nu)
    free, ball, wheel = (system.speed(name) for name in ("fly", "ball", "w"))
    at = system.coordinate("fly").start
    R0 = Rotation.from_quat(q0[at + 3 : at + 7], scalar_first=True)
    out[free] = np.concatenate([turned(q0, q, at + 3), R0.apply(q[at : at + 3] - q0[at : at + 3], inverse=True)])
    out[ball] = turned(q0, q, system.coordinate("ball").start)
    out[wheel] = (q - q0)[system.coordinate("w")]
    return out


def turned(q0: np.ndarray, q: np.ndarray, at: int) -> np.ndarray:
    R0, R = (Rotation.from_quat(x[at : at + 4], scalar_first=True) for x in (q0, q))
    return (R0.inv() * R).as_rotvec()
