"""Each connector by itself: load, power and their exact derivatives, against its formula by a complex step.

One body on one hinge, so that a formula of the coordinate x and its rate v is all there is: inertia v' = Q(x, v).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

import flexmb as fm
from flexmb.entry import articulated
from flexmb.entry.tangent import tangent_workspace
from flexmb.scene import schema as s
from tests.bounds import UNIT_ROUNDOFF
from tests.flexmb.connectors.connected_scenes import positive
from tests.flexmb.entry.dual_jacobian import jacobian
from tests.flexmb.entry.test_tangent import complex_rotation_vector

H = 2.0**-100
DIGITS = 2.0**8 * UNIT_ROUNDOFF  # of a rotation, a length and a law; their derivatives are as many operations again
AXIS, INERTIA, MASS = np.array([0.36, 0.48, 0.8]), 0.7, 2.0
A, B = np.array([0.5, -0.2, 0.4]), np.array([0.3, 0.1, -0.2])  # ends in World, and on the body
HALF = np.array([0.6, 0.0, 0.8, 0.0])  # a quaternion
STIFF, LOSSY = positive(1, 3.0), positive(2, 0.4)

Formula = Callable[[Any, Any], tuple[Any, Any]]
"""Of x and v, which may be complex: the generalised load, and the power of what is not elastic."""


class Alone(NamedTuple):
    """A scene of one coordinate with one connector, the coordinate's inertia and start, and the connector's formula."""

    scene: s.Scene
    inertia: float
    x: float
    v: float
    formula: Formula


def skew(x: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])


def turned(x: Any, r: np.ndarray) -> np.ndarray:
    """r (3,) turned by x about AXIS."""
    return r + np.sin(x) * np.cross(AXIS, r) + (1.0 - np.cos(x)) * np.cross(AXIS, np.cross(AXIS, r))


def body(**inertia: Any) -> fm.SceneBuilder:
    return fm.SceneBuilder("alone").rigid_body("body", mass=MASS, inertia=(INERTIA,) * 3, **inertia)


def turning(x: float, v: float) -> fm.SceneBuilder:
    return body().revolute("hinge", "ground", "body", axis=AXIS, angle=x, rate=v)


def line(x: float, v: float, load: Callable[[Any], Any], damping: float = 0.0, push: float = 0.0, **law: Any) -> Alone:
    """Between A in World and B on the body; `load` of the length is what the spring pulls with."""
    if damping:
        law["damping"] = damping
    if push:
        law["force"] = s.Constant(value=push)

    def formula(x: Any, v: Any) -> tuple[Any, Any]:
        d = turned(x, B) - A
        length = np.sqrt(d @ d)
        slope = d @ np.cross(AXIS, turned(x, B)) / length
        lost = damping * slope * v - push
        return -(load(length) + lost) * slope, -lost * slope * v

    scene = turning(x, v).spring_damper("line", "ground", "body", position_a=A, position_b=B, **law).scene()
    return Alone(scene, INERTIA, x, v, formula)


def slack(x: float, v: float) -> Alone:
    """A cable that does not even damp."""
    loose = {"free_length": 9.0, "stiffness": 30.0, "damping": 2.0, "acts": "tension"}
    scene = turning(x, v).spring_damper("line", "ground", "body", position_a=A, position_b=B, **loose).scene()
    return Alone(scene, INERTIA, x, v, lambda x, v: (0.0 * x, 0.0 * x))


def bushing(x: float, v: float) -> Alone:
    def formula(x: Any, v: Any) -> tuple[Any, Any]:
        c, n = np.cos(x / 2.0), np.sin(x / 2.0) * AXIS
        q = np.concatenate([[c * HALF[0] - n @ HALF[1:]], c * HALF[1:] + HALF[0] * n + np.cross(n, HALF[1:])])
        theta = complex_rotation_vector(q)
        term = left = np.eye(3, dtype=complex)
        for i in range(1, 40):
            term = term @ skew(theta) / (i + 1)
            left = left + term
        xi = np.concatenate([theta, turned(x, B) - A])
        slope = np.concatenate([np.linalg.solve(left, AXIS.astype(complex)), np.cross(AXIS, turned(x, B))])
        lost = LOSSY @ slope * v
        return -slope @ (STIFF @ xi + lost), -slope @ lost * v

    scene = turning(x, v).bushing(
        "mount", "ground", "body", position_a=A, position_b=B, quaternion_b=HALF, stiffness=STIFF, damping=LOSSY
    )
    return Alone(scene.scene(), INERTIA, x, v, formula)


LAW = {"stiffness": 4.0, "stiffening": (3.0, -2.0), "damping": 0.3, "stop_stiffness": 50.0, "stop_dissipation": 0.1}
TABLE, LOADS = (-0.3, -0.1, 0.0, 0.2, 0.5), (-5.0, -1.5, 0.0, 4.0, 4.5)


def coil(x: float, v: float) -> tuple[Any, Any]:
    """LAW with an upper stop at 0.4."""
    deep = x - 0.4 if x.real > 0.4 else 0.0 * x
    lost = 0.3 * v + 50.0 * deep * 0.1 * v
    return -(4.0 * x + 3.0 * x**2 - 2.0 * x**3 + 50.0 * deep + lost), -lost * v


def curve(x: Any, v: Any) -> tuple[Any, Any]:
    """The table's spline in the piece of x."""
    spline = PchipInterpolator(TABLE, LOADS)
    piece = int(np.searchsorted(TABLE, x.real)) - 1
    return -(np.polyval(spline.c[:, piece], x - TABLE[piece]) + 0.3 * v), -0.3 * v * v


