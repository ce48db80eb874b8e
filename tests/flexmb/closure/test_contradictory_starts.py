"""Flexible systems whose start contradicts a closure or coupling: hinges close what they can, modes do the rest.

Of random scenes a quarter contradict themselves. Where a mode leaves its given value, SciPy confirms that the hinges
alone cannot close the loop, and the dense route that no closed state nearby has less strain energy.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from scipy.optimize import least_squares

import flexmb
from flexmb.dense import DenseSystem
from flexmb.dense.body_frames import Motions
from flexmb.dense.closures import relation, rows
from flexmb.scene import schema as s
from flexmb.scene.shapes import beam_section
from flexmb.scene.tree import coordinates, with_coordinates
from tests import trees
from tests.flexmb.closure import chains
from tests.flexmb.closure.coupled import HINGES

SMALL = {"prescribed": False, "wheels": 1, "point_masses": 1, "deformation": 0.05}
LEVELS = (trees.FULL, trees.LINEAR, trees.EXACT, trees.STIFFENED, trees.EVERY_LEVEL)
LOOPS = [replace(recipe, **SMALL, bodies=7, hinges=HINGES) for recipe in LEVELS]
CHAINS = [replace(loop, bodies=4, branching=False, hinges=("revolute", "universal", "prismatic")) for loop in LOOPS]


def drawn(seed: int) -> s.Scene:
    """Couplings, loops, or loops that hinges cannot close; seeds that are multiples of 4 contradict themselves."""
    rng = np.random.default_rng([seed, 42])
    level, kind = seed // 4 % len(LEVELS), seed // 4 % 4
    if kind == 3:
        scene = chains.with_closures(trees.random_scene(seed, CHAINS[level]), rng, ["weld"])
    else:
        scene = trees.random_scene(seed, LOOPS[level])
        scene = coupled(scene, rng) if kind != 1 else chains.with_closures(scene, rng, ["revolute", "spherical"])
    return contradicting(scene, rng, shift=kind == 3) if seed % 4 == 0 else scene


def coupled(scene: s.Scene, rng: np.random.Generator) -> s.Scene:
    """With a relation of three coordinates, fulfilled at the start."""
    led, *leading = [str(name) for name in rng.permutation([x.name for x in scene.hinges if len(coordinates(x)) == 1])]
    terms = tuple(s.CoupledCoordinate(hinge=name, ratio=float(rng.uniform(0.5, 2.0))) for name in leading[:2])
    coupling = s.Coupling(name="gear", hinge=led, terms=terms)
    offset = float(relation(DenseSystem(scene), coupling)[0] @ flexmb.System(scene).initial_state.q)
    return msgspec.structs.replace(scene, couplings=(msgspec.structs.replace(coupling, offset=offset),))


def contradicting(scene: s.Scene, rng: np.random.Generator, *, shift: bool) -> s.Scene:
    """With other angles and positions of all hinges, and with closures elsewhere if `shift` is set."""
    hinges = tuple(
        with_coordinates(hinge, [_off(each, rng, 0.02 if shift else 0.5) for _, each in coordinates(hinge)])
        for hinge in scene.hinges
    )
    if not shift:
        return msgspec.structs.replace(scene, hinges=hinges)
    places = [np.array(closure.position_b_m) + trees.vector(rng, 0.005) for closure in scene.closures]
    pairs = zip(scene.closures, places, strict=True)
    closures = tuple(msgspec.structs.replace(each, position_b_m=tuple(place)) for each, place in pairs)
    return msgspec.structs.replace(scene, hinges=hinges, closures=closures)


def _off(coordinate: s.Coordinate, rng: np.random.Generator, size: float) -> s.Coordinate:
    key = "angle_rad" if isinstance(coordinate, s.AngularCoordinate) else "position_m"
    value = getattr(coordinate, key) + float(rng.uniform(-size, size))
    return msgspec.structs.replace(coordinate, **{key: value})


def check(seed: int) -> str:
    """What became of a start: "kept", "by hinges", "by modes" or "refused"; AssertionError for one that is wrong."""
    scene = drawn(seed)
    system, given = flexmb.compile(scene), flexmb.System(scene).initial_state
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", flexmb.SceneWarning)
        try:
            start = system.initial_state
        except flexmb.ClosureError:
            assert seed % 16 == 12, "the scene was made from one whose hinges close it"
            return "refused"
    assert max(max(gap) for gap in system.closure_gaps(start).values()) < 1e-12
    places = [system.coordinate(f"{body.name}.modes") for body in scene.bodies]
    modal = np.concatenate([np.arange(system.nq)[place] for place in places])
    if seed % 4:
        assert np.array_equal(start.q, given.q)
        return "kept"
    assert told
    if np.array_equal(start.q[modal], given.q[modal]):
        return "by hinges"
    hinges = np.setdiff1d(np.arange(system.nq), modal)
    assert _gap_by_hinges(scene, given.q, start.q[hinges], hinges) > 1e-7
    _confirm_least_strain(system, given.q, start)
    return "by modes"


def _gap_by_hinges(scene: s.Scene, given: np.ndarray, guess: np.ndarray, hinges: np.ndarray) -> float:
    """The least gap that SciPy finds with all modes at their given values."""
    dense = DenseSystem(scene)

    def gaps(x: np.ndarray) -> np.ndarray:
        q = given.copy()
        q[hinges] = x
        motion = Motions(q, np.zeros((1, dense.nu)), np.zeros((1, dense.nu)))
        return np.concatenate([rows(dense, constraint, motion)[0, 0] for constraint in scene.constraints])

    starts = (given[hinges], guess)
    return min(float(np.linalg.norm(least_squares(gaps, x, xtol=1e-15, ftol=1e-15).fun)) for x in starts)


def _confirm_least_strain(system: flexmb.System, given: np.ndarray, start: flexmb.State) -> None:
    """The strain energy of the change resists every motion that closures allow."""
    resisting, stiffness = np.zeros(system.nu), system.constants.stiffness
    for k, (q, u, m) in enumerate(system.constants.body[["eta_index", "etad_index", "modes"]].tolist()):
        resisting[u : u + m] = stiffness[k, :m, :m] @ (start.q - given)[q : q + m]
    J = chains.constrained(system.scene, start.q, start.u).J
    left = resisting - J.T @ np.linalg.lstsq(J.T, resisting, rcond=1e-11)[0]
    assert np.linalg.norm(left) < 1e-3 * np.linalg.norm(resisting)


PINNED = (0, 4, 8, 12, 16, 20, 24, 28, 44, 60, 1, 5, 10, 14, 19, 23, 26, 30, 45, 61)


def test_modes_move_by_no_more_than_hinges_need():
    found = [check(seed) for seed in PINNED]
    assert {"kept", "by hinges", "by modes"} <= set(found), found


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 500, 100))
def test_modes_of_many_scenes_move_by_no_more_than_hinges_need(first):
    """500 scenes in parts, so that a loaded machine ends some of them."""
    found = [check(seed) for seed in range(first, first + 100)]
    assert {"kept", "by hinges", "by modes"} <= set(found)


def geared_arm(level: str) -> flexmb.SceneBuilder:
    """A shaft and a bent beam of 1 m that a gear turns against it, with given angles that contradict the gear."""
    made = flexmb.SceneBuilder("geared arm")
    made.rigid_body("shaft", mass=1.0, inertia=(0.01, 0.01, 0.01))
    strip = beam_section(E=70e9, G=26e9, A=8e-5, Iy=1.07e-10, Iz=2.7e-9, rho=2700.0)
    made.beam("arm", length=1.0, elements=6, section=strip, level=level,
              modes=s.Modes(count=3, families=("bending_y",)))  # fmt: skip
    made.modal_state("arm", coordinates=(0.03, 0.0, 0.0), rates=(0.0, 0.0, 0.0))
    made.revolute("turn", "ground", "shaft", angle=0.4)
    made.revolute("shoulder", "ground", "arm", axis=(0, 1, 0), angle=1.5)
    return made.coupling("gear", "shoulder", ratios={"turn": -2.0})


def test_an_arm_on_a_gear_turns_and_does_not_bend():
    for level in ("linear", "full", "stiffened", "exact"):
        system = flexmb.compile(geared_arm(level).scene())
        with pytest.warns(flexmb.SceneWarning, match='"turn.rotation" from 0.4 to .*"shoulder.rotation" from 1.5 to'):
            start = system.initial_state
        given = flexmb.System(system.scene).initial_state.q
        place = system.coordinate("arm.modes")
        assert np.any(given[place]) and np.array_equal(start.q[place], given[place])
