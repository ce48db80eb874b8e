"""Equilibria of scenes: states of rest, in which controller states are constant too."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from flexmb.linear.equations import built, entering
from flexmb.linear.newton import Stability, balanced, squares, verdict
from flexmb.scene.schema import Scene
from flexmb.system.system import System
from flexmb.system.watches import of_states, warn
from flexmb.tables.brief import brief
from flexmb.tables.state import State


@dataclass(frozen=True, eq=False)
class Equilibrium(State):
    """A state of rest. stability: "stable", "neutral" or "unstable" by the tangent stiffness along what closures allow,
    with loads, drives and functions of time held; None in a state that was made from this one with other values, and
    where controllers act, of whose loop `linearize` tells."""

    stability: Stability | None = field(default=None, init=False)

    __repr__ = brief

    def __reduce__(self) -> tuple[Any, ...]:
        """As for a state."""
        return _known, (self.q, self.u, self.t, self.layout, self.stability)


def _known(q: Any, u: Any, t: float, layout: Any, found: Stability | None) -> Equilibrium:
    state = Equilibrium(q, u, t, layout)
    object.__setattr__(state, "stability", found)
    return state


def as_equilibrium(state: State, found: Stability | None) -> Equilibrium:
    """The state with a verdict."""
    return _known(state.q, state.u, state.t, state.layout, found)


def equilibrium(system: System | Scene, guess: State | None = None) -> Equilibrium:
    """The static equilibrium that Newton's method finds from a guess (default: the initial state).

    All speeds are zero; prescribed coordinates, motors and loads keep the values their functions have at the guess's
    time. Wheels without springs stay at their angles. Of a scene with continuous controllers it is where the closed
    loop rests, the controllers' own states included. From a guess where loads oppose every displacement it is the
    equilibrium that follows as what is out of balance there fades away, if that is stable, else one that overdamped
    motion leads to; near an unstable one that: `stability` of the result says. Loads that bend a structure far are
    followed through by `equilibrium_path`.

    Raises EquilibriumError where none is found, NotImplementedError for closures on bodies of level "ruthless" and
    sampled controllers, ValueError or TypeError for a guess that is not a state of this system or leaves closures open.
    Warns (`SceneWarning`) of beams of level exact that bend more than their points or polynomials can follow, or whose
    held stretch loads would change by a thousandth (`allow` waives each, see `Scene`).
    """
    state, system = found_equilibrium(system, guess)
    warn(of_states(system, [state]))
    return state


def found_equilibrium(system: System | Scene, guess: State | None) -> tuple[Equilibrium, System]:
    """The same without warnings, with the system."""
    if isinstance(system, Scene) and system.controllers:
        system = built(system)
    if isinstance(system, System) and system.scene.controllers:
        from flexmb.linear.controlled_equilibrium import resting  # imported only for scenes with controllers

        state = resting(system, system.initial_state if guess is None else guess)
        return as_equilibrium(state, None), system
    equations, guess = entering(system, guess)
    held = equations.held(guess.t)
    equilibrium_state = balanced(held, replace(guess, u=np.zeros_like(guess.u)))
    return as_equilibrium(equilibrium_state.state, verdict(squares(equilibrium_state))), equations.system
