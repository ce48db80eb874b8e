"""Static and relative equilibria against closed forms, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

import flexmb as fm
from flexmb.linear.equations import entering
from flexmb.linear.variations import Equations
from flexmb.scene.files import load_scene
from flexmb.scene.shapes import beam_section
from tests import trees
from tests.bounds import UNIT_ROUNDOFF
from tests.repo.project import ROOT

ROUNDING = 2.0**10 * UNIT_ROUNDOFF
LOOPS = ROOT / "cases" / "closed_chains"
G = 9.81


def pendulum(angle: float, **hinge) -> fm.Scene:
    return (
        fm.SceneBuilder("pendulum", gravity=(0.0, 0.0, -G))
        .rigid_body("bob", mass=2.0, com=(0.7, 0.0, 0.0), inertia=(0.05, 0.05, 0.05))
        .revolute("pivot", "ground", "bob", axis=(0.0, 1.0, 0.0), angle=angle, **hinge)
        .scene()
    )


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.5, 3.0])
def test_pendulum_hangs(angle):
    """Also from where Newton's method has no direction to go (0: gravity does not stiffen)."""
    found = fm.equilibrium(pendulum(angle))
    assert found.q[0] == pytest.approx(np.pi / 2, rel=ROUNDING)
    assert fm.linearize(fm.compile(pendulum(angle)), found).stability.verdict == "neutral"


def test_pendulum_on_a_spring():
    """k theta = m g l cos(theta), starting at speed: an equilibrium has none."""
    found = fm.equilibrium(pendulum(0.0, stiffness=15.0, rate=2.0))
    expected = brentq(lambda x: 15.0 * x - 2.0 * G * 0.7 * np.cos(x), 0.0, 1.5, xtol=1e-15)
    assert found.q[0] == pytest.approx(expected, rel=ROUNDING)
    assert not found.u.any()


@pytest.mark.parametrize("level", ["ruthless", "full", "stiffened"])
def test_cantilever_sags(level):
    """K eta = gravity on the modes, at levels where nothing stiffens; Euler's w = rho A g L^4 / 8 EI at its tip."""
    section = beam_section(E=7e10, G=2.7e10, A=1e-3, Iy=2e-7, Iz=1e-7, rho=2700.0)
    scene = (
        fm.SceneBuilder("cantilever", gravity=(0.0, -0.01, 0.0))
        .beam("beam", length=8.0, elements=16, section=section, modes=8, level=level, points="line")
        .weld("clamp", "ground", "beam")
        .marker("tip", "beam", node="tip")
        .scene()
    )
    system = fm.compile(scene)
    found = fm.equilibrium(system)
    tip = system.evaluate(found.t, found.q, found.u).markers["tip"].position
    w = 2.7 * 0.01 * 8.0**4 / (8.0 * 7e10 * 1e-7)
    # markers move with the true deformation; four bending modes a plane leave out 1e-5 of it, finite deflection w^2/L^2
    assert tip[1] == pytest.approx(-w, rel=1e-4)
    model = fm.linearize(system, found, held=True)
    assert np.max(np.abs(model.rates)) <= ROUNDING * np.max(np.abs(model.A)) * np.max(np.abs(found.q))


@pytest.mark.parametrize("seed", range(8))
def test_random_trees_come_to_rest(seed):
    """Springs, balls, modes, wheels without springs, point masses, gravity: nothing accelerates any more."""
    hinges = ("spherical", "revolute", "prismatic", "universal")
    recipe = replace(trees.CONSERVATIVE, hinges=hinges, bodies=5, point_masses=1)
    system = fm.compile(trees.random_scene(seed, recipe))
    found = fm.equilibrium(system)
    model = fm.linearize(system, found, held=True)
    started = fm.linearize(system, system.initial_state, held=True)
    assert np.max(np.abs(model.rates)) <= 1e-9 * np.max(np.abs(started.rates))
    assert model.stability.verdict == "neutral"  # an undamped one that is stable
    wheel = system.coordinate("w0")
    assert found.q[wheel] == system.initial_state.q[wheel]


@pytest.mark.parametrize("case", ["tree", "four_bar", "flexible_four_bar"])
def test_tangent_stiffness_is_that_of_accelerations(case):
    """K = -(M d(udot) + dM udot), at constant loads of closures: by what no equilibrium needs."""
    scene = trees.random_scene(0, trees.CONSERVATIVE) if case == "tree" else load_scene(LOOPS / case / "scene.toml")
    equations, state = entering(fm.compile(scene), None)
    equations = equations.held(state.t)
    found, at, free = equations.forces(state), equations.variations(state), equations.free_variation(state)
    own, given, M = equations.free, free.accelerations.copy(), equations.mass(state)
    given[[j for j in range(len(given)) if j not in own]] = 0.0
    by_inertia = [
        equations.system.inverse_dynamics_derivatives(state, rates).by_displacement for rates in (given, 0.0 * given)
    ]
    left = M @ free.of_accelerations.by_displacement[np.ix_(own, own)] + np.subtract(*by_inertia)[np.ix_(own, own)]
    expected = -at.basis.T @ left @ at.basis
    assert np.max(np.abs(found.stiffness - expected)) < 1e-11 * np.max(np.abs(expected))
    load = at.basis.T @ M @ free.accelerations[own]
    assert np.max(np.abs(found.load - load)) < 1e-11 * np.max(np.abs(load))
    np.testing.assert_allclose(found.mass, at.mass, rtol=0.0, atol=1e-12 * np.max(np.abs(at.mass)))


def test_an_equilibrium_is_differentiated_once(monkeypatch):
    """Its stability is told from what Newton's method found there: one beam of many strains spends all its time so."""
    system = fm.compile(pendulum(0.3))
    state, calls, forces = fm.equilibrium(system), [], Equations.forces
    monkeypatch.setattr(Equations, "forces", lambda self, at: calls.append(at) or forces(self, at))
    assert fm.equilibrium(system, state).stability == state.stability
    assert len(calls) == 1


