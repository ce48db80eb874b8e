"""Derivatives by dual numbers against differences, and where random trees do not come: springs at rest, time, failures.

On random trees they are those of the recursion (test_derivatives.py), which are held against the dense route's complex
step in tests/flexmb/system/test_derivatives.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

import flexmb
from flexmb.dense import DenseSystem
from flexmb.entry import articulated
from flexmb.entry.tangent import tangent_workspace, time_derivative
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.tables.status import Status
from tests import trees
from tests.bounds import UNIT_ROUNDOFF
from tests.flexmb.entry.dual_jacobian import jacobian

H = 2.0**-100
# The dense route finds bodies of levels linear and stiffened by a complex step, which cannot be nested: differences
# check these.
RECIPES = {"rigid": trees.RIGID, "full": trees.FULL, "ruthless": trees.RUTHLESS, "mixed": trees.MIXED}


@dataclass(frozen=True)
class Linearised:
    """A system at its initial state: y, dy/dt, J, df/dt."""

    system: flexmb.System
    y: np.ndarray
    dy: np.ndarray
    J: np.ndarray
    rate: np.ndarray


def linearised(scene, t: float = 0.0) -> Linearised:
    system = flexmb.compile(scene)
    state = system.initial_state
    y = np.concatenate([state.q, state.u, [0.0]])
    w = tangent_workspace(system.constants, system.nq, system.nu)
    J, rate = np.full((len(y), len(y)), np.nan), np.full(len(y), np.nan)
    assert jacobian(t, y, J, system.constants, w) == Status.OK
    assert time_derivative(t, y, rate, system.constants, w) == Status.OK
    return Linearised(system, y, right_side(system, t, y), J, rate)


def right_side(system: flexmb.System, t: float, y: np.ndarray) -> np.ndarray:
    dy = np.empty_like(y)
    assert articulated.rhs(t, y, dy, system.constants, system.workspace()) == Status.OK
    return dy


def complex_rotation_vector(q: np.ndarray) -> np.ndarray:
    """Of a quaternion with positive scalar part, analytic in its components."""
    s = np.sqrt(np.sum(q[1:] ** 2))
    return 2.0 * np.arctan(s / q[0]) / s * q[1:]


def terms(dense: DenseSystem, q: np.ndarray, u: np.ndarray, rates: np.ndarray) -> list[np.ndarray]:
    """The terms of M rates + c - tau, at complex arguments."""
    tau = np.zeros(dense.nu, complex)
    for x in dense.tree.scalars:
        tau[x.u] = -x.stiffness * q[x.q] - x.damping * u[x.u]
    for member in dense.tree.members:
        if isinstance(member.hinge, flexmb.Spherical):
            theta = complex_rotation_vector(np.sign(q[member.q_hinge][0].real) * q[member.q_hinge])
            tau[member.u_hinge] -= member.hinge.stiffness_Nm_rad * theta
            tau[member.u_hinge] -= member.hinge.damping_Nms_rad * u[member.u_hinge]
    return [dense.mass_matrix(q) @ rates, dense.bias(q, u), -tau]


STEPS = 0.5 ** np.arange(20)


def extrapolated(f, h: float, levels: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Richardson's limit of (f(h) - f(-h)) / 2h, and how far it is from the last but one."""
    table = [[(f(h / 2**i) - f(-h / 2**i)) / (2.0 * h / 2**i)] for i in range(levels)]
    for i in range(1, levels):
        for k in range(1, i + 1):
            table[i].append(table[i][k - 1] + (table[i][k - 1] - table[i - 1][k - 1]) / (4.0**k - 1.0))
    return table[-1][-1], np.abs(table[-1][-1] - table[-1][-2])


def rounding_of_limit(levels: int = 6) -> float:
    """The most by which rounding of f moves the limit, in units of that over the smallest step, h / 2^(levels - 1)."""
    return float(np.sum(np.abs(extrapolated(lambda h: np.where(STEPS[:levels] == abs(h), h, 0.0), 1.0, levels)[0]
                               / STEPS[:levels] * STEPS[levels - 1])))  # fmt: skip


@pytest.mark.parametrize(
    ("recipe", "seed"), [(trees.EVERY_LEVEL, 0), (trees.EVERY_LEVEL, 1), (trees.STIFFENED, 2), (trees.EXACT, 0)]
)
def test_every_level_hinge_and_row_against_differences(recipe, seed):
    """Whole columns, also of qdot and of the work's rate, up to what rounding of the right side leaves of differences.

    A solution rounds as cond(M) u, a rate of a coordinate as few u; the smallest step divides both.
    """
    found, h = linearised(trees.random_scene(seed, recipe)), 1e-2
    system, nq = found.system, found.system.nq
    free = system.constants.speed["prescribed"] < 0
    M = system.mass_matrix(flexmb.State(found.y[:nq], found.y[nq:-1]))[np.ix_(free, free)]
    noise = np.full(len(found.y), np.linalg.cond(M, np.inf) * np.max(np.abs(found.dy)))
    noise[:nq] = 10.0 * max(1.0, np.max(np.abs(found.y)))
    noise *= 2.0 * UNIT_ROUNDOFF / (h / 2**5)
    for j in range(len(found.y)):
        unit = np.eye(len(found.y))[j]
        expected, doubt = extrapolated(lambda h, unit=unit: right_side(system, 0.0, found.y + h * unit), h)
        assert np.all(np.abs(found.J[:, j] - expected) <= 30.0 * doubt + noise), j


