"""Loops that do not feel each other: their groups are solved by themselves as all are at once, at the cost of each."""

from __future__ import annotations

import numpy as np
import pytest

from flexmb.closure import closures as closure_system
from flexmb.closure import constants as closure_tables
from flexmb.closure import dynamics
from flexmb.jit.counting import count
from flexmb.scene.build import SceneBuilder, angular
from flexmb.scene.functions import Sine
from flexmb.scene.schema import Scene
from flexmb.scene.shapes import beam_section
from flexmb.system.compile import compile as compiled
from flexmb.system.system import System
from tests.bounds import algebra, relative
from tests.flexmb.closure.least import least_loads
from tests.flexmb.closure.mechanisms import FourBar

LINKS = "crank", "coupler", "rocker"
STRIP = beam_section(E=7e10, G=2.7e10, A=1e-3, Iy=8e-8, Iz=9e-8, rho=2700)


def four_bars(loops: int, base: str = "ground", kind: str = "revolute", level: str | None = None) -> Scene:
    """Four-bars side by side on the ground or on a base, each a bit different.

    The base is "welded", "driven" or "free", at the tip of a free "boom" that bends, or "bending" itself; the arm of a
    "jointed" one carries every other loop.
    """
    scene = SceneBuilder("four-bars", gravity=(0.0, -9.81, 0.0))
    root = "ground" if base == "ground" else "base"
    if base == "bending":
        scene.beam("base", length=1.0, elements=2, section=STRIP, modes=2)
    elif base != "ground":
        scene.rigid_body("base", mass=20.0, inertia=(1.0, 2.0, 2.5))
    match base:
        case "bending":
            scene.free("mount", "ground", "base", angular_velocity=(0.1, 0.2, 0.3))
        case "boom":
            scene.beam("boom", length=1.0, elements=2, section=STRIP, modes=2)
            scene.free("flight", "ground", "boom", angular_velocity=(0.1, 0.2, 0.3))
            scene.weld("mount", "boom", "base", parent_node="tip")
        case "jointed":
            scene.free("mount", "ground", "base", angular_velocity=(0.1, 0.2, 0.3))
            scene.rigid_body("arm", mass=5.0, com=(0.2, 0.0, 0.0), inertia=(0.1, 0.2, 0.2))
            scene.revolute("shoulder", "base", "arm", axis=(0.0, 1.0, 0.0), rate=0.3)
        case "welded":
            scene.weld("mount", "ground", "base")
        case "driven":
            turn = angular(prescribed=Sine(amplitude=0.1, angular_frequency_rad_s=3.0))
            scene.universal("mount", "ground", "base", first=turn, second=turn)
        case "free":
            scene.free("mount", "ground", "base", angular_velocity=(0.1, 0.2, 0.3))
    for i in range(loops):
        bars = FourBar(0.3 + 0.1 * np.sin(i), 0.8, 0.7 + 0.05 * np.cos(i), 1.0)
        coupler, rocker = bars.angles(1.0 + 0.2 * i)
        crank = 1.0 + 0.2 * i
        for name, length in zip(LINKS, bars[:3], strict=True):
            inertia = (1e-3, 0.1 * length, 0.1 * length)
            scene.rigid_body(f"{name}{i}", mass=length, com=(0.5 * length, 0, 0), inertia=inertia)
        if base == "jointed":
            root = ("base", "arm")[i % 2]
        side = {"parent_position": (0.0, 0.0, 0.1 * i)}
        scene.revolute(f"drive{i}", root, f"crank{i}", angle=crank, rate=1.0 + 0.1 * i, **side)
        scene.revolute(f"pin{i}", f"crank{i}", f"coupler{i}", parent_position=(bars.crank, 0, 0), angle=coupler - crank)
        pivot = {"parent_position": (bars.ground, 0, 0.1 * i)}
        if base == "bending":
            pivot = {"parent_node": "tip", "parent_position": (0.0, 0.0, 0.1 * i)}
        scene.revolute(f"pivot{i}", root, f"rocker{i}", angle=rocker, **pivot)
        ends = {"position_a": (bars.coupler, 0, 0), "position_b": (bars.rocker, 0, 0)}
        scene.closure(f"loop{i}", kind, f"coupler{i}", f"rocker{i}", **ends)
    return scene.scene()


def groups(system: System) -> int:
    return len(system.closures.constants[1].group)


@pytest.fixture
def all_at_once(monkeypatch):
    """Scenes compiled by it have all their closures in one group."""

    def compile_all(scene: Scene) -> System:
        with monkeypatch.context() as patch:
            patch.setattr(closure_tables, "clusters", lambda c, paths: [[list(range(len(paths)))]])
            return compiled(scene)

    return compile_all


