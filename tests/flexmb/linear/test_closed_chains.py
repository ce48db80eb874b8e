"""Linear models of closed chains: against trees that are the same, closed forms, and differences on the manifold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from numpy.polynomial import Chebyshev

import flexmb as fm
from flexmb.linear.closed_variations import ClosedEquations
from flexmb.linear.linear_model import LinearModel
from flexmb.linear.variations import Equations
from flexmb.scene import schema as s
from flexmb.scene.shapes import beam_section
from flexmb.system.pushforward import GivenMotion
from tests.flexmb.closure import mechanisms as m

SOFT = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=2e-9, Iz=1e-9, rho=2700.0)
G = 9.81


class Manifold:
    """Accelerations of the independent coordinates as functions of them, by closing the loops again: scalar hinges."""

    def __init__(self, system: fm.System, model: LinearModel) -> None:
        self.system, self.model = system, model
        self.chosen = [[name for name, _ in system.state_names[0]].index(name) for name in model.displacements]

    def state(self, t: float, z: np.ndarray, w: np.ndarray) -> fm.State:
        """The closed state at time t with the independent coordinates moved by z and their speeds by w."""
        start = self.model.state
        q, u = start.q.copy(), start.u.copy()
        for _ in range(20):
            found = self.system.admissible(self.system.state(q, u, t))
            short = [start.q[self.chosen] + z - found.q[self.chosen], start.u[self.chosen] + w - found.u[self.chosen]]
            if np.max(np.abs(short)) < 1e-14:
                break
            q, u = (old + self.model.motion @ x for old, x in zip((found.q, found.u), short, strict=True))
        return found

    def slope(self, along: str, i: int = 0) -> np.ndarray:
        """By displacement or speed i, or by time: Richardson's extrapolation of two central differences."""
        n = len(self.chosen)
        step = 1e-5 if "mode" in self.model.displacements[i] and along == "displacement" else 1e-3

        def rates(h: float) -> np.ndarray:
            z, w = (h * np.eye(n)[i] if along == key else np.zeros(n) for key in ("displacement", "speed"))
            t = self.model.state.t + (h if along == "time" else 0.0)
            return self.system.accelerations(self.state(t, z, w))[self.chosen]

        def difference(h: float) -> np.ndarray:
            return (rates(h) - rates(-h)) / (2.0 * h)

        return (4.0 * difference(step) - difference(2.0 * step)) / 3.0


MOVING = {
    "four-bar": lambda: m.four_bar(rate=2.0),
    "flexible four-bar": lambda: m.four_bar(rate=2.0, modes=1),
    "driven four-bar with modes": lambda: m.four_bar(
        prescribed=s.Sine(amplitude=0.3, angular_frequency_rad_s=3.0, offset=1.0), modes=1
    ),
    "slider-crank": lambda: m.slider_crank(0.3, 0.8, angle=0.7, modes=1),
    "slider-crank cut at a pin": lambda: m.slider_crank(0.3, 0.8, angle=0.7, cut="pin"),
    "Bennett": m.bennett,
    "windows": lambda: m.windows(2, 1.5),
}


@pytest.mark.parametrize("name", MOVING)
def test_derivatives_are_those_of_the_closed_chain(name):
    """Also where rows are redundant, where modes take part, and where a loop is driven."""
    system = fm.compile(MOVING[name]())
    model = fm.linearize(system)
    n = len(model.rates)
    assert n == system.closures.mobility and np.linalg.norm(model.state.u) > 0.1
    assert model.rates == pytest.approx(system.accelerations(model.state)[Manifold(system, model).chosen], rel=1e-12)
    manifold = Manifold(system, model)
    displaced = np.column_stack([manifold.slope("displacement", i) for i in range(n)])
    hurried = np.column_stack([manifold.slope("speed", i) for i in range(n)])
    drift = manifold.slope("time")
    for found, expected in ((model.A[n:, :n], displaced), (model.A[n:, n:], hurried), (model.drift, drift)):
        stiffest = np.max(np.abs(expected))  # of closing the loops to 1e-14 this is what is left
        assert np.all(np.abs(found - expected) <= 2e-7 * np.max(np.abs(expected), axis=0) + 1e-10 * stiffest + 1e-8)
    assert np.array_equal(model.A[:n], np.eye(n, 2 * n, n))


