"""Equilibria of scenes: states of rest, in which controller states are constant too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexmb.linear.equations import built, entering
from flexmb.linear.newton import balanced
from flexmb.scene.schema import Scene
from flexmb.system.tree_system import System
from flexmb.tables.state import State


def equilibrium(system: System | Scene, guess: State | None = None) -> State:
    """The static equilibrium that Newton's method finds from a guess (default: the initial state).

    All speeds are zero; prescribed coordinates, motors and loads keep the values their functions have at the guess's
    time. Wheels without springs stay at their angles. Of a scene with continuous controllers it is where the closed
    loop rests, the controllers' own states included. Whether the equilibrium is stable is for `linearize(...,
    held=True)`. Raises EquilibriumError where none is found, NotImplementedError for closures on bodies of level
    "ruthless" and sampled controllers, ValueError or TypeError for a guess that is not a state of this system or leaves
    closures open.
    """
    if isinstance(system, Scene) and system.controllers:
        system = built(system)
    if isinstance(system, System) and system.scene.controllers:
        from flexmb.linear.controlled_equilibrium import resting  # imported only for scenes with controllers

        return resting(system, system.initial_state if guess is None else guess)
    equations, guess = entering(system, guess)
    return balanced(equations.held(guess.t), replace(guess, u=np.zeros_like(guess.u)))
