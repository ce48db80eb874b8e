"""Closures that suppress nothing, or what others suppress already: rank, mobility, accelerations and loads against one
dense system of equations, whose rank is read from a gap in its singular values."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

import flexmb
from flexmb.closure import closures as closure_system
from flexmb.closure.null_loads import blocks
from flexmb.dense import DenseSystem
from flexmb.dense.closures import open_loads, wrenches
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.shapes import beam_section
from flexmb.tables.status import Status
from tests.bounds import algebra
from tests.flexmb.closure import chains, loops

ZERO, MOVING = 1e-10, 1e-6  # singular values of J, of entries of size 1: none lies between
FEW, ALL = 12, 500


def check(seed: int, kinds: tuple[str, ...] = loops.KINDS) -> None:
    scene = loops.random_loops(seed, kinds)
    system = flexmb.compile(scene)
    if not can_move(scene):
        with pytest.raises(flexmb.ClosureError, match="no speeds keep it closed"):
            system.initial_state  # noqa: B018
        return
    state = system.initial_state
    dense = chains.constrained(scene, state.q, state.u)
    U, values, Vt = np.linalg.svd(dense.J)
    rank = int(np.sum(values > ZERO))
    assert np.all((values < ZERO) | (values > MOVING)), values
    assert (system.closures.rank, system.closures.mobility) == (rank, np.sum(dense.free) - rank)

    bound = algebra(system.nu + len(dense.J), len(scene.bodies) + len(scene.point_masses))
    condition = 1.0 / np.min(values[:rank], initial=1.0)  # rows are closed to rounding, redundant ones to this more
    wrench = wrenches(DenseSystem(scene), state.q)
    determined = system.determined_loads(state)
    for algorithm in ("articulated", "composite"):
        found = system.evaluate(0.0, state.q, state.u, algorithm)
        rates = found.accelerations[dense.free]
        size = np.sum(np.abs(found.accelerations)) + np.sum(np.abs(state.u)) ** 2  # of ports, times lengths of 1 m
        assert np.max(np.abs(dense.J @ rates + dense.gamma)) <= bound * size * condition
        # what is left of the tree's equations is a load of closures, and the least of these is what they report
        missing = dense.M @ rates - dense.right
        size = np.max(np.abs(dense.M) @ np.abs(rates) + np.abs(dense.right))
        assert np.max(np.abs(Vt[rank:] @ missing), initial=0.0) <= bound * size * condition  # of Vt itself
        least = U[:, :rank] @ (Vt[:rank] @ missing / values[:rank])
        motion = system.constraints._motion(*system.layout.packed(0.0, state.q, state.u), algorithm)
        for closure, load in zip(scene.closures, motion.closures, strict=True):
            expected = wrench[closure.name] @ least
            assert np.max(np.abs(load - expected)) <= bound * size * condition**2
            known = determined[closure.name]
            assert np.array_equal(np.isnan(found.loads[closure.name]), ~known)
            assert np.array_equal(found.loads[closure.name][known], load[known])
    for closure in scene.closures:
        share = np.max(np.abs(wrench[closure.name] @ U[:, rank:]), axis=1, initial=0.0)
        clear = (share < 1e-10) | (share > 1e-5)
        assert np.array_equal(determined[closure.name][clear], share[clear] < 1e-10), closure
    by_dense = open_loads(DenseSystem(scene), state.q, ~dense.free)
    assert {name for name, each in determined.items() if not each.all()} == {
        name for name, load in by_dense.loads.items() if load.any()
    }
    for name, load in by_dense.loads.items():
        assert np.array_equal(load, ~determined[name]), name


def can_move(scene: s.Scene) -> bool:
    """Whether any speeds follow the prescribed ones without opening a closure."""
    start = flexmb.System(scene).initial_state
    dense = chains.constrained(scene, start.q, start.u)
    U, values, _ = np.linalg.svd(dense.J)
    rest = U[:, int(np.sum(values > ZERO)) :].T @ dense.rate
    return bool(np.max(np.abs(rest), initial=0.0) < ZERO)


@pytest.mark.parametrize("seed", range(FEW))
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_random_loops(seed):
    check(seed)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_random_lines_and_planes(seed):
    check(seed, loops.LATER)


@pytest.mark.slow
@pytest.mark.parametrize("start", range(FEW, ALL, 25))
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_many_random_loops(start):
    for seed in range(start, start + 25):
        check(seed)


def test_every_kind_and_every_situation_is_among_them():
    scenes = [loops.random_loops(seed, kinds) for seed in range(FEW) for kinds in (loops.KINDS, loops.LATER)]
    assert {closure.type for scene in scenes for closure in scene.closures} == set(loops.EVERY)
    pairs = {tuple(sorted((closure.body_a, closure.body_b))) for scene in scenes for closure in scene.closures}
    assert {("r0", "r1"), ("ground", "r1"), ("r1", "r2")} <= pairs


@pytest.mark.parametrize("seed", range(8))
def test_a_closure_that_forbids_what_a_hinge_is_driven_to_is_refused(seed):
    with pytest.raises(flexmb.ClosureError, match="no speeds keep it closed"):
        flexmb.compile(loops.contradictory(seed)).initial_state  # noqa: B018


def test_rows_that_are_compared_with_noise_are_noticed(monkeypatch):
    """The rule that was: a row counts in the size of its closure's rows. Null closures then restrain."""
    linearise = closure_system.dynamics.linearise

    def by_own_rows(t, y, chain):
        status = linearise(t, y, chain)
        rows = np.concatenate([np.linalg.norm(block.half, axis=1) for block in blocks(chain.cc, chain.cw)])
        own = chain.cc.weight * rows
        for closure in chain.cc.closure:
            rows = slice(closure["row_start"], closure["row_stop"])
            chain.cw.size[rows] = np.linalg.norm(own[rows])
        return status

    monkeypatch.setattr(closure_system.dynamics, "linearise", by_own_rows)
    assert any(_rank(pendulum(kind)) > 0 for kind in loops.EVERY)