@pytest.mark.parametrize("name", MOVING)
def test_forces_drive_as_the_mass_of_the_allowed_motions_says(name):
    """B holds derivatives by forces; mass and dependent displacements of the model have them once more."""
    model = fm.linearize(fm.compile(MOVING[name]()))
    moved = model.displacements_by([name for name, _ in model.inputs])
    expected = np.linalg.solve(model.mass, moved.T)
    n, scale = len(model.rates), np.max(np.abs(expected))
    assert not model.B[:n].any()
    assert np.max(np.abs(model.B[n:] - expected)) < 1e-10 * scale
    assert np.max(np.abs(moved.T - expected)) > 1e-3 * scale  # a control: with masses left out it is another one


def refused(*_):
    raise AssertionError("this is not asked for")


@pytest.mark.parametrize("tree", [True, False])
def test_only_what_changes_and_is_asked_for_is_differentiated(tree, monkeypatch):
    """By time nothing where functions are held; of loads nothing at all. Functions that vary are differentiated."""
    scene = MOVING["driven four-bar with modes"]()
    system = fm.compile(msgspec.structs.replace(scene, closures=()) if tree else scene)
    moving = (Equations if tree else ClosedEquations)(system)
    held, start = moving.held(0.0), system.initial_state
    state = held.on_functions(replace(start, u=np.zeros_like(start.u)))
    expected, at = held.variations(state), held.forces(state)
    assert not expected.drift.any() and moving.variations(start).drift.any()
    for equations in (held, moving):
        monkeypatch.setattr(equations._free, "_differentiate_by_time", refused)
    assert np.array_equal(held.variations(state).A, expected.A)
    with pytest.raises(AssertionError, match="not asked for"):
        moving.variations(start)
    monkeypatch.setattr(held._free, "_differentiate", refused)
    assert held.loads(state, at) == pytest.approx(at.load, rel=1e-9, abs=1e-9 * np.max(np.abs(at.load)))


def test_without_the_closure_loads_stiffness_is_another():
    """What the test above would notice: loads whose direction does not turn."""
    system = fm.compile(m.four_bar(rate=0.0))
    t, y = system.layout.entering(system.initial_state)
    at, push = system.linearisation._variation(t, y), system.linearisation._pushforward
    directions = system.linearisation._directions(at.motion, 0)
    loads = at.rows.loads, np.zeros_like(at.rows.loads)
    turned, still = (push.derivatives(GivenMotion(t, y, at.accelerations, f), directions, push.balance) for f in loads)
    turning = at.of_accelerations.by_force @ (turned - still)[: system.nu, : system.nu]
    assert np.abs(turning).max() > 0.1 * np.abs(fm.linearize(system).A[1, 0])


def test_dependent_coordinates_follow():
    """Outputs by name: of the coordinates that are not independent, and of their speeds, in a state that moves."""
    system = fm.compile(m.four_bar(rate=2.0))
    model, h = fm.linearize(system), 1e-4
    manifold = Manifold(system, model)
    names = [name for name, _ in (*system.state_names[0], *system.state_names[1])]
    rows = [[name for name, _ in model.outputs].index(name) for name in names]
    for column, (z, w) in enumerate(((h, 0.0), (0.0, h))):
        there, back = (manifold.state(0.0, np.array([k * z]), np.array([k * w])) for k in (1.0, -1.0))
        moved = np.r_[there.q - back.q, there.u - back.u] / (2.0 * h)
        assert model.C[rows, column] == pytest.approx(moved, abs=1e-7)
    assert model.motion[:, 0] == pytest.approx(model.C[rows[:3], 0], abs=1e-15)


def fitted(function: Callable[[np.ndarray], np.ndarray], about: float, wide: float = 0.4) -> Chebyshev:
    """A function of an angle, which can be differentiated, to rounding."""
    return Chebyshev.interpolate(np.vectorize(function), 24, [about - wide, about + wide])


