"""Every way to eliminate the modes of a body gives the same motion; which one is used, and what it prepares."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, partial

import msgspec
import numpy as np
import pytest

import flexmb
from flexmb.dense import DenseSystem
from flexmb.jain.condensed import semidefinite_root
from flexmb.jit.counting import count
from flexmb.scene import schema
from flexmb.scene.build import SceneBuilder
from flexmb.scene.modal_data import inertia_points
from flexmb.scene.shapes import beam_section
from flexmb.tables.features import SEVERAL, contained
from tests import trees
from tests.benchmarks.rivals import flexible_chain
from tests.bounds import UNIT_ROUNDOFF, algebra, backward_error, gamma

# One wheel, prescribed: a free one would leave only the explicit form.
CLAMPED = replace(
    trees.FULL, bodies=8, wheels=1, at_clamps=True, carriers=("modal", "masses", "beam", "rigid", "floating")
)
RECIPES = {
    "ruthless": replace(CLAMPED, levels=("ruthless",)),
    "hinges at deforming nodes": replace(trees.RUTHLESS, bodies=8, wheels=0, point_masses=0),
    "full": replace(CLAMPED, carriers=("masses", "rigid", "masses")),
    "linear": replace(CLAMPED, carriers=("masses", "masses", "beam"), levels=("linear",), deformation=0.02),
    "every level": replace(CLAMPED, levels=("linear", "full", "ruthless"), deformation=0.02),
}
SEEDS = range(3)
ELIMINATIONS = ("woodbury", "condensed")


@dataclass(frozen=True)
class Found:
    """A random tree with its dense equations, whose modes are eliminated in one way."""

    system: flexmb.System
    explicit: flexmb.System
    state: flexmb.State
    M: np.ndarray
    bias: np.ndarray
    bound: float

    @property
    def nodes(self) -> np.ndarray:
        """By reduced body, the hinges of outboard bodies at deforming nodes."""
        body = self.system.recursion_constants.body
        return body["nodes"][body["elimination"] > 0]


@cache
def dense_equations(name: str, seed: int) -> tuple[schema.Scene, flexmb.System, np.ndarray, np.ndarray, float]:
    """A random scene, its system in explicit form, M and bias at the initial state, and the bound of two routes."""
    scene = trees.random_scene(seed, RECIPES[name])
    explicit, dense = flexmb.compile(scene, "explicit"), DenseSystem(scene)
    state = explicit.initial_state
    bound = algebra(dense.nu, len(dense.tree.members), max(len(member.model.mass) for member in dense.tree.members))
    return scene, explicit, dense.mass_matrix(state.q), dense.bias(state.q, state.u), bound


@pytest.fixture(
    scope="module", ids=str, params=[(name, seed, form) for name in RECIPES for seed in SEEDS for form in ELIMINATIONS]
)
def found(request) -> Found:
    name, seed, elimination = request.param
    scene, explicit, M, bias, bound = dense_equations(name, seed)
    system = flexmb.compile(scene, elimination)
    return Found(system, explicit, system.initial_state, M, bias, bound)


def test_accelerations_solve_the_dense_equations(found):
    """(63), (64) with (B3) or condensed: backward error within n u, as with a factor of D_f."""
    free = found.system.constants.speed["prescribed"] < 0
    right = (found.system.applied(found.state) - found.bias)[free]
    rates = found.system.accelerations(found.state)
    assert backward_error(found.M[free], rates, right) <= gamma(found.system.nu)
    assert np.array_equal(rates[~free], found.explicit.accelerations(found.state)[~free])


def test_everything_observable_is_that_of_the_explicit_form(found):
    """P_R and z_R of (63), (64) carry loads and drives: in the size of what cancels in them."""
    q, u = found.state.q, found.state.u
    ours, theirs = (system.evaluate(0.0, q, u) for system in (found.system, found.explicit))
    free = found.system.constants.speed["prescribed"] < 0
    condition = float(np.linalg.cond(found.M[np.ix_(free, free)]))
    size = np.max(np.abs(found.M) @ np.abs(theirs.accelerations) + np.abs(found.bias)) * condition * found.bound
    for kind in ("loads", "drives"):
        for name, load in getattr(theirs, kind).items():
            assert np.max(np.abs(getattr(ours, kind)[name] - load)) <= size


def test_the_trees_have_what_reduction_must_handle():
    """Interior bodies, several nodes of one body, tips, and bodies that are left to the explicit form."""
    nodes, chosen, floating = set[int](), set[str](), 0
    for recipe in RECIPES.values():
        for seed in SEEDS:
            system = flexmb.compile(trees.random_scene(seed, recipe), "condensed")
            body = system.recursion_constants.body
            nodes |= set(body["nodes"][body["elimination"] > 0].tolist())
            chosen |= set(system.elimination.values())
            floating += np.count_nonzero((body["elimination"] > 0) & (body["outboard_port"] >= 0))
    assert {0, 1, 2} <= nodes
    assert floating > 0
    assert chosen == {"explicit", "condensed"}


@pytest.mark.parametrize("name", ["ruthless", "linear", "full", "every level"])
@pytest.mark.parametrize("seed", range(2))
def test_unsplit_recursion(name, seed):
    """(58) against the dense equations and the split form: free-free modes, any hinge, free wheels, prescriptions."""
    recipe = {"ruthless": trees.RUTHLESS, "linear": trees.LINEAR, "full": trees.FULL, "every level": trees.EVERY_LEVEL}
    scene = trees.random_scene(seed, replace(recipe[name], deformation=0.02))
    system, dense = flexmb.compile(scene, "explicit"), DenseSystem(scene)
    state = system.initial_state
    M, bias = dense.mass_matrix(state.q), dense.bias(state.q, state.u)
    free = system.constants.speed["prescribed"] < 0
    rates = system.accelerations(state, algorithm="unsplit")
    assert backward_error(M[free], rates, (system.applied(state) - bias)[free]) <= gamma(system.nu)
    ours, theirs = (system.evaluate(0.0, state.q, state.u, form) for form in ("unsplit", "articulated"))
    condition = float(np.linalg.cond(M[np.ix_(free, free)]))
    size = np.max(np.abs(M) @ np.abs(rates) + np.abs(bias)) * condition * algebra(dense.nu, len(dense.tree.members))
    for kind in ("loads", "drives"):
        for name, load in getattr(theirs, kind).items():
            assert np.max(np.abs(getattr(ours, kind)[name] - load)) <= size


def test_tables_that_follow_the_deformation():
    """Beams, two of them on one node of a third: backward error within n u against the dense equations."""
    scene = SceneBuilder("fork", gravity=(0.0, 0.0, -9.81))
    section = beam_section(E=7e10, G=2.7e10, A=1e-3, Iy=2e-7, Iz=1e-7, rho=2700.0)
    for name, parent in (("handle", "ground"), ("left", "handle"), ("right", "handle"), ("end", "left")):
        scene.beam(name, length=2.0, elements=4, section=section, modes=schema.Modes(count=5), level="full")
        at = {} if parent == "ground" else {"parent_node": "tip"}
        scene.revolute(f"to {name}", parent, name, axis=(0.0, 0.6, 0.8), child_node="root", angle=0.3, rate=0.2, **at)
    system = flexmb.compile(scene.scene(), "condensed")
    assert set(system.elimination.values()) == {"condensed"}
    rng, state = np.random.default_rng(4), system.initial_state
    q, u = state.q + 0.002 * rng.normal(size=system.nq), state.u + rng.normal(size=system.nu)
    state = replace(state, q=q, u=u)
    dense = DenseSystem(system.scene)
    M, bias = dense.mass_matrix(q), dense.bias(q, u)
    error = backward_error(M, system.accelerations(state), system.applied(state) - bias, np.abs(bias))
    assert error <= gamma(system.nu)


@pytest.mark.parametrize(
    ("level", "modes", "expected"),
    [("ruthless", 10, "explicit"), ("ruthless", 11, "condensed"), ("full", 17, "explicit"), ("full", 18, "condensed")],
)
def test_the_fastest_form_by_rule(level, modes, expected):
    system = flexmb.compile(flexible_chain(2, modes, level))
    assert set(system.elimination.values()) == {expected}


def arm(masses: np.ndarray, hinge_node: str = "origin", level: str = "ruthless", **wheel) -> schema.Scene:
    """A body of three points with two modes that move the points along x, on a revolute hinge."""
    shapes = np.zeros((3, 3, 2))
    shapes[:, 0, 0], shapes[:, 0, 1] = (1.0, 2.0, 1.0), (1.0, 1.0, 3.0)
    points = inertia_points(masses, np.array([[0.5, 0, 0], [1, 0.2, 0], [1.5, 0, 0.1]]), shapes)
    tip = schema.ModalNode(
        name="tip", position_m=(2.0, 0.0, 0.0), translation_modes=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        rotation_modes=((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    )  # fmt: skip
    scene = SceneBuilder("arm")
    scene.modal_body("arm", points=points, stiffness=np.eye(2), level=level, nodes=[tip])
    scene.revolute("root", "ground", "arm", child_node=hinge_node)
    if wheel:
        scene.wheel("wheel", "arm", node="tip", mass=1.0, axial_inertia=1.0, transverse_inertia=1.0, **wheel)
    return scene.scene()


MASSES = np.array([1.0, 2.0, 3.0])
TURN = schema.Constant(value=1.0)


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        (arm(MASSES), "condensed"),
        (arm(MASSES, level="full"), "explicit"),  # its modes are not orthogonal
        (arm(MASSES, axis=(0.0, 0.0, 1.0), prescribed=schema.Constant(value=1.0)), "condensed"),
        (arm(MASSES, axis=(0.0, 0.0, 1.0)), "explicit"),  # a free wheel takes a rank-one part out of D_f
        (arm(MASSES, level="full", axis=(0.0, 0.0, 1.0), prescribed=schema.Constant(value=1.0)), "explicit"),
        (arm(np.array([1.0, 1e-9, 1e-9])), "explicit"),  # modal masses that only a factorisation handles
        (arm(MASSES, hinge_node="tip"), "condensed"),
        (arm(MASSES, hinge_node="tip", level="linear"), "explicit"),  # D_f has the moving rigid inertia in it
    ],
)  # fmt: skip
def test_where_condensing_applies(scene, expected):
    assert flexmb.compile(scene, "condensed").elimination == {"arm": expected}


def test_the_woodbury_form_is_for_constant_tables():
    """(B3) belongs to Appendix B."""
    assert flexmb.compile(arm(MASSES), "woodbury").elimination == {"arm": "woodbury"}
    assert flexmb.compile(arm(MASSES, level="full"), "woodbury").elimination == {"arm": "explicit"}


@pytest.mark.parametrize(
    ("hinge", "node", "general"),
    [
        (schema.Revolute, "origin", False),
        (schema.Prismatic, "origin", False),
        (schema.Spherical, "origin", True),
        (schema.Weld, "origin", True),
        (partial(schema.Revolute, rotation=schema.AngularCoordinate(prescribed_rad=TURN)), "origin", True),
        (schema.Revolute, "tip", True),
    ],
)
def test_which_hinges_need_a_matrix(hinge, node, general):
    """The table in `flexmb.jain`: D_R of a single axis is a number, of all other hinges a matrix."""
    hinges = (hinge(name="root", parent="ground", child="arm", child_node=node),)
    system = flexmb.compile(msgspec.structs.replace(arm(MASSES), hinges=hinges))
    assert (SEVERAL in contained(system.constants)) == general


def test_constants_of_appendix_b():
    """(B4) at rest: zeta, Theta and Omega from the modal mass matrix and the shapes of the node."""
    system = flexmb.compile(flexible_chain(2, 6, "ruthless"), "condensed")
    c = system.recursion_constants
    M_ff, M_fr = c.mff[0, :6, :6], c.mfr[0, :, :6].T
    port = c.node["port"][0, 0]
    Pi = c.port_mode[port, :, :6]
    phi = np.eye(6)
    phi[3:, :3] = -np.cross(np.eye(3), c.port["position"][port])  # - r~
    bound = gamma(36) * np.linalg.cond(M_ff)
    root = c.root[0, : c.rank[0]]
    omega = Pi @ np.linalg.solve(M_ff, Pi.T)
    np.testing.assert_allclose(root.T @ root, omega, rtol=0.0, atol=bound * np.max(np.abs(omega)))
    theta = phi - Pi @ np.linalg.solve(M_ff, M_fr)
    np.testing.assert_allclose(c.node["theta"][0, 0], theta, rtol=0.0, atol=bound * np.max(np.abs(theta)))
    zeta = M_fr.T @ np.linalg.solve(M_ff, M_fr)
    diagonal = c.zeta[0][[0, 1, 2, 15, 16, 17]]
    np.testing.assert_allclose(diagonal, np.diag(zeta), rtol=0.0, atol=bound * np.max(np.abs(zeta)))
    assert c.node["theta"].shape == (2, 1, 6, 6)
    assert c.body["nodes"].tolist() == [1, 0]


@pytest.mark.parametrize("rank", range(7))
def test_root_of_a_semidefinite_matrix(rank):
    """Whatever the units of its rows; the rank is found."""
    rng = np.random.default_rng(rank)
    units = 10.0 ** rng.uniform(-4, 4, 6)
    factor = rng.normal(size=(6, rank)) * units[:, None]
    a = factor @ factor.T
    counted = count(semidefinite_root, a, np.zeros(6), np.zeros((6, 6)), 6)
    root = counted.arguments[2].astype(float)
    assert counted.result == rank
    error = np.abs(root[:rank].T @ root[:rank] - a) / np.sqrt(np.outer(np.diag(a), np.diag(a)) + (rank == 0))
    assert np.max(error) <= 6 * 16 * UNIT_ROUNDOFF
