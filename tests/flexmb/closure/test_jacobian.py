"""The Jacobian of closed chains by the recursion, on the manifold and beside it: against differences of the right-hand
side, and against dual numbers."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.closure import dynamics
from flexmb.closure.jacobian import chain_jacobian, jacobian
from flexmb.scene import schema as s
from flexmb.system.watches import WAIVERS
from tests.flexmb.closure import dual_jacobian, loops
from tests.flexmb.closure import mechanisms as m
from tests.flexmb.closure.coupled import coupled_tree
from tests.flexmb.closure.dual_jacobian import chain_tangent
from tests.flexmb.entry.test_tangent import extrapolated

UNIT_ROUNDOFF = 2.0**-53


def connected() -> s.Scene:
    """A flexible four-bar with a motor, a damped strut to the ground, a bushing, and a spring and friction in pins."""
    torque = s.Sine(amplitude=2.0, angular_frequency_rad_s=3.0, phase_rad=0.4)
    scene = m.four_bar_builder({"angle": 1.0, "rate": 2.0, "torque": torque}, {"modes": 1})
    scene.spring_damper("strut", "ground", "coupler", node_b="tip", free_length=0.8, stiffness=40.0, damping=3.0)
    scene.bushing(
        "mount", "crank", "rocker", stiffness=np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), damping=0.1 * np.eye(6)
    )
    scene.angular_spring("coil", "pivot", rest=0.1, stiffness=3.0, stiffening=(0.0, 8.0), damping=0.2)
    scene.angular_friction("bearing", "pin", sliding=0.3, smoothing=0.5)
    return scene.scene()


def strained(scene: s.Scene) -> s.Scene:
    """The scene with its beams at level exact."""
    modes = s.Modes(count=2, families=("bending_y", "bending_z"))
    bodies = tuple(
        msgspec.structs.replace(body, level="exact", modes=modes) if isinstance(body, s.BeamBody) else body
        for body in scene.bodies
    )
    return msgspec.structs.replace(scene, bodies=bodies, allow=WAIVERS)


MOVING = {
    "four-bar, overconstrained": lambda: m.four_bar(rate=2.0),
    "flexible four-bar": lambda: m.four_bar(rate=2.0, modes=3),
    "exact four-bar": lambda: strained(m.four_bar(rate=2.0, modes=1)),
    "driven flexible four-bar": lambda: m.four_bar(
        prescribed=s.Sine(amplitude=0.3, angular_frequency_rad_s=3.0, offset=1.0), modes=1
    ),
    "connected": connected,
    "slider-crank": lambda: m.slider_crank(0.3, 0.8, angle=0.7, modes=1),
    "Bennett": m.bennett,
    "windows": lambda: m.windows(2, 1.5),
    "coupled": lambda: coupled_tree("full"),
    "coupled and closed": lambda: coupled_tree("rigid", ("spherical",)),
} | {f"random loops {seed}": lambda seed=seed: loops.random_loops(seed) for seed in (4, 5, 8, 13, 20)}
LIGHT = {
    f"random loops {seed}, light {ratio:g}": lambda seed=seed, ratio=ratio: loops.light_loops(seed, ratio)
    for seed in loops.LIGHT for ratio in loops.RATIOS
}  # fmt: skip
MOVING |= {f"random loops {lightest}": LIGHT[f"random loops {lightest}"]
           for lightest in ("72, light 0.0001", "11, light 1e-06", "44, light 1e-08")}  # fmt: skip
SCENES = MOVING | LIGHT
NAMES = [*MOVING, *(pytest.param(name, marks=pytest.mark.slow) for name in LIGHT if name not in MOVING)]


class Linearised:
    """A chain at a state y (n,), with its Jacobian there, and what rounding leaves of differences over h/32."""

    def __init__(self, system: fm.System, y: np.ndarray, rate: float = 0.0, algorithm: str = "articulated") -> None:
        self.chain, self.y = system.closures.chain(algorithm, rate), y
        self.J = np.full((len(y), len(y)), np.nan)
        dynamics.project(0.0, system.initial_state.y.copy(), self.chain)  # chooses rows
        tangent = chain_jacobian(self.chain, system.nq, system.nu)
        assert jacobian(0.0, y, self.J, self.chain, tangent) == fm.Status.OK
        nq, free = system.nq, system.constants.speed["prescribed"] < 0
        M = system.mass_matrix(fm.State(y[:nq], y[nq:-1]))[np.ix_(free, free)]
        self._rounding = np.linalg.cond(M, np.inf) * max(1.0, np.max(np.abs(self.right_side(y)))) * UNIT_ROUNDOFF

    def by_duals(self, system: fm.System) -> np.ndarray:
        """The Jacobian by the other route, for the same chosen rows."""
        found, tangent = np.full_like(self.J, np.nan), chain_tangent(*system.closures.constants, system.nq, system.nu)
        assert dual_jacobian.jacobian(0.0, self.y, found, self.chain, tangent) == fm.Status.OK
        return found

    def right_side(self, y: np.ndarray) -> np.ndarray:
        dy = np.empty_like(y)
        assert dynamics.rhs(0.0, y, dy, self.chain, self.chain) == fm.Status.OK
        return dy

    def worst(self, J: np.ndarray, h: float = 1e-3) -> float:
        """Largest difference of columns in what is in doubt."""
        found = []
        for j, unit in enumerate(np.eye(len(self.y))):
            expected, doubt = extrapolated(lambda h, unit=unit: self.right_side(self.y + h * unit), h)
            found.append(np.max(np.abs(J[:, j] - expected) / (30.0 * doubt + 2048.0 * self._rounding / h)))
        return max(found)


def state(system: fm.System, beside: float = 0.0) -> np.ndarray:
    """[q, u, work] of the initial state, its coordinates and speeds moved by up to `beside`."""
    y = np.r_[system.initial_state.q, system.initial_state.u, 0.0]
    return y + beside * np.cos(np.arange(len(y)))


@pytest.mark.parametrize("rate", [0.0, 20.0])
@pytest.mark.parametrize("beside", [0.0, 1e-3])
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_all_columns_against_differences(name, beside, rate):
    """Also that of work, also of open loops, where rows are redundant, driven, or decay."""
    system = fm.compile(SCENES[name]())
    found = Linearised(system, state(system, beside), rate)
    assert found.worst(found.J) <= 1.0


@pytest.mark.parametrize("algorithm", ["articulated", "composite"])
@pytest.mark.parametrize("rate", [0.0, 20.0])
@pytest.mark.parametrize("beside", [0.0, 1e-3])
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_recursion_and_dual_numbers_agree(name, beside, rate, algorithm):
    """Two routes that share the right-hand side alone: rows scaled by their largest element, which the stiffest mode
    has. A planted error of 1e-9 in the derivatives of the accelerations is noticed."""
    system = fm.compile(SCENES[name]())
    found = Linearised(system, state(system, beside), rate, algorithm)
    expected = found.by_duals(system)
    size = np.abs(expected).max()
    # Either route divides by pivots of light bodies twice, for the accelerations and for their derivatives.
    rounding = 4.0 * 10.0 ** -system.digits_left(system.initial_state)
    assert np.abs(found.J - expected).max() <= max(1e-11, rounding) * size
    planted = found.J.copy()
    planted[system.nq :] *= 1.0 + 1e-9
    assert np.abs(planted - expected).max() > 1e-11 * size


@pytest.mark.parametrize("name", ["four-bar, overconstrained", "flexible four-bar", "random loops 4"])
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_what_the_differences_would_notice(name):
    """A planted error of a millionth."""
    system = fm.compile(SCENES[name]())
    found = Linearised(system, state(system))
    assert found.worst(found.J * (1.0 + 1e-6)) > 10.0