def weighed(lengths: m.FourBar, gravity: float) -> Callable[[float], float]:
    """Potential energy of the four-bar's uniform bars."""

    def potential(crank: float) -> float:
        coupler, rocker = lengths.angles(crank)
        pin = lengths.crank * np.sin(crank)
        heights = 0.5 * pin, pin + 0.5 * lengths.coupler * np.sin(coupler), 0.5 * lengths.rocker * np.sin(rocker)
        return float(-gravity * sum(0.78 * length * y for length, y in zip(lengths[:3], heights, strict=True)))

    return potential


@pytest.mark.parametrize("count", [1, 3])
def test_parallelograms_hang_like_one_pendulum(count):
    """Bars that stay parallel: a platform on uprights is one coordinate with (count + 1)/3 + count kg m2."""
    system = fm.compile(m.windows(count, 0.0, gravity=9.81))
    model = fm.linearize(system, fm.equilibrium(system))
    inertia, weight = (count + 1) / 3.0 + count, 9.81 * (0.5 * (count + 1) + count)
    assert len(model.rates) == 1
    assert model.modes[0].frequency_rad_s == pytest.approx(np.sqrt(weight / inertia), rel=1e-12)


def two_arms(how: str) -> fm.Scene:
    """A beam on a sprung pivot and a body at its tip, joined by a hinge, or by a closure in its place."""
    lean, axis = 1.4, (0.0, 1.0, 0.0)
    scene = fm.SceneBuilder("two arms", gravity=(0.0, 0.0, -G))
    scene.beam("arm", length=1.0, elements=8, section=SOFT, modes=4)
    kind, closed = how.split()
    if kind == "spherical":  # hanging, it may turn about the vertical: then it must be round
        scene.rigid_body("bob", mass=0.7, com=(0.3, 0, 0), inertia=(0.02, 0.05, 0.05), nodes={"end": (0.5, 0, 0)})
    else:
        inertia = np.array([[0.02, 0.003, 0.001], [0.003, 0.05, 0.002], [0.001, 0.002, 0.06]])
        scene.rigid_body("bob", mass=0.7, com=(0.3, 0.02, 0.04), inertia=inertia, nodes={"end": (0.5, 0.0, 0.1)})
    scene.revolute("pivot", "ground", "arm", axis=axis, angle=lean, stiffness=60.0, rest=lean, damping=0.02)
    if closed == "hinge":
        place = {"parent_node": "tip"}
        if kind == "revolute":
            scene.revolute("joint", "arm", "bob", axis=axis, **place)
        elif kind == "spherical":
            scene.spherical("joint", "arm", "bob", **place)
        else:
            scene.weld("joint", "arm", "bob", **place)
    else:
        turn = (np.cos(0.5 * lean), 0.0, np.sin(0.5 * lean), 0.0)
        at = (np.cos(lean), 0.0, -np.sin(lean))
        scene.free("space", "ground", "bob", position=at, quaternion=turn)
        turning = {"axis": axis} if kind == "revolute" else {}
        scene.closure("joint", kind, "arm", "bob", node_a="tip", **turning)
    scene.marker("end", "bob", node="end")
    return scene.scene()


@pytest.mark.parametrize("kind", ["weld", "revolute", "spherical"])
def test_a_closure_is_as_good_as_the_hinge_in_its_place(kind):
    """Of a body that hangs on a bending beam: equilibrium, eigenvalues, and how its end answers a torque."""
    frequencies, ends, answers = [], [], []
    for how in ("hinge", "closure"):
        system = fm.compile(two_arms(f"{kind} {how}"))
        found = fm.equilibrium(system)
        model = fm.linearize(system, found, held=True)
        frequencies.append(model.eigenvalues)
        ends.append(system.evaluate(found.t, found.q, found.u).markers["end"].position)
        outputs = tuple(name for name, _ in model.outputs if name.startswith("end."))
        answers.append(model.frequency_response("pivot.rotation", [0.3, 2.0, 30.0], outputs))
    assert len(frequencies[0]) == len(frequencies[1])
    assert ends[1] == pytest.approx(ends[0], abs=1e-11)
    scale = np.max(np.abs(frequencies[0]))
    for value in frequencies[0]:
        # the square root of rounding where two motions of no frequency share an eigenvalue
        near = np.min(np.abs(frequencies[1] - value))
        assert near < (1e-9 * abs(value) + 1e-13 * scale if abs(value) > 1e-6 * scale else 1e-6 * scale)
    assert answers[1] == pytest.approx(answers[0], rel=1e-8, abs=1e-9 * np.max(np.abs(answers[0])))