def test_what_falls_is_refused():
    scene = fm.SceneBuilder("stone", gravity=(0.0, 0.0, -G)).rigid_body("stone", mass=2.0, inertia=(1.0, 1.0, 1.0))
    with pytest.raises(fm.EquilibriumError, match=r"-19\.6 N.*fly\.position\.z"):
        fm.equilibrium(scene.free("fly", "ground", "stone").scene())


def test_a_closure_that_suppresses_nothing_changes_nothing():
    scene = (
        fm.SceneBuilder("loop")
        .rigid_body("bar", mass=1.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
        .revolute("h", "ground", "bar", stiffness=2.0)
    )
    bare = fm.linearize(scene.scene())
    closed = fm.linearize(scene.closure("c", "revolute", "ground", "bar").scene())
    assert closed.states == bare.states
    np.testing.assert_allclose(closed.A, bare.A, rtol=ROUNDING)


def bead(k: float = 50.0, gravity=(0.0, 0.0, 0.0)) -> fm.Scene:
    """A mass on a radial spring, at rest at radius 1."""
    return (
        fm.SceneBuilder("centrifuge", gravity=gravity)
        .rigid_body("rail", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .rigid_body("bead", mass=2.0, inertia=(0.1, 0.1, 0.1))
        .revolute("drive", "ground", "rail")
        .prismatic("slide", "rail", "bead", axis=(1, 0, 0), stiffness=k, rest=0.0, parent_position=(1, 0, 0))
        .marker("centre", "bead")
        .scene()
    )


def test_bead_on_a_spinning_rail():
    """r = k r0 / (k - m Omega^2); w^2 = k/m - Omega^2. The hinge is free in the scene, driven in the spin."""
    Omega = 3.0
    spin = fm.steady_spin(bead(), "drive", Omega)
    assert 1.0 + spin.state.q[1] == pytest.approx(50.0 / (50.0 - 2.0 * Omega**2), rel=ROUNDING)
    model = spin.linearize()
    assert model.displacements == ("slide.translation",)
    assert model.modes[0].frequency_rad_s == pytest.approx(np.sqrt(25.0 - Omega**2), rel=ROUNDING)


def test_spin_along_gravity_and_across():
    assert fm.steady_spin(bead(gravity=(0.0, 0.0, -G)), "drive", 2.0).state.q[1] > 0.0
    with pytest.raises(ValueError, match='"drive".*angle'):
        fm.steady_spin(bead(gravity=(0.0, -1e-3, 0.0)), "drive", 2.0)


def test_hinges_that_do_not_spin_are_named():
    with pytest.raises(ValueError, match="'slide'.*drive"):
        fm.steady_spin(bead(), "slide", 1.0)


def test_rail_too_fast_for_its_spring():
    """Above sqrt(k/m) the only equilibrium is on the other side, unstable."""
    spin = fm.steady_spin(bead(), "drive", 6.0)
    assert 1.0 + spin.state.q[1] == pytest.approx(50.0 / (50.0 - 2.0 * 36.0), rel=ROUNDING)
    assert spin.linearize().stability.verdict == "unstable"
    with pytest.raises(fm.EquilibriumError):
        fm.steady_spin(bead(), "drive", 5.0)


def test_linear_models_of_one_system_do_not_share_what_they_return():
    """They write to the same workspaces; what they return is a copy."""
    system = fm.compile(trees.random_scene(4))
    kept = ("A", "B", "C")
    model = fm.linearize(system)
    before = [getattr(model, name).copy() for name in kept]
    state = system.initial_state
    fm.linearize(system, system.state(state.q, state.u + 0.3, 0.2))
    for name, as_it_was in zip(kept, before, strict=True):
        np.testing.assert_array_equal(getattr(model, name), as_it_was)


def long_cantilever(polynomials: int) -> fm.Scene:
    """A beam of level exact, all but uniform, of so many polynomials of each strain, with a small load at its tip."""

    def station(x: float, EI: float) -> fm.BeamStation:
        return fm.BeamStation(
            x_m=x, EA_N=1e6, EIy_Nm2=EI, EIz_Nm2=EI, GJ_Nm2=3.0, mass_per_length_kg_m=0.4, rotary_y_kg_m=1e-8,
            rotary_z_kg_m=1e-8,
        )  # fmt: skip

    section = [station(0.0, 4.1), station(0.37, 4.1 * (1.0 + 1e-7)), station(1.0, 4.1)]
    return (
        fm.SceneBuilder("long cantilever")
        .beam("beam", length=1.0, elements=1, section=section, level="exact", modes=polynomials)
        .weld("clamp", "ground", "beam")
        .force("push", "beam", node="tip", direction=(0.0, 1.0, 0.0), function=fm.Constant(value=1e-3))
        .marker("tip", "beam", node="tip")
        .scene()
    )


def test_stiffness_below_the_rounding_of_the_largest_is_no_freedom():
    """F L^3 / 3 EI with 30 polynomials; with 34 the strains of bending are lost beside the highest of stretch, and what
    seemed to be an equilibrium lacked 97 % of it. A free body stays free: it has no stiffness, and no strain."""
    scene = long_cantilever(30)
    found = fm.equilibrium(scene)
    tip = fm.compile(scene).evaluate(found.t, found.q, found.u).markers["tip"].position
    assert tip[1] == pytest.approx(1e-3 / (3.0 * 4.1), rel=1e-6)
    with pytest.raises(ArithmeticError, match=r"below 1e-14 of the largest one.*fewer polynomials"):
        fm.equilibrium(long_cantilever(34))