def _rank(scene: s.Scene) -> int:
    system = flexmb.compile(scene)
    system.initial_state  # noqa: B018  (counts the rows)
    return int(system.closures.rank)


def pendulum(kind: str | None, *, driven: s.Function | None = None) -> s.Scene:
    """A pendulum of two bodies that move as one, or one of which is driven against the other, and a closure."""
    scene = SceneBuilder("pendulum", gravity=(0.0, -9.81, 0.0))
    for name in ("a", "b"):
        scene.rigid_body(name, mass=1.0, com=(0.1, 0, 0), inertia=(0.01, 0.02, 0.025), nodes={"tip": (0.5, 0.1, 0.03)})
    scene.revolute("h", "ground", "a", axis=(0.6, 0.0, 0.8), angle=0.3, rate=1.0)
    if driven:
        scene.revolute("turn", "a", "b", parent_node="tip", prescribed=driven)
    else:
        scene.weld("w", "a", "b", parent_node="tip")
    if kind:
        scene.closure("null", kind, "a", "b", node_a="tip")
    return scene.scene()


@pytest.mark.parametrize("kind", loops.EVERY)
def test_between_welded_bodies_a_closure_restrains_nothing(kind):
    tree, system = flexmb.compile(pendulum(None)), flexmb.compile(pendulum(kind))
    state = system.initial_state
    assert (system.closures.rank, system.closures.mobility) == (0, 1)
    expected = tree.accelerations(tree.initial_state)
    for algorithm in ("articulated", "composite"):
        assert np.array_equal(system.accelerations(state, algorithm), tree.accelerations(state, algorithm))
    assert np.allclose(expected, tree.accelerations(state), rtol=1e-14)
    free, closed = flexmb.simulate(tree, 1.0, samples=5), flexmb.simulate(system, 1.0, samples=5)
    assert closed.finished and np.max(np.abs(closed.q - free.q)) < 1e-12
    assert np.any(closed.undetermined["null"])
    assert np.all(np.nan_to_num(closed.loads["null"]) == 0.0)


@pytest.mark.parametrize("kind", ["revolute", "spherical", "planar"])
@pytest.mark.parametrize("stabilise", [0.0, 20.0])
def test_a_hinge_may_be_driven_inside_a_null_loop(kind, stabilise):
    motion = s.Sine(amplitude=0.5, angular_frequency_rad_s=3.0)
    free = flexmb.simulate(pendulum(None, driven=motion), 1.0, samples=5)
    run = flexmb.simulate(pendulum(kind, driven=motion), 1.0, samples=5, stabilise=stabilise)
    assert run.finished, run.message
    assert np.max(np.abs(run.u - free.u)) < 1e-11 * np.max(np.abs(free.u))


@pytest.mark.parametrize("stabilise", [0.0, 20.0])
def test_a_drive_that_tears_a_null_loop_open_stops_the_run(stabilise):
    motion = s.SmoothStep(start_value=0.0, end_value=1.0, start_s=0.5, duration_s=1.0)
    run = flexmb.simulate(pendulum("weld", driven=motion), 1.0, stabilise=stabilise)
    assert run.status is Status.CLOSURE_OPEN and 0.5 <= run.stopped_at < 0.7 and '"null"' in run.message


def test_a_node_at_which_a_flexible_body_is_held_does_not_move():
    """Its modes feel a load there less the reaction of the hinge: both cancel, however soft the beam."""
    section = beam_section(E=2e9, G=8e8, A=9e-4, Iy=8e-8, Iz=5e-8, rho=1500.0)
    scene = SceneBuilder("held", gravity=(0.0, -9.81, 0.0))
    scene.beam("beam", length=1.1, elements=4, section=section, modes=4)
    turn = np.array([0.9, 0.1, -0.3, 0.2])
    scene.weld("hold", "ground", "beam", child_node="tip", parent_quaternion=turn / np.linalg.norm(turn))
    scene.modal_state("beam", coordinates=[0.01, 0.02, -0.01, 0.005], rates=[0.0] * 4)
    tree = flexmb.compile(scene.scene())
    for kind in loops.EVERY:
        closure = loops.parallel("null", kind, scene.scene().hinges[0], scene.scene())
        system = flexmb.compile(msgspec.structs.replace(scene.scene(), closures=(closure,)))
        state = system.initial_state
        assert (system.closures.rank, system.closures.mobility) == (0, 4)
        for algorithm in ("articulated", "composite"):
            assert np.array_equal(system.accelerations(state, algorithm), tree.accelerations(state, algorithm))


def test_a_tree_without_freedom_is_not_locked_by_a_null_closure():
    scene = SceneBuilder("still", gravity=(0.0, -9.81, 0.0))
    scene.rigid_body("a", mass=1.0, inertia=(0.01, 0.02, 0.025)).weld("w", "ground", "a")
    scene.closure("null", "weld", "ground", "a")
    run = flexmb.simulate(scene.scene(), 1.0, samples=3)
    assert run.finished and {"null", "w"} <= set(run.undetermined)  # who of the two holds it nobody knows
    assert np.all(np.isnan(run.loads["null"])) and np.all(np.isnan(run.loads["w"]))
