"""Random trees of every level at their own random state, and the size of what rounds in their equations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import flexmb
from flexmb.typing import Real
from tests import trees
from tests.bounds import algebra

# first-order mass matrices lose definiteness where the deformation is not small
LEVELS = {
    "rigid": trees.RIGID, "ruthless": trees.RUTHLESS, "linear": replace(trees.LINEAR, deformation=0.02),
    "full": trees.FULL, "every level": replace(trees.EVERY_LEVEL, deformation=0.02),
    "armatures": replace(trees.ARMED, deformation=0.02), "exact": trees.EXACT,
}  # fmt: skip


@dataclass(frozen=True)
class RandomState:
    """A system at its scene's own state, with its mass matrix and bias."""

    system: flexmb.System
    state: flexmb.State
    M: Real
    bias: Real

    @property
    def bound(self) -> float:
        """Of two routes to the same equations."""
        return algebra(self.system.nu, len(self.system.body_names))

    @property
    def modal(self) -> NDArray[np.bool_]:
        """(nu,) which speeds are those of modes."""
        found = np.zeros(self.system.nu, dtype=bool)
        for body in self.system.constants.body:
            found[body["etad_index"] : body["etad_index"] + body["modes"]] = True
        return found

    @property
    def free(self) -> NDArray[np.bool_]:
        """(nu,) which speeds are not prescribed."""
        return self.system.constants.speed["prescribed"] < 0

    def inertia(self, rates: Real) -> float:
        """Size of the terms of M rates + bias."""
        return float(np.max(np.abs(self.M) @ np.abs(rates) + np.abs(self.bias)))


def random_state(seed: int, level: str, bodies: int, branching: bool = True, **changes) -> RandomState:
    """A random tree or chain of `bodies`; point masses and wheels as in its recipe, unless `changes` say otherwise."""
    recipe = replace(LEVELS[level], bodies=bodies, branching=branching, **changes)
    return of(trees.random_scene(seed, recipe))


def of(scene: flexmb.Scene) -> RandomState:
    """A scene's own initial state."""
    system = flexmb.compile(scene)
    state = system.initial_state
    return RandomState(system, state, system.mass_matrix(state), system.bias(state))
