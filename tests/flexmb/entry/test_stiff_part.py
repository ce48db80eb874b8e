"""The stiff part of the equations of motion, solved by the recursion, against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb
from flexmb.entry import stiff_part
from flexmb.scene.build import SceneBuilder
from flexmb.tables.state import pack
from tests import trees
from tests.bounds import algebra

RECIPES = {
    "rigid": trees.ARMED_RIGID,
    "full": trees.FULL,
    "linear": trees.LINEAR,
    "ruthless": trees.RUTHLESS,
    "stiffened": trees.STIFFENED,
    "exact": trees.EXACT,
    "later kinds": trees.LATER,
}
SHIFTS = {"real": (0.02, 4e-4), "complex": (0.02 - 0.01j, (0.02 - 0.01j) ** 2)}


def tables(system: flexmb.System) -> stiff_part.StiffPart:
    """The stiff part of a system at its initial state."""
    part = stiff_part.stiff_part(system.constants, system.nq, system.nu)
    state = system.initial_state
    assert stiff_part.settle_at(state.t, pack(state), part) == 0
    return part


def blocks(system: flexmb.System, part: stiff_part.StiffPart) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """K and D (nu,nu), and the place in q of the coordinate of each speed, -1 where it has none of its own."""
    c = system.constants
    K, D, place = np.diag(part.stiffness), np.diag(part.damping), c.speed["coordinate"].copy()
    for k, body in enumerate(c.body):
        m, first = int(body["modes"]), int(body["etad_index"])
        own = slice(first, first + m)
        K[own, own], D[own, own] = c.stiffness[k, :m, :m], c.damping[k, :m, :m]
        place[own] = body["eta_index"] + np.arange(m)
    return K, D, place


@pytest.mark.parametrize("recipe", RECIPES)
@pytest.mark.parametrize("shift", SHIFTS)
def test_solution(recipe, shift):
    """(M + a D + b K) x = K q + D u, for the free speeds, with an error like that of the mass matrix."""
    a, b = SHIFTS[shift]
    for seed in range(3):
        system = flexmb.compile(trees.random_scene(seed, RECIPES[recipe]))
        part = tables(system)
        K, D, place = blocks(system, part)
        rng = np.random.default_rng(seed)
        q, u = (rng.standard_normal(n) + 1j * rng.standard_normal(n) for n in (system.nq, system.nu))
        free = np.flatnonzero(system.constants.speed["prescribed"] < 0)
        E = (system.mass_matrix(system.initial_state) + a * D + b * K)[np.ix_(free, free)]
        force = (K @ np.where(place >= 0, q[place], 0.0) + D @ u)[free]
        x = u.copy()
        for second in (0, 1):
            assert stiff_part.shift(complex(a), complex(b), second, part) == 0
            x[:] = u
            stiff_part.restore(q, x, second, part)
            size = np.abs(E).sum(axis=1).max() * np.abs(x).max() + np.abs(force).max()
            points = max(stop - start for start, stop in zip(*points_of(system), strict=True))
            bound = 8.0 * algebra(len(free), len(system.links), points)  # a complex product rounds three times
            assert np.abs(E @ x[free] - force).max() <= bound * size, (recipe, seed)
            assert not np.any(np.delete(x, free))


def points_of(system: flexmb.System) -> tuple[np.ndarray, np.ndarray]:
    """First and last inertia point of each body."""
    return system.constants.body["point_start"], system.constants.body["point_stop"]


def test_motion():
    """`along` gives the rates of the coordinates at given speeds: those of the right-hand side where it has them."""
    system = flexmb.compile(trees.random_scene(3, trees.FULL))
    part, state = tables(system), system.initial_state
    free = system.constants.speed["prescribed"] < 0
    u = np.where(free, state.u, 0.0)
    y, dy, w = pack(state), np.zeros(system.nq + system.nu + 1), system.workspace()
    system.rhs(state.t, y, dy, system.constants, w)
    moved = dy[: system.nq].copy()
    moved[system.constants.speed["coordinate"][~free]] = 0.0
    found = np.zeros(system.nq, complex)
    assert stiff_part.shift(0.01 + 0j, 1e-4 + 0j, 0, part) == 0
    stiff_part.along(u.astype(complex), found, part)
    np.testing.assert_allclose(found.real, moved, rtol=0.0, atol=1e-15 * max(1.0, np.abs(moved).max()))
    assert not np.any(found.imag)


def test_laws_of_hinges():
    """Stiffness and damping of a table, a stop and a damper are the slopes of their laws at the state."""
    scene = SceneBuilder("laws", gravity=(0, 0, 0)).rigid_body("a", mass=1.0, inertia=(1, 1, 1))
    scene.rigid_body("b", mass=1.0, inertia=(1, 1, 1))
    scene.revolute("turn", "ground", "a", angle=0.3, rate=0.7, stiffness=5.0, damping=2.0)
    scene.prismatic("slide", "a", "b", position=0.25, rate=0.1)
    scene.linear_spring("law", "slide", table=(-1.0, 0.0, 1.0), loads=(-10.0, 0.0, 30.0), damping=3.0)
    system = flexmb.compile(scene.scene())
    part = tables(system)
    step, state = 1e-6, system.initial_state

    def force(q: np.ndarray, u: np.ndarray) -> np.ndarray:
        return system.applied(system.state(q, u))

    for j in range(system.nu):
        e = step * np.eye(system.nu)[j]
        stiffness = -(force(state.q + e, state.u) - force(state.q - e, state.u))[j] / (2 * step)
        damping = -(force(state.q, state.u + e) - force(state.q, state.u - e))[j] / (2 * step)
        assert part.stiffness[j] == pytest.approx(stiffness, rel=1e-8)
        assert part.damping[j] == pytest.approx(damping, rel=1e-8)
    assert np.all(part.damping > 0.0)


def test_completeness():
    """Forces between frames and the isotropic spring of a ball are not in the stiff part: these need Jacobians."""

    def base() -> SceneBuilder:
        return SceneBuilder("s", gravity=(0, 0, -9.81)).rigid_body("a", mass=1.0, inertia=(1, 1, 1))

    held = base().spherical("ball", "ground", "a")
    sprung = base().spherical("ball", "ground", "a", stiffness=3.0)
    tied = base().spherical("ball", "ground", "a")
    tied.spring_damper("tie", "ground", "a", position_a=(1, 0, 0), stiffness=2.0)
    found = [stiff_part.is_complete(flexmb.compile(each.scene()).constants) for each in (held, sprung, tied)]
    assert found == [True, False, False]
