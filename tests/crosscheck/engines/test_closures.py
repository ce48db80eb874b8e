"""Closures of every kind in other codes, beside drives and couplings too: motion and loads of the first instant."""

from __future__ import annotations

import warnings
from functools import cache
from typing import get_args

import msgspec
import numpy as np
import pytest

import flexmb as fm
from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.opensim.engine import CLOSED_BY
from crosscheck.engines.registry import engine
from crosscheck.mutation.invariances import units
from crosscheck.running import starts
from flexmb.scene.build import angular, linear
from flexmb.scene.hinges import WITH_AXIS, ClosureKind
from flexmb.scene.schema import Closure, Scene
from tests.crosscheck.engines.peers import off

KINDS = get_args(ClosureKind)
Z = (0.0, 0.0, 1.0)
SLANTED = (0.6, 0.0, 0.8)


@cache
def loop(kind: ClosureKind) -> Scene:
    """Three bodies with seven freedoms, of which the closure to the ground leaves one at least; it fits as they begin.

    One coordinate is prescribed, and two are coupled where that leaves freedoms.
    """
    tree = fm.SceneBuilder("loop", gravity=(0.4, -0.3, -9.81))
    for k, name in enumerate(("one", "two", "three")):
        moments = np.diag([0.02, 0.05 + 0.01 * k, 0.06])
        tree.rigid_body(
            name, mass=1.0 + 0.3 * k, com=(0.2, 0.05, -0.1), inertia=moments, nodes={"e": (0.5, 0.1 * k, 0.05)}
        )
    tree.spherical(
        "a", "ground", "one", quaternion=(0.7, 0.1, 0.5, 0.5), angular_velocity=(0.5, -0.3, 0.7), damping=0.1
    )
    motion = fm.Sine(amplitude=0.4, angular_frequency_rad_s=3.0)
    first, second = angular(prescribed=motion), angular(angle=-0.4, stiffness=2.0)
    tree.universal("b", "one", "two", parent_node="e", first=first, second=second)
    rail, turn = linear(position=0.2, rate=-0.06), angular(angle=0.7, rate=-0.6)
    tree.cylindrical("c", "two", "three", parent_node="e", axis=(0.36, 0.48, 0.8), rotation=turn, translation=rail)
    if kind not in ("weld", "prismatic", "revolute"):
        tree.coupling("screw", "c", {("c", "rotation"): 0.1}, coordinate="translation", offset=0.13)
    scene = tree.marker("tip", "three", node="e").scene()
    system = fm.compile(scene, kernels="general")
    begin = system.initial_state
    tip = system.evaluate(begin.t, begin.q, begin.u).markers["tip"]
    there = {"position_a_m": tuple(tip.position.tolist()), "quaternion_a": tuple(tip.quaternion.tolist())}
    axis = SLANTED if kind in WITH_AXIS else Z
    closure = Closure(name="loop", type=kind, body_a="ground", body_b="three", node_b="e", axis=axis, **there)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fm.SceneWarning)  # its speeds need to fit only roughly
        return starts.closed(msgspec.structs.replace(scene, closures=(closure,)))


CLOSED = [(name, kind) for name in ("pinocchio", "exudyn") for kind in KINDS]
CLOSED += [("opensim", kind) for kind in CLOSED_BY]


@pytest.mark.parametrize(("name", "kind"), CLOSED)
def test_every_kind_has_the_same_loads(name: str, kind: ClosureKind) -> None:
    """Before, Pinocchio closed loops by welds and ball joints only, and neither beside a drive nor beside couplings."""
    pytest.importorskip(name)
    scene = loop(kind)
    if name == "exudyn":  # it has no couplings
        scene = msgspec.structs.replace(scene, couplings=())
    assert engine(name).supports(scene).kind == "exact"
    mine, theirs = (engine(each).compile(scene).evaluate() for each in ("native", name))
    assert off(mine.loads, theirs.loads) <= 1e-11
    assert off(mine.drives, theirs.drives) <= 1e-11
    if kind != "weld":  # by which the marker rests
        assert off(*({"tip": each.markers["tip"].acceleration} for each in (mine, theirs))) <= 1e-11


@pytest.mark.parametrize(
    ("name", "kind"), [("pinocchio", "universal"), ("pinocchio", "planar"), ("opensim", "spherical")]
)
def test_they_are_kept_over_time(name: str, kind: ClosureKind) -> None:
    pytest.importorskip(name)
    scene, run = loop(kind), Run(np.linspace(0.0, 0.3, 4))
    mine = engine("native").compile(scene).simulate(run, Effort("tolerance", 1e-11, "dop853"))
    theirs = engine(name).compile(scene).simulate(run, Effort("tolerance", 1e-11, "DOP853"))
    assert np.max(np.abs(mine.markers["tip"].position - theirs.markers["tip"].position)) <= 1e-9
    assert off(mine.loads, theirs.loads) <= 1e-8


