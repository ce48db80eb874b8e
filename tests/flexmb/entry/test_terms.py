"""Planted errors: every term of the derivatives by recursion, left out, is noticed by the comparison with duals.

The recursion is interpreted (`interpreted.py`), because compiling it without a term would take half a minute each time.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb
from flexmb.scene.bodies import Modes
from flexmb.scene.build import SceneBuilder
from flexmb.scene.connectors import SpringDamper
from flexmb.scene.functions import Constant
from flexmb.scene.schema import Load, Scene
from tests import trees
from tests.benchmarks.rivals import flexible_chain, rigid_chain
from tests.flexmb.connectors import connected_scenes
from tests.flexmb.entry import interpreted
from tests.flexmb.entry.terms import Term, modules, terms
from tests.flexmb.entry.test_derivatives import both, bound, mass
from tests.flexmb.levels.strain_beams import ALLOW, PLANE, SPACE, stations

NOTICED = 1e-6  # relative; a term that is left out is large, and the agreement of both routes is far below
EVERY = 30  # by default one term in so many; with -m slow all of them


class Compared(NamedTuple):
    """A scene with what is expected of the free speeds, and the size of each column."""

    system: flexmb.System
    w: flexmb.entry.derivatives.DerivativeWorkspace
    matrices: tuple[np.ndarray, np.ndarray]
    sizes: tuple[np.ndarray, np.ndarray]
    power: np.ndarray
    mass: np.ndarray

    def error(self, term: Term | None) -> float:
        """The largest relative difference of what the recursion gives without a term; NaN counts as infinite."""
        error = self._of_accelerations(term)
        return error if error > NOTICED else max(error, self._of_mass(term))

    def _of_accelerations(self, term: Term | None) -> float:
        found, free = interpreted.accelerations(self.system.constants, self.w, term), self._free
        parts = [found.by_displacement, found.by_speed]
        errors = [
            relative(part[np.ix_(free, free)] - expected, size)
            for part, expected, size in zip(parts, self.matrices, self.sizes, strict=True)
        ]
        power = np.concatenate([found.power_by_displacement[free], found.power_by_speed[free]]) - self.power
        return max(*errors, relative(power, np.max(np.abs(self.power))))

    def _of_mass(self, term: Term | None) -> float:
        found = interpreted.mass_matrix(self.system.constants, self.w, term)[np.ix_(self._free, self._free)]
        return relative(found - self.mass, np.max(np.abs(self.mass)))

    @property
    def _free(self) -> np.ndarray:
        return np.flatnonzero(self.system.constants.speed["prescribed"] < 0)


def relative(difference: np.ndarray, size: np.ndarray | float) -> float:
    """The largest difference by size; one without a size, or that is no number, is infinite."""
    with np.errstate(all="ignore"):
        ratio = np.abs(difference) / size
    ratio[np.abs(difference) < 1e-20] = 0.0
    return float(np.max(np.where(np.isnan(ratio), np.inf, ratio)))


def compared(scene: Scene) -> Compared:
    """What duals say of a scene, at its initial state."""
    found = both(scene)
    assert found is not None
    system, nq, nu = found.system, found.system.nq, found.system.nu
    free = np.flatnonzero(system.constants.speed["prescribed"] < 0)
    rows, power, N = found.by_duals[nq : nq + nu], found.by_duals[-1], found.by_duals[:nq, nq : nq + nu]
    matrices = (rows[:, :nq] @ N)[np.ix_(free, free)], rows[:, nq : nq + nu][np.ix_(free, free)]
    least = np.max(np.abs(found.w.sweeps.speed["acceleration"]))  # as in `test_derivatives.errors`
    sizes = np.maximum(np.max(np.abs(matrices[0]), axis=0), least), np.max(np.abs(matrices[1]), axis=0)
    of_power = np.concatenate([(power[:nq] @ N)[free], power[nq : nq + nu][free]])
    return Compared(system, found.w, matrices, sizes, of_power, mass(system))


def tethered(scene: Scene) -> Scene:
    """The scene with a spring and damper between its first and its last body."""
    spring = SpringDamper(
        name="tether", body_a="b0", body_b=f"b{len(scene.bodies) - 1}", position_a_m=(0.1, 0.2, 0.0),
        position_b_m=(0.0, 0.1, 0.3), free_length_m=0.5, stiffness_N_m=900.0, damping_Ns_m=40.0,
    )  # fmt: skip
    return replace(scene, connectors=(*scene.connectors, spring))


def drawn(recipe: trees.Recipe, bodies: int, seed: int) -> Scene:
    return trees.random_scene(seed, dataclasses.replace(recipe, bodies=bodies))


def twisted(scene: Scene) -> Scene:
    """The scene with a torque in World axes on its last body, which random scenes have none of."""
    torque = Load(name="twist", type="torque", body=scene.bodies[-1].name, frame="world", direction=(0.6, 0.0, 0.8),
                  function=Constant(value=2.0))  # fmt: skip
    return replace(scene, loads=(*scene.loads, torque))


def branched() -> Scene:
    """Two beams whose sections turn, hinged beside their nodes: what acts there is held by a section within."""
    scene, rng = SceneBuilder("branched", gravity=(0.3, 0.2, -9.81), allow=ALLOW), np.random.default_rng(5)
    parent = "ground"
    for name, modes in (("stem", Modes(count=2, families=SPACE)), ("twig", Modes(count=3, families=PLANE))):
        scene.beam(name, length=1.0, elements=4, section=stations(1.0, (0.4, -0.5, 0.9)), level="exact", modes=modes,
                   points="section", nodes={"inside": 0.4})  # fmt: skip
        scene.revolute(f"hinge of {name}", parent, name, axis=(0.0, 0.6, 0.8), angle=0.4, rate=1.5,
                       **({} if parent == "ground" else {"parent_node": "inside", "child_node": "inside"}),
                       parent_position=(0.1, 0.2, -0.3))  # fmt: skip
        parent = name
    scene.rigid_body("end", mass=0.7, com=(0.1, 0.2, 0.0), inertia=(0.01, 0.02, 0.03))
    scene.revolute("elbow", "twig", "end", parent_node="tip", parent_position=(0.0, 0.1, 0.2), axis=(1.0, 0.0, 0.0),
                   angle=-0.3, rate=2.0)  # fmt: skip
    counts = flexmb.compile(scene.scene()).constants.body["modes"]
    for name, count in zip(("stem", "twig"), counts.tolist(), strict=False):
        coordinates, rates = rng.normal(size=(2, count)) * 0.1
        scene.modal_state(name, coordinates=coordinates, rates=rates)
    return scene.scene()


@cache
def scenes() -> list[Compared]:
    """Small scenes that contain everything together."""
    made = [
        tethered(flexible_chain(10, 1, "full")), twisted(drawn(trees.ARMED_RIGID, 5, 0)), drawn(trees.FULL, 4, 0),
        drawn(trees.EVERY_LEVEL, 4, 0), tethered(drawn(trees.FULL, 4, 1)), drawn(trees.EVERY_LEVEL, 5, 1),
        drawn(trees.LATER, 4, 1), rigid_chain(10), connected_scenes.everything("full"), drawn(trees.SINGLE, 8, 0),
        rigid_chain(10), branched(),
    ]  # fmt: skip
    return [compared(scene) for scene in made]


def unnoticed(of: list[Term]) -> list[str]:
    """Those terms that no scene needs."""
    tried, found = list(scenes()), []
    for term in of:
        notices = next((each for each in tried if each.error(term) > NOTICED), None)
        if notices is None:
            found.append(f"{term.where}: {term.text}")
        else:  # will probably notice the next term, too
            tried.remove(notices)
            tried.insert(0, notices)
    return found


@pytest.mark.filterwarnings('ignore:scene "connected" is doubtful')
def test_the_recursion_as_it_is_agrees():
    """Also interpreted, with the mass matrix and the power; a term is noticed far above that."""
    for scene in scenes():
        limit = bound(scene.system)
        assert scene.error(None) <= limit < 1e-2 * NOTICED


@pytest.mark.filterwarnings('ignore:scene "connected" is doubtful')
def test_some_terms_are_noticed():
    assert unnoticed([term for module in modules() for term in terms(module)][::EVERY]) == []


@pytest.mark.slow
@pytest.mark.filterwarnings('ignore:scene "connected" is doubtful')
@pytest.mark.parametrize("module", [name for name in modules() if list(terms(name))])
def test_every_term_is_noticed(module):
    assert unnoticed(list(terms(module))) == []