@pytest.mark.parametrize("how", ["weld", "closure"])
def test_two_halves_of_a_spinning_body_are_one(how):
    """A torque-free spin is a relative equilibrium: in axes that turn, eigenvalues 0, +-i Omega and those of Euler."""
    rate, half = 2.0, (0.3, 0.5, 0.6)
    scene = fm.SceneBuilder("halves")
    for name in ("one", "other"):
        scene.rigid_body(name, mass=1.0, inertia=half)
    scene.free("space", "ground", "one", angular_velocity=(0.0, 0.0, rate))
    if how == "weld":
        scene.weld("glue", "one", "other")
    else:
        scene.free("too", "ground", "other", angular_velocity=(0.0, 0.0, rate)).closure("glue", "weld", "one", "other")
    model = fm.linearize(fm.compile(scene.scene()))
    A, B, C = half
    nutation = rate * np.sqrt((C - A) * (C - B) / (A * B))
    found = np.sort(model.eigenvalues.imag)
    assert len(found) == 12 and np.max(np.abs(model.rates)) < 1e-13
    for value in (nutation, -nutation):
        assert np.min(np.abs(model.eigenvalues - 1j * value)) < 1e-10
    assert np.max(np.abs(model.eigenvalues.real)) < 1e-6
    assert np.sum(np.abs(np.abs(found) - rate) < 1e-6) == 6  # two of position, one of attitude, and their conjugates


ARM, LINK = 0.4, 0.5


def governor() -> fm.Scene:
    """A flyball governor: an arm swings from the top of a turning shaft, a link carries a sleeve that slides on it."""
    scene = fm.SceneBuilder("governor", gravity=(0.0, 0.0, -G))
    scene.rigid_body("shaft", mass=1.0, inertia=(0.1, 0.1, 0.01))
    for name, length in (("arm", ARM), ("link", LINK)):
        mass = 2.0 * length
        inertia = (1e-4, mass * length**2 / 12.0, mass * length**2 / 12.0)
        scene.rigid_body(name, mass=mass, com=(0.5 * length, 0, 0), inertia=inertia, nodes={"tip": (length, 0, 0)})
    scene.rigid_body("sleeve", mass=0.5, inertia=(1e-3, 1e-3, 1e-3))
    arm = 1.0  # below the horizontal
    link = np.pi - np.arccos(ARM * np.cos(arm) / LINK)
    height = -ARM * np.sin(arm) - LINK * np.sin(link)
    y = (0.0, 1.0, 0.0)
    scene.revolute("spin", "ground", "shaft")
    scene.revolute("top", "shaft", "arm", axis=y, angle=arm)
    scene.revolute("ball", "arm", "link", parent_node="tip", axis=y, angle=link - arm)
    scene.prismatic("slide", "shaft", "sleeve", position=height)
    scene.closure("foot", "revolute", "link", "sleeve", node_a="tip", axis=y)
    return scene.scene()


class Governor:
    """Closed forms over the angle x of the arm below the horizontal, at one rate: effective potential, inertia."""

    def __init__(self, rate: float) -> None:
        self._rate = rate

    def places(self, x: float) -> np.ndarray:
        """[x, z of arm, x, z of link, z of sleeve, angles of both]."""
        below = np.arccos(ARM * np.cos(x) / LINK)
        out, low = ARM * np.cos(x), ARM * np.sin(x)
        drop = LINK * np.sin(below)
        return np.array([0.5 * out, -0.5 * low, 0.5 * out, -low - 0.5 * drop, -low - drop, x, np.pi - below])

    def potential(self, x: float) -> float:
        p, total = self.places(x), 0.0
        for mass, length, out, z, angle in ((2 * ARM, ARM, p[0], p[1], p[5]), (2 * LINK, LINK, p[2], p[3], p[6])):
            about = mass * out**2 + mass * length**2 / 12.0 * np.cos(angle) ** 2 + 1e-4 * np.sin(angle) ** 2
            total += mass * G * z - 0.5 * self._rate**2 * about
        return float(total + 0.5 * G * p[4])

    def inertia(self, x: float) -> float:
        p = np.array([fitted(lambda a, i=i: self.places(a)[i], x, 0.15).deriv()(x) for i in range(7)])
        arm, link = 2.0 * ARM, 2.0 * LINK
        bars = arm * (p[0] ** 2 + p[1] ** 2 + ARM**2 / 12.0 * p[5] ** 2)
        return float(bars + link * (p[2] ** 2 + p[3] ** 2 + LINK**2 / 12.0 * p[6] ** 2) + 0.5 * p[4] ** 2)


