"""Random trees with couplings between hinges of one coordinate, prescribed ones among them. Same seed, same scene."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np

import flexmb
from flexmb.dense import DenseSystem
from flexmb.dense.closures import relation
from flexmb.scene import schema as s
from flexmb.scene.tree import coordinates
from tests import trees
from tests.flexmb.closure import chains

HINGES = ("revolute", "prismatic", "spherical", "revolute", "universal", "screw", "prismatic", "revolute")
RECIPES = {
    "rigid": replace(trees.RIGID, hinges=HINGES), "full": replace(trees.FULL, hinges=HINGES),
    "free-flying": replace(trees.FREE_FLYING, hinges=(*HINGES, "free")),
    "every level": replace(trees.EVERY_LEVEL, hinges=HINGES, deformation=0.01),
    "ruthless": replace(trees.RUTHLESS, hinges=HINGES, prescribed=False),
}  # fmt: skip


def coupled_tree(recipe: str, closures: tuple[str, ...] = ()) -> s.Scene:
    """A random tree of `RECIPES` with random closures of these types, and couplings."""
    rng = np.random.default_rng(len(recipe))
    scene = trees.random_scene(3, RECIPES[recipe])
    return with_couplings(chains.with_closures(scene, rng, list(closures)) if closures else scene, rng)


def with_couplings(scene: s.Scene, rng: np.random.Generator) -> s.Scene:
    """The scene with three couplings of hinges with one coordinate, two that overlap and one of three coordinates, all
    fulfilled at its initial coordinates."""
    names = [hinge.name for hinge in scene.hinges if len(coordinates(hinge)) == 1]
    held = {x.owner for x in DenseSystem(scene).tree.scalars if x.prescribed is not None}
    names.sort(key=lambda name: name in held)  # prescribed ones lead: no coupling has two of them
    chosen = [(names[0], names[1:2]), (names[1], names[2:3]), (names[3], names[4:5] + names[-1:])]
    dense, start = DenseSystem(scene), flexmb.System(scene).initial_state.q
    found = []
    for i, (led, leading) in enumerate(chosen):
        terms = tuple(s.CoupledCoordinate(hinge=name, ratio=float(rng.uniform(0.5, 2.0))) for name in leading)
        coupling = s.Coupling(name=f"k{i}", hinge=led, terms=terms)
        offset = float(relation(dense, coupling)[0] @ start)
        found.append(msgspec.structs.replace(coupling, offset=offset))
    return msgspec.structs.replace(scene, couplings=tuple(found))