def pinned(
    crank: float, coupler: float, rocker: float, ground: float, angles: tuple[float, float, float], size: float = 1.0
) -> Scene:
    """A plane four-bar with four revolute pins: three of 18 rows are redundant. Lengths and gravity are `size` times as
    large, so that all sizes move alike."""
    tree = fm.SceneBuilder("pinned", gravity=(0.0, -9.81 * size, 0.0))
    for name, length in (("crank", crank), ("coupler", coupler), ("rocker", rocker)):
        moments = size**2 * np.array([1e-3, length**3 / 12.0, length**3 / 12.0])
        com, end = size * np.array([0.5 * length, 0.0, 0.01]), (size * length, 0.0, 0.0)
        tree.rigid_body(name, mass=length, com=com, inertia=moments, nodes={"e": end})
    tree.revolute("drive", "ground", "crank", angle=angles[0], rate=2.0, given=True)
    tree.revolute("pin", "crank", "coupler", parent_node="e", angle=angles[1])
    tree.revolute("pivot", "ground", "rocker", parent_position=(size * ground, 0.0, 0.0), angle=angles[2])
    tree.closure("loop", "revolute", "coupler", "rocker", node_a="e", node_b="e")
    return tree.marker("joint", "coupler", node="e").scene()


def test_four_pins_have_the_same_motion_in_three_codes() -> None:
    """Before, Exudyn stopped at t = 0, as its rows were redundant, and Pinocchio refused the pin."""
    pytest.importorskip("exudyn")
    pytest.importorskip("pinocchio")
    scene, run = starts.closed(pinned(0.3, 0.8, 0.7, 1.0, (1.0, -0.43, 1.8))), Run(np.linspace(0.0, 0.2, 3))
    efforts = {
        "native": Effort("tolerance", 1e-10, "dop853"),
        "pinocchio": Effort("tolerance", 1e-9, "DOP853"),
        "exudyn": Effort("step", 1e-3, "TrapezoidalIndex2"),
    }
    found = {name: engine(name).compile(scene).simulate(run, effort) for name, effort in efforts.items()}
    assert all(each.status == "finished" for each in found.values())
    mine, bounds = found["native"], {"pinocchio": (1e-8, 1e-8), "exudyn": (2e-5, 1e-3)}
    for name, (of_place, of_load) in bounds.items():
        theirs = found[name]
        assert np.abs(mine.markers["joint"].position - theirs.markers["joint"].position).max() <= of_place
        for each, load in mine.loads.items():  # in the plane forces are determined, and the torque about its normal
            assert np.abs((load - theirs.loads[each])[:, [2, 3, 4]]).max() <= of_load * 10.0


def test_mujoco_keeps_pins_softly() -> None:
    """Two points on the axis: the motion opens by its softness, and loads act with the same signs at the same point."""
    pytest.importorskip("mujoco")
    scene, run = starts.closed(pinned(0.3, 0.8, 0.7, 1.0, (1.0, -0.43, 1.8))), Run(np.linspace(0.0, 0.2, 3))
    assert engine("mujoco").supports(scene).kind == "surrogate"
    mine = engine("native").compile(scene).simulate(run, Effort("tolerance", 1e-9, "dop853"))
    theirs = engine("mujoco").compile(scene).simulate(run, Effort("step", 5e-4, "RK4"))
    assert np.abs(mine.markers["joint"].position - theirs.markers["joint"].position).max() <= 2e-4
    known = [2, 3, 4]
    assert np.allclose(mine.loads["loop"][-1, known], theirs.loads["loop"][-1, known], atol=2e-3)


def resized(scene: Scene, size: float, monkeypatch: pytest.MonkeyPatch) -> Scene:
    """The scene with all lengths, gravity and forces `size` times as large, and torques by its square."""
    for name, factor in (("LENGTH", size), ("MASS", 1.0), ("TIME", 1.0)):
        monkeypatch.setattr(units, name, factor)
    return msgspec.structs.replace(units._in_units(scene), allow=units.UNUSUAL)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("size", [1e-6, 1e5])