def test_what_is_prescribed_does_not_depend_on_the_state():
    found = linearised(trees.random_scene(0, trees.EVERY_LEVEL))
    nq, speed = found.system.nq, found.system.constants.speed
    held = np.flatnonzero(speed["prescribed"] >= 0)
    places = np.concatenate([speed["coordinate"][held], nq + held])
    assert len(held) > 2
    assert not found.J[:, places].any() and not found.J[places].any() and not found.J[:, -1].any()


def test_ball_spring_at_rest():
    """The rotation vector's angle has no derivative there, the vector has: -k / I about each axis."""
    scene = (
        SceneBuilder("ball")
        .rigid_body("bob", mass=2.0, inertia=(0.5, 1.0, 1.25))
        .spherical("joint", "ground", "bob", stiffness=3.0)
        .scene()
    )
    found = linearised(scene)
    expected = np.zeros((3, 4))
    expected[:, 1:] = np.diag([-2.0 * 3.0 / inertia for inertia in (0.5, 1.0, 1.25)])
    np.testing.assert_allclose(found.J[4:7, :4], expected, rtol=4 * UNIT_ROUNDOFF, atol=0.0)


FUNCTIONS = (
    Constant(value=0.4), Ramp(value=0.1, rate=0.7), Sine(amplitude=0.3, angular_frequency_rad_s=2.0, phase_rad=0.3),
    SmoothStep(start_value=0.0, end_value=1.0, start_s=0.0, duration_s=1.0), SpinUp(rate=1.5, duration_s=1.0),
    Pulse(value=2.0, start_s=0.0, duration_s=1.0), Table(times_s=tuple(np.linspace(0.0, 1.0, 9)),
                                                        values=tuple(np.sin(np.linspace(0.0, 3.0, 9)))),
)  # fmt: skip


DRIVES = [(key, f) for key in ("torque", "prescribed") for f in FUNCTIONS if (key, type(f)) != ("prescribed", Pulse)]


@pytest.mark.parametrize(("key", "function"), DRIVES, ids=lambda x: x if isinstance(x, str) else type(x).__name__)
def test_derivative_with_respect_to_time(key, function):
    """Of a double pendulum whose first hinge is driven: differences on one side of every kink of the function."""
    scene = SceneBuilder("driven", gravity=(0.0, -9.81, 0.0))
    for name, parent, drive in (("a", "ground", {key: function}), ("b", "a", {"angle": 0.3, "rate": 0.5})):
        scene.rigid_body(name, mass=1.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
        scene.revolute(f"h{name}", parent, name, parent_position=(1.0, 0.0, 0.0), **drive)
    t = 0.44  # inside one piece of the table
    found = linearised(scene.scene(), t)
    expected, doubt = extrapolated(lambda h: right_side(found.system, t + h, found.y), 0.05)
    assert np.max(np.abs(found.rate - expected)) <= 30.0 * np.max(doubt) + 1e4 * UNIT_ROUNDOFF * 20.0 * 10.0
    assert found.rate.any() or isinstance(function, Constant | Pulse) or (key, type(function)) == ("prescribed", Ramp)


def test_failures_are_status_codes():
    """A massless body, and a deflection beyond all sense."""
    scene = trees.random_scene(0, replace(trees.FULL, bodies=2, carriers=("beam",), wheels=0, point_masses=0))
    system = flexmb.compile(scene)
    n = system.nq + system.nu + 1
    y, J, w = np.zeros(n), np.zeros((n, n)), tangent_workspace(system.constants, system.nq, system.nu)
    y[: system.nq] = system.initial_state.q
    y[system.coordinate("b0.modes")] = 1e6
    assert jacobian(0.0, y, J, system.constants, w) == Status.OUT_OF_RANGE
    assert int(w.fault[0]) == 0
    y[system.coordinate("b0.modes")] = 0.0
    w = tangent_workspace(replace_mass(system, 0.0), system.nq, system.nu)
    assert jacobian(0.0, y, J, replace_mass(system, 0.0), w) == Status.NOT_POSITIVE_DEFINITE


def replace_mass(system: flexmb.System, factor: float):
    """Constants whose modal masses are scaled."""
    return replace(system.constants, mff=factor * system.constants.mff)