def test_governor_in_steady_spin():
    """Where its effective potential is level, at the root of its curvature over its inertia; from rate to rate."""
    rates = [12.0, 14.0, 16.0]
    system = fm.compile(governor())
    diagram = fm.campbell(system, "spin", rates)
    for rate, value in zip(rates, diagram.eigenvalues[:, 0], strict=True):
        spin = fm.steady_spin(system, "spin", rate)
        lifted = Governor(rate)
        arm = spin.state.q[system.coordinate("top")][0]
        V = fitted(lifted.potential, arm, 0.15)
        slack = V.deriv()(arm) / V.deriv(2)(arm)
        assert abs(slack) < 1e-11
        expected = np.sqrt(V.deriv(2)(arm) / lifted.inertia(arm))
        assert spin.linearize().modes[0].frequency_rad_s == pytest.approx(expected, rel=1e-9)
        assert value.imag == pytest.approx(expected, rel=1e-9)
    assert np.min(diagram.mac) == pytest.approx(1.0, abs=1e-12)


def test_a_loop_to_the_ground_does_not_spin_steadily():
    with pytest.raises(ValueError, match="through closures"):
        fm.steady_spin(m.four_bar(gravity=0.0, rate=0.0), "drive", 2.0)


def test_a_locked_mechanism_rests_where_it_is():
    """A driven four-bar of rigid bars has no freedom: nothing to linearise, and no load to balance."""
    system = fm.compile(m.four_bar(prescribed=s.Constant(value=1.0)))
    found = fm.equilibrium(system)
    assert found.q == pytest.approx(system.initial_state.q, abs=1e-13)
    model, dependent = fm.linearize(system, found), ["pin.rotation", "pivot.rotation"]
    assert model.A.shape == (0, 0)
    assert [name for name, _ in model.outputs[:4]] == dependent + [f"{name}.rate" for name in dependent]


def test_truncation_of_a_closed_chain():
    """Its beams get more modes, and the independent coordinates may be others."""
    from flexmb.linear.truncation import truncation

    scene = two_arms("revolute closure")

    def linear(system: fm.System) -> LinearModel:
        return fm.linearize(system, fm.equilibrium(system), held=True)

    cut = truncation(linear(fm.compile(scene)), scene, linear)
    assert cut.likeness[0] > 0.999 and abs(cut.change[0]) < 1e-3


def test_singular_positions_are_refused():
    system = fm.compile(m.four_bar(m.FourBar(0.3, 1.0, 0.3, 1.0), crank=0.8))
    flat = system.state(np.zeros(3), np.array([0.0, 0.0, 0.0]))
    with pytest.raises(fm.DynamicsError, match="singular"):
        fm.linearize(system, flat)


def test_open_states_are_refused():
    system = fm.compile(m.four_bar())
    start = system.initial_state
    with pytest.raises(fm.ClosureError, match='closure "loop"'):
        fm.linearize(system, replace(start, q=start.q + np.array([0.3, 0.0, 0.0])))


def test_ruthless_bodies_between_closures_are_refused():
    scene = m.four_bar(modes=1)
    bodies = tuple(msgspec.structs.replace(body, level="ruthless") for body in scene.bodies)
    with pytest.raises(NotImplementedError, match="ruthless"):
        fm.linearize(msgspec.structs.replace(scene, bodies=bodies))