def test_rows_of_mixed_units_are_told_apart_at_any_size(
    kind: ClosureKind, size: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before, rows that were small in their units were left out as redundant: loads were off by all of their size."""
    pytest.importorskip("pinocchio")
    scene = resized(msgspec.structs.replace(loop(kind), couplings=()), size, monkeypatch)
    mine, theirs = (engine(each).compile(scene).evaluate() for each in ("native", "pinocchio"))
    largest = max(np.abs(load[3:]).max() for load in mine.loads.values())
    for name, load in mine.loads.items():
        assert np.abs(theirs.loads[name] - load)[3:].max() <= 1e-11 * largest
        assert np.abs(theirs.loads[name] - load)[:3].max() <= 1e-11 * largest * size


@pytest.mark.parametrize("size", [1e-3, 1.0, 100.0])
def test_points_of_mujoco_are_as_far_apart_as_bodies_are_large(size: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Loads are within its softness; with points 0.1 m from the frame those of 100 m long bodies were off by 23 %."""
    pytest.importorskip("mujoco")
    scene, run = resized(loop("revolute"), size, monkeypatch), Run(np.linspace(0.0, 0.3, 4))
    mine = engine("native").compile(scene).simulate(run, Effort("tolerance", 1e-9, "dop853"))
    largest = max(np.abs(load[:, 3:]).max() for load in mine.loads.values())

    def off_by() -> float:
        theirs = engine("mujoco").compile(scene).simulate(run, Effort("step", 1e-3, "RK4"))
        return max(np.abs(theirs.loads[name] - load)[-1, 3:].max() for name, load in mine.loads.items()) / largest

    assert off_by() <= 1e-3
    monkeypatch.setattr("crosscheck.engines.mujoco.tree.radius_of_gyration", lambda links, at: 1e-3 * size)
    assert off_by() >= 0.1  # much too near


def gripped() -> Scene:
    """A box in free flight that a weld holds to the second of two bodies on a chain."""
    tree = fm.SceneBuilder("gripped", gravity=(0.4, -0.3, -9.81))
    for name, mass in (("crank", 1.0), ("rod", 2.0), ("box", 1.5)):
        tree.rigid_body(
            name, mass=mass, com=(0.2, 0.02, 0.05), inertia=np.diag([0.01, 0.03, 0.04]), nodes={"e": (0.5, 0.0, 0.0)}
        )
    tree.revolute("a", "ground", "crank", axis=(0.0, 1.0, 0.0), angle=-0.3, rate=1.0)
    tree.spherical("b", "crank", "rod", parent_node="e", angular_velocity=(0.5, -0.3, 0.7))
    tree.free("f", "ground", "box", position=(0.7, 0.0, 0.0))
    tree.closure("grip", "weld", "rod", "box", position_a=(0.2, 0.1, 0.05))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fm.SceneWarning)  # the box begins where the weld puts it
        return starts.closed(tree.marker("tip", "box").scene())


@pytest.mark.parametrize("kind", ["prismatic", "cylindrical", "universal", "planar", "in_line", "in_plane"])
def test_mujoco_refuses_what_points_do_not_make(kind: ClosureKind) -> None:
    pytest.importorskip("mujoco")
    refused = engine("mujoco").supports(loop(kind))
    assert refused.kind == "no" and f'closure "loop" is of type {kind}: MuJoCo closes loops by' in refused.reason


def test_mujoco_keeps_welds_by_three_points() -> None:
    pytest.importorskip("mujoco")
    scene, run = gripped(), Run(np.linspace(0.0, 0.3, 4))
    supported = engine("mujoco").supports(scene)
    assert supported.kind == "surrogate" and "springs and dampers" in supported.reason
    mine = engine("native").compile(scene).simulate(run, Effort("tolerance", 1e-9, "dop853"))
    theirs = engine("mujoco").compile(scene).simulate(run, Effort("step", 1e-3, "RK4"))
    assert np.abs(mine.markers["tip"].position - theirs.markers["tip"].position).max() <= 5e-4
    largest = max(np.abs(load).max() for load in mine.loads.values())
    for name, load in mine.loads.items():
        assert np.abs(theirs.loads[name] - load).max() <= 5e-3 * largest
    apart = msgspec.structs.replace(scene, closures=())
    free = engine("native").compile(apart).simulate(run, Effort("tolerance", 1e-9, "dop853"))
    assert np.abs(mine.markers["tip"].position - free.markers["tip"].position).max() >= 0.02  # what the weld does


@pytest.mark.parametrize("size", [1e-4, 1.0, 100.0])
def test_rows_that_only_seem_redundant_are_told(size: float) -> None:
    """A rhombus that is folded flat at the start, where one row more is redundant than elsewhere. Before, gaps below
    1 mm were none, however small the bodies."""
    pytest.importorskip("exudyn")
    scene, run = pinned(1.0, 1.0, 1.0, 1.0, (0.0, 0.0, 0.0), size), Run(np.linspace(0.0, 0.5, 6))
    found = engine("exudyn").compile(scene).simulate(run, Effort("step", 1e-3, "TrapezoidalIndex2"))
    assert found.status == "diverged" and 'closure "loop" opened: rows that are redundant' in found.message


def test_opensim_refuses_the_kinds_that_simbody_has_not() -> None:
    for kind in set(KINDS) - set(CLOSED_BY):
        support = engine("opensim").supports(loop(kind))
        assert support.kind == "no" and f'"loop" is of type {kind}' in support.reason
