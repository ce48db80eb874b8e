"""Equilibria far from the start: one branch whatever the polynomials are, limit and bifurcation points by hand."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

import flexmb as fm
from flexmb.scene import schema as s
from tests.flexmb.linear.truss import HIGH, STIFF, guided, truss


def strip(polynomials: int, **load: float) -> fm.Scene:
    """A clamped beam of level exact, L = EI = 1, under a force or a torque at its tip, in a plane."""
    section = s.BeamStation(
        x_m=0.0, EA_N=1e6, EIy_Nm2=1.0, EIz_Nm2=1.0, GJ_Nm2=1.0, mass_per_length_kg_m=1.0, rotary_y_kg_m=1e-3,
        rotary_z_kg_m=1e-3,
    )  # fmt: skip
    made = fm.SceneBuilder("strip", allow=("few_points", "few_polynomials"))
    modes = s.Modes(count=polynomials, families=("bending_y",))
    made.beam("rod", length=1.0, elements=4, section=section, modes=modes, level="exact")
    made.weld("clamp", "ground", "rod").marker("tip", "rod", node="tip")
    for kind, value in load.items():
        add, direction = {"force": (made.force, (0, 1, 0)), "torque": (made.torque, (0, 0, 1))}[kind]
        add("load", "rod", node="tip", direction=direction, function=fm.Constant(value=value))
    return made.scene()


def tip(system: fm.System, state: fm.State) -> np.ndarray:
    return system.evaluate(state.t, state.q, state.u).markers["tip"].position


@pytest.mark.parametrize("turns", [1.0, 2.5, 4.0, 4.5, 5.0])
def test_a_torque_winds_a_strip_into_a_circle(turns):
    """A linear problem, although the inertia changes: curvature T / EI everywhere."""
    one, found = (fm.equilibrium(strip(6, torque=2.0 * np.pi * each)) for each in (1.0, turns))
    assert found.stability == "stable"
    assert found.q == pytest.approx(turns * one.q, rel=1e-9)
    curvature = 2.0 * np.pi * turns
    circle = np.array([np.sin(curvature), 1.0 - np.cos(curvature), 0.0]) / curvature
    system = fm.compile(strip(20, torque=curvature))
    assert tip(system, fm.equilibrium(system)) == pytest.approx(circle, abs=1e-9)


def test_five_turns_by_path():
    """As by one equilibrium, and a path of few steps."""
    values = 2.0 * np.pi * np.array([0.0, 2.5, 4.5, 5.0])
    path = fm.equilibrium_path(strip(20, torque=0.0), "loads.load.function.value", values)
    assert not path.critical and {state.stability for state in path.states} == {"stable"} and len(path.states) < 30
    for value in values[1:]:
        circle = np.array([np.sin(value), 1.0 - np.cos(value), 0.0]) / value
        system = fm.compile(strip(20, torque=value))
        assert tip(system, path.at(value)[0]) == pytest.approx(circle, abs=1e-12)


def test_what_its_points_do_not_follow_is_refused():
    """A turn from one of the 23 points to the next; what is within is at rest under its torque."""
    one = fm.equilibrium(strip(20, torque=2.0 * np.pi))
    for turns in (5.0, 20.0):
        system = fm.compile(strip(20, torque=2.0 * np.pi * turns))
        rates, beside = (system.accelerations(system.state(part * turns * one.q, one.u)) for part in (1.0, 0.99))
        assert np.max(np.abs(rates)) < 1e-9 * np.max(np.abs(beside))
    with pytest.raises(fm.DynamicsError, match="wound up by a turn from one of its points to the next"):
        system.accelerations(system.state(30.0 * one.q, one.u))


def elastica(force: float) -> np.ndarray:
    """The tip under a force across the unloaded strip, by elliptic integrals; the tangent there has sine 2 m - 1."""

    def excess(log: float) -> float:
        m = 1.0 - np.exp(log)
        return float(ellipk(m) - ellipkinc(np.arcsin(1.0 / np.sqrt(2.0 * m)), m) - np.sqrt(force))

    m = 1.0 - np.exp(brentq(excess, np.log(1e-16), np.log(0.49999)))
    along = ellipe(m) - ellipeinc(np.arcsin(1.0 / np.sqrt(2.0 * m)), m)
    return np.array([np.sqrt(2.0 * (2.0 * m - 1.0) / force), 1.0 - 2.0 * along / np.sqrt(force), 0.0])


def test_elastica_by_any_polynomials_and_by_path():
    """P L^2 / EI = 300 from straight: the branch that a slowly growing load leads to."""
    far = [fm.equilibrium(fm.compile(strip(p, force=300.0))) for p in (6, 12, 20)]
    places = [tip(fm.compile(strip(p, force=300.0)), each) for p, each in zip((6, 12, 20), far, strict=True)]
    assert {each.stability for each in far} == {"stable"}
    assert np.max(np.abs(np.array(places) - elastica(300.0))) < 2e-3
    path = fm.equilibrium_path(strip(12, force=0.0), "loads.load.function.value", [0.0, 10.0, 300.0])
    assert not path.critical and {state.stability for state in path.states} == {"stable"}
    system = fm.compile(strip(12, force=300.0))
    assert tip(system, path.at(10.0)[0]) == pytest.approx(elastica(10.0), abs=1e-11)
    assert tip(system, path.at(300.0)[0]) == pytest.approx(places[1], abs=1e-9)


def test_elastica_to_300_is_the_closed_form():
    path = fm.equilibrium_path(strip(20, force=0.0), "loads.load.function.value", [0.0, 1.0, 30.0, 300.0])
    system = fm.compile(strip(20, force=300.0))
    for value in (1.0, 30.0, 300.0):
        assert tip(system, path.at(value)[0]) == pytest.approx(elastica(value), abs=1e-9)


def load(z: float) -> float:
    """That holds the truss of von Mises at a height."""
    length = np.hypot(1.0, z)
    return 2.0 * STIFF * z * (np.hypot(1.0, HIGH) - length) / length


LIMIT = float(np.sqrt(np.hypot(1.0, HIGH) ** (2.0 / 3.0) - 1.0))  # dP/dz = 0: length^3 = free length
SIDEWAYS = float(brentq(lambda z: np.hypot(1.0, z) - (np.hypot(1.0, HIGH) - np.hypot(1.0, z)) * z * z, 2.0, HIGH))


def test_a_truss_snaps_through():
    scene = guided()
    top = load(LIMIT)
    path = fm.equilibrium_path(scene, "loads.push.function.value", [0.0, 0.5 * top, 1.2 * top])
    assert [each.kind for each in path.critical] == ["limit", "limit"]
    assert [each.value for each in path.critical] == pytest.approx([top, -top], rel=1e-8)
    assert [each.state.q[0] for each in path.critical] == pytest.approx([LIMIT, -LIMIT], rel=1e-5)
    heights = np.array([state.q[0] for state in path.states])
    assert path.values == pytest.approx(np.vectorize(load)(heights), abs=1e-8 * top)
    between = np.abs(heights) < LIMIT * (1.0 - 1e-4)
    stable = np.array([state.stability == "stable" for state in path.states])
    assert np.array_equal(stable, ~between | (np.abs(np.abs(heights) - LIMIT) < 1e-4) & stable)
    assert [each.stability for each in path.at(0.5 * top)] == ["stable", "unstable", "stable"]
    assert path.values[-1] == 1.2 * top and heights[-1] < -HIGH


def test_a_limit_point_of_small_displacements_is_no_sharp_corner():
    """Steps follow the structure's own displacements, not the size of its coordinates' units."""
    flat = 0.01
    path = fm.equilibrium_path(guided(flat, flat), "loads.push.function.value", [0.0, 3.0 * STIFF * flat**3])
    z = np.sqrt(np.hypot(1.0, flat) ** (2.0 / 3.0) - 1.0)
    assert [abs(each.state.q[0]) for each in path.critical] == pytest.approx([z, z], rel=1e-4)
    assert len(path.states) < 40


def test_a_truss_gives_way_sideways_before():
    made = truss().rigid_body("slide", mass=1.0, inertia=(1.0, 1.0, 1.0))
    made.prismatic("across", "ground", "slide", axis=(1, 0, 0))
    scene = made.prismatic("up", "slide", "mass", axis=(0, 0, 1), position=HIGH).scene()
    path = fm.equilibrium_path(scene, "loads.push.function.value", [0.0, 0.9 * load(LIMIT)])
    assert [each.kind for each in path.critical] == ["bifurcation"]
    assert path.critical[0].value == pytest.approx(load(SIDEWAYS), rel=1e-5)
    assert [path.states[0].stability, path.states[-1].stability] == ["stable", "unstable"]


def test_what_is_found_says_whether_it_is_stable_and_only_that():
    scene = guided(0.01)
    system = fm.compile(scene)
    found = fm.equilibrium(system)
    assert found.stability == "unstable" and found.q[0] == pytest.approx(0.0, abs=1e-12)  # the guess was beside it
    assert copy.copy(found).stability == pickle.loads(pickle.dumps(found)).stability == "unstable"
    assert replace(found, q=[HIGH]).stability is None
    assert fm.equilibrium(system, system.state([0.5], [0.0])).stability == "stable"


def test_what_cannot_be_followed_is_refused():
    scene = guided()
    number = "loads.push.function.value"
    for values in ([0.0], [0.0, 1.0, 0.5], [[0.0, 1.0]]):
        with pytest.raises(ValueError, match="rise or all fall"):
            fm.equilibrium_path(scene, number, values)
    with pytest.raises(ValueError, match="nowhere"):
        fm.equilibrium_path(scene, "nowhere.mass_kg", [0.0, 1.0])
    with pytest.raises(TypeError, match="Scene"):
        fm.equilibrium_path(fm.compile(scene), number, [0.0, 1.0])
    with pytest.raises(ValueError, match="not one of the values"):
        fm.equilibrium_path(scene, number, [0.0, 1.0]).at(0.5)


ARC, STRETCHED = 0.4, 400.0  # the angle of half an arch of length 1 and bending stiffness 1; EA
SPAN, RISE = np.sin(ARC) / ARC, (1.0 - np.cos(ARC)) / ARC


def arch() -> fm.Scene:
    """Half of a hinged circular arch, its crown on a guide, under half of the load that pushes the crown down (N)."""
    section = s.BeamStation(
        x_m=0.0, EA_N=STRETCHED, EIy_Nm2=1.0, EIz_Nm2=1.0, GJ_Nm2=1.0, mass_per_length_kg_m=1.0, rotary_y_kg_m=1e-3,
        rotary_z_kg_m=1e-3, curvature_1_m=(0.0, 0.0, -ARC),
    )  # fmt: skip
    modes = s.Modes(count=1, polynomials={"bending_y": 8, "axial": 6})
    made = fm.SceneBuilder("arch", allow=("wave_speed",)).rigid_body("crown", mass=1.0, inertia=(1.0, 1.0, 1.0))
    made.beam("rib", length=1.0, elements=4, section=section, modes=modes, level="exact")
    made.prismatic("guide", "ground", "crown", axis=(0, 1, 0), position=RISE).weld("joint", "crown", "rib")
    made.closure("support", "revolute", "ground", "rib", position_a=(SPAN, 0.0, 0.0), node_b="tip")
    return made.force("push", "crown", direction=(0, -1, 0), function=fm.Constant(value=0.0)).scene()


class Shooting:
    """The same half by shooting from the support, where (H, V) push: x' = (1 + N/EA) cos a, a' = -arc + M/EI."""

    def __init__(self) -> None:
        self._guess = np.array([ARC, 0.0, 0.0])

    def push(self, height: float) -> float:
        """The load V on the half whose crown is at a height, next to the one that was asked for before."""
        found = root(self._missed, self._guess, (height,), tol=1e-13)
        assert np.max(np.abs(self._missed(found.x, height))) < 1e-9, found.message
        self._guess = found.x
        return float(found.x[2])

    @staticmethod
    def _missed(start: np.ndarray, height: float) -> np.ndarray:
        angle, H, V = start

        def slope(_: float, at: np.ndarray) -> list[float]:
            x, y, a = at
            g = 1.0 - (H * np.cos(a) + V * np.sin(a)) / STRETCHED
            return [g * np.cos(a), g * np.sin(a), x * V - y * H - ARC]

        x, y, a = solve_ivp(slope, (0.0, 1.0), [0.0, 0.0, angle], rtol=1e-11, atol=1e-13).y[:, -1]
        return np.array([x - SPAN, y - height, a])

    def limit(self, near: float) -> float:
        """The stationary load at a height near the one that was asked for before."""
        beside = 1e-3 * np.arange(-2, 3)
        fitted = np.polyfit(beside, [self.push(near + each) for each in beside], 4)
        return float(np.polyval(fitted, next(r.real for r in np.roots(np.polyder(fitted)) if abs(r) < 2e-3)))


def test_an_arch_snaps_through():
    """All of its equilibria, and both limit points, against shooting over the height of the crown; values beside them
    name both branches' stability."""
    path = fm.equilibrium_path(arch(), "loads.push.function.value", [0.0, 0.62, 1.5])
    found, by_hand, limits = np.array([state.q[0] for state in path.states]), Shooting(), []
    assert found[0] == pytest.approx(RISE) and found[-1] < -RISE and np.all(np.diff(found) < 0.0)
    critical = [float(each.state.q[0]) for each in path.critical]
    for height, value in zip(found, path.values, strict=True):
        assert value == pytest.approx(by_hand.push(height), abs=1e-7)
        if height in critical:
            limits.append(by_hand.limit(height))
    assert [each.kind for each in path.critical] == ["limit", "limit"]
    assert [each.value for each in path.critical] == pytest.approx(limits, abs=1e-7)
    upper, lower = critical
    beside = np.min(np.abs(found[:, None] - critical), axis=1) > 1e-4
    stable = np.array([state.stability == "stable" for state in path.states])
    assert np.array_equal(stable[beside], ((found > upper) | (found < lower))[beside])
    assert [each.stability for each in path.at(0.62)] == ["stable", "unstable", "stable"]
    assert len(path.states) < 60
