"""Linkages that move though counting says they cannot: closed forms close the loop, loads are not determined by the
motion, and a bar that is a little off locks it."""

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.spatial.transform import Rotation

from crosscheck.engines.registry import engine
from flexmb import compile
from flexmb.scene.files import load_scene
from flexmb.scene.schema import Scene
from tests.cases.shipped import CASES, closed_form

FAMILY = CASES / "closed_chains"
ROUND = np.linspace(0.05, 2.0 * np.pi + 0.05, 50, endpoint=False)


def test_the_bars_of_bricard_close_all_the_way_round() -> None:
    """At (0, 0, 1) with the last axis along -x, for every value of the coordinate; rates are derivatives."""
    m = closed_form("closed_chains/bricard")
    place, R, omega, velocity = m.bars(ROUND)[-1]
    assert np.max(np.abs(place + R.apply(m.LINKS[-1]) - [0.0, 0.0, 1.0])) < 1e-14
    assert np.max(np.abs(R.apply([-1.0, 0.0, 0.0]) - [-1.0, 0.0, 0.0])) < 1e-14
    assert np.max(np.abs(velocity + np.cross(omega, R.apply(m.LINKS[-1])))) < 1e-14
    turn, _ = m.angles(ROUND)
    assert np.allclose(np.prod(np.cos(0.5 * (turn + 0.5 * np.pi)), axis=0), 0.5, rtol=0.0, atol=1e-15)


def test_bricard_comes_back_after_a_period() -> None:
    m = closed_form("closed_chains/bricard")
    period = 2.0 * np.pi * m.swing()[2]
    found = m.exact(np.array([0.0, period]))["marker:P3.position"]
    assert np.max(np.abs(found[1] - [1.0, -1.0, 1.0])) < 1e-12
    assert abs(period - 4.98630860866) < 1e-11


def test_the_bars_of_bennett_close_all_the_way_round() -> None:
    m = closed_form("closed_chains/bennett")
    (first, second, _), _ = m.angles(ROUND)
    assert np.ptp(np.tan(0.5 * first) * np.tan(0.5 * second)) < 1e-11
    place, R, omega, velocity = m.bars(ROUND)[-1]
    tip = R.apply([m.LONG, 0.0, 0.0])
    assert np.max(np.abs(place + tip - [-m.SHORT, 0.0, 0.0])) < 1e-14
    assert np.max(np.abs(velocity + np.cross(omega, tip))) < 1e-14
    axis = (R * Rotation.from_euler("x", m.TWIST_LONG)).apply([0.0, 0.0, 1.0])
    assert np.max(np.abs(axis - Rotation.from_euler("x", -m.TWIST_SHORT).apply([0.0, 0.0, 1.0]))) < 1e-14


@pytest.mark.parametrize(("case", "rank"), [("bricard", 4), ("bennett", 2)])
def test_dependent_equations_are_found_and_loads_told_apart(case: str, rank: int) -> None:
    system = compile(load_scene(FAMILY / case / "scene.toml"))
    known = system.determined_loads(system.initial_state)
    assert (system.closures.rank, system.closures.mobility) == (rank, 1)
    assert not all(np.all(components) for components in known.values())
    system = compile(load_scene(FAMILY / case / "determined.toml"))
    known = system.determined_loads(system.initial_state)
    assert system.closures.mobility == 1
    assert all(np.all(components) for components in known.values())


def stretched(scene: Scene, name: str) -> Scene:
    """The node at the end of a bar 1 % farther out."""
    bodies = []
    for body in scene.bodies:
        if body.name == name:
            node = body.nodes[0]
            body = replace(body, nodes=(replace(node, position_m=tuple(1.01 * x for x in node.position_m)),))
        bodies.append(body)
    return replace(scene, bodies=tuple(bodies))


@pytest.mark.parametrize(("case", "bar"), [("bricard", "bar2"), ("bennett", "crank")])
def test_a_bar_one_per_cent_too_long_locks_it(case: str, bar: str) -> None:
    support = engine("native").supports(stretched(load_scene(FAMILY / case / "scene.toml"), bar))
    assert support.kind == "no"
    assert "close" in support.reason or "locked" in support.reason