@pytest.mark.parametrize(
    "base, expected",
    [("ground", 5), ("welded", 5), ("driven", 5), ("free", 1), ("jointed", 1), ("boom", 1), ("bending", 1)],
)
def test_loops_are_coupled_by_what_moves(base, expected):
    """A free base feels every loop; the ground, and what is welded to it or driven, none."""
    system = compiled(four_bars(5, base))
    assert len(system.closures.constants[1].cluster) == expected
    assert groups(system) == (1 if base == "bending" else 5), "a base that bends opens loops by itself"


def test_a_loop_between_two_couples_them():
    scene = four_bars(4)
    bridge = SceneBuilder("bridge").closure("bridge", "spherical", "crank1", "crank3")._lists["closures"]
    joined = compiled_tables(scene, bridge)
    assert sorted(len(rows) for rows in joined) == [5, 5, 13]


def compiled_tables(scene: Scene, more) -> list[range]:
    """Rows of each group of a scene with more closures."""
    values = {key: getattr(scene, key) for key in scene.__struct_fields__}
    system = compiled(Scene(**values | {"closures": (*scene.closures, *more)}))
    return [range(group["row_start"], group["row_stop"]) for group in system.closures.constants[1].group]


@pytest.mark.parametrize("kind", ["revolute", "spherical", "cylindrical"])
@pytest.mark.parametrize("base", ["ground", "driven", "free", "jointed", "boom"])
def test_by_groups_as_all_at_once(all_at_once, base, kind):
    """Ranks, initial states, accelerations and all loads: J M^-1 J' has zeros between groups, whoever uses them."""
    scene = four_bars(3, base, kind)
    apart, together = compiled(scene), all_at_once(scene)
    assert (groups(apart), groups(together)) == (3, 1)
    start, same = apart.initial_state, together.initial_state
    assert (apart.closures.rank, apart.closures.mobility) == (together.closures.rank, together.closures.mobility)
    bound = 1e3 * algebra(len(start.u), 3)  # R'R f = b is solved to the square of R's condition, about 30 here
    assert relative(start.q, same.q) <= 2.0**-40  # the closures are closed to 2^-44 of the mechanism's size
    for algorithm in ("articulated", "composite"):
        one = apart.evaluate(0.0, start.q, start.u, algorithm)
        other = together.evaluate(0.0, start.q, start.u, algorithm)
        assert relative(one.accelerations, other.accelerations) <= bound
        loads, same_loads = least_loads(apart, start, algorithm), least_loads(together, start, algorithm)
        largest = max(np.max(np.abs(load)) for load in loads.values())
        assert loads.keys() == same_loads.keys()
        assert all(np.max(np.abs(loads[k] - same_loads[k])) <= bound * largest for k in loads)
        assert {k: v.tolist() for k, v in one.undetermined.items()} == {
            k: v.tolist() for k, v in other.undetermined.items()
        }


def test_null_loads_belong_to_their_group(all_at_once):
    """Three planar loops of revolute hinges: three rows in each suppress nothing that is free."""
    scene = four_bars(3)
    apart, together = compiled(scene), all_at_once(scene)
    null = []
    for system in (apart, together):
        state = system.initial_state
        system.evaluate(0.0, state.q, state.u)
        null.append(system.closures.null_loads())
    assert null[0].shape == null[1].shape == (15, 9)
    np.testing.assert_allclose(null[0] @ null[0].T, null[1] @ null[1].T, atol=1e-12)  # the same space


def operations(system: System) -> int:
    """Of choosing, factorising and solving the rows, unit loads included."""
    state = system.initial_state
    chain = system.closures.chain("articulated")
    y = np.concatenate([state.q, state.u, [0.0]])
    linearised = count(dynamics.linearise, 0.0, y, chain)
    chain = linearised.arguments[2]
    return linearised.operations.total + count(dynamics.closure_loads, chain.w, chain.cc, chain.cw).operations.total


def test_twice_the_loops_cost_twice_as_much(all_at_once):
    """To the operation, whereas all at once they cost more than three times as much."""
    two, four = (four_bars(n, kind="spherical") for n in (2, 4))
    assert operations(compiled(four)) == pytest.approx(2 * operations(compiled(two)), rel=0.02)
    rows = [system.closures.constants[1] for system in (compiled(two), compiled(four))]
    assert [len(row.column) for row in rows] == [6, 12]
    sizes = [closure_system.workspace(own, system.constants, system.nq).half.size
             for own, system in zip(rows, (compiled(two), compiled(four)), strict=True)]  # fmt: skip
    assert sizes == [18, 36]
    by_dense = [operations(all_at_once(scene)) for scene in (two, four)]
    assert by_dense[1] > 2.2 * by_dense[0]


def test_every_loop_on_a_base_that_flies_costs_the_same(all_at_once):
    """Whereas all at once the second two cost far more than the first two."""
    scenes = [four_bars(n, "free", "spherical") for n in (2, 4, 6)]
    first, then = np.diff([operations(compiled(scene)) for scene in scenes])
    assert then == pytest.approx(first, rel=0.02)
    first, then = np.diff([operations(all_at_once(scene)) for scene in scenes])
    assert then > 1.3 * first