def friction(x: Any, v: Any) -> tuple[Any, Any]:
    load = (0.8 + (1.2 - 0.8) / (1.0 + (v / 0.2) ** 2)) * v / np.sqrt(v * v + 0.05**2)
    return -load, -load * v


def sliding(x: float, v: float) -> fm.SceneBuilder:
    return body().prismatic("hinge", "ground", "body", axis=AXIS, position=x, rate=v)


def spun(v: float) -> fm.SceneBuilder:
    built = body().weld("hinge", "ground", "body")
    return built.wheel("wheel", "body", axis=AXIS, mass=0.1, axial_inertia=0.05, transverse_inertia=0.03, speed=v)


RUBBED = {"sliding": 0.8, "static": 1.2, "stribeck": 0.2, "smoothing": 0.05}
CURVED = {"table": TABLE, "loads": LOADS, "damping": 0.3}
EACH = {
    "spring": line(0.4, 0.7, lambda length: 2.0 + 30.0 * (length - 0.3) + 4.0 * (length - 0.3) ** 2, 3.0,
                   free_length=0.3, preload=2.0, stiffness=30.0, stiffening=(4.0,)),
    "line with a table": line(0.4, 0.7, lambda length: -curve(length - 0.5, 0.0)[0], free_length=0.5, table=TABLE,
                              loads=LOADS),
    "actuator": line(0.4, 0.7, lambda length: 0.0, push=5.0),
    "taut cable": line(0.4, 0.7, lambda length: 30.0 * (length - 0.3), 2.0, free_length=0.3, stiffness=30.0,
                       acts="tension"),
    "pressed buffer": line(0.4, 0.7, lambda length: 30.0 * (length - 2.0), 2.0, free_length=2.0, stiffness=30.0,
                           acts="compression"),
    "slack cable": slack(0.4, 0.7),
    "bushing": bushing(0.4, 0.7),
    "angular spring": Alone(turning(0.2, 0.7).angular_spring("coil", "hinge", upper=0.4, **LAW).scene(), INERTIA, 0.2,
                            0.7, coil),
    "motor beside another": Alone(
        turning(0.2, 0.7).angular_spring("one", "hinge", torque=s.Constant(value=2.0))
        .angular_spring("other", "hinge", stiffness=4.0, torque=s.Constant(value=-5.0)).scene(), INERTIA, 0.2, 0.7,
        lambda x, v: (-4.0 * x - 3.0, -3.0 * v)),
    "in its stop": Alone(turning(0.6, 0.7).angular_spring("coil", "hinge", upper=0.4, **LAW).scene(), INERTIA, 0.6, 0.7,
                         coil),
    "linear spring": Alone(sliding(0.3, -0.7).linear_spring("curve", "hinge", **CURVED).scene(), MASS, 0.3, -0.7,
                           curve),
    "friction in a hinge": Alone(turning(0.2, 0.1).angular_friction("rub", "hinge", **RUBBED).scene(), INERTIA, 0.2,
                                 0.1, friction),
    "friction in a guide": Alone(sliding(0.2, -0.1).linear_friction("rub", "hinge", **RUBBED).scene(), MASS, 0.2, -0.1,
                                 friction),
    "friction in a wheel's bearing": Alone(spun(0.1).angular_friction("rub", "wheel", **RUBBED).scene(), 0.05, 0.0, 0.1,
                                           friction),
}  # fmt: skip


@pytest.mark.parametrize("name", EACH)
@pytest.mark.filterwarnings("ignore:.*is doubtful")
def test_load_power_and_derivatives_are_those_of_the_formula(name: str) -> None:
    scene, inertia, x, v, formula = EACH[name]
    system = fm.compile(scene)
    y, dy, J = np.array([x, v, 0.0]), np.empty(3), np.zeros((3, 3))
    assert np.array_equal(system.initial_state.y, y)
    assert articulated.rhs(0.0, y, dy, system.constants, system.workspace()) == fm.Status.OK
    assert jacobian(0.0, y, J, system.constants, tangent_workspace(system.constants, 1, 1)) == fm.Status.OK

    def rates(x: Any, v: Any) -> np.ndarray:
        load, power = formula(x, v)
        return np.array([load / inertia, power], complex)

    expected = rates(x + 0j, v + 0j).real
    slopes = np.column_stack([rates(x + 1j * H, v + 0j).imag, rates(x + 0j, v + 1j * H).imag]) / H
    size = 1.0 + np.max(np.abs(expected)) + np.max(np.abs(slopes))
    assert np.max(np.abs(dy[1:] - expected)) <= DIGITS * size
    assert np.max(np.abs(J[1:, :2] - slopes)) <= DIGITS * size
    if name != "slack cable":  # which has none
        assert np.max(np.abs(slopes)) > 1e3 * DIGITS * size
