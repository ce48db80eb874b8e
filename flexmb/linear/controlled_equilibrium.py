"""Equilibria of a closed loop: accelerations and rates of controller states are zero.

Newton's method is applied to displacements xi and controller states x together, with the linear model of the closed
loop: the state of an integrating controller is not determined by the displacements. Damping as in
`flexmb.linear.newton`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flexmb.linear.closed_loop import ClosedLoop
from flexmb.linear.equations import equations_of
from flexmb.linear.linearize import held_model
from flexmb.linear.newton import LONGEST, SMALLEST, STEPS, EquilibriumError
from flexmb.linear.variations import Equations
from flexmb.system.system import System
from flexmb.tables.state import DynamicsError, State
from flexmb.typing import Real

CONVERGED = 1e-10  # last correction (rad, m, units of x), of derivatives that are exact to 1e-12
RANK = 1e-12  # stiffness relative to the largest; directions with less are free to move and are not corrected


class _Place(NamedTuple):
    """A state of the motion and x (X,); the residual there, accelerations and rates of x (f+X,), and its derivative."""

    state: State
    x: Real
    left: Real
    derivative: Real


def resting(system: System, guess: State) -> State:
    """The state near the guess, its speeds zero, in which the closed loop rests.

    EquilibriumError where none is found, NotImplementedError for controllers that `ClosedLoop` refuses, ValueError or
    TypeError for a guess that is not a state of this system or leaves closures open.
    """
    t, y = system.layout.entering(guess)
    start = replace(guess, u=np.zeros_like(guess.u))
    if system.constraints:
        start = system.admissible(start)
    equations = equations_of(system).held(t)
    loop = ClosedLoop(system, start)
    try:
        here = _look(loop, equations.on_functions(start), loop.initial)
        for _ in range(STEPS):
            inverse = np.asarray(np.linalg.pinv(here.derivative, RANK), float)
            step = -inverse @ here.left
            if np.abs(step).max(initial=0.0) <= CONVERGED:
                return _if_nothing_is_left(system, here)
            here = _damped(loop, equations, here, inverse, step)
    except (DynamicsError, np.linalg.LinAlgError) as error:
        raise EquilibriumError(f'scene "{system.scene.name}": no equilibrium found: {error}') from None
    raise EquilibriumError(f'scene "{system.scene.name}": no equilibrium found in {STEPS} steps: {_CLOSER}')


_CLOSER = "give a guess closer to it, or a setpoint that the drives can hold"


def _look(loop: ClosedLoop, state: State, x: Real) -> _Place:
    look = loop.at(state, x, held_model, one_sided=True)  # Newton's method needs a slope, of either side
    n = len(look.of_motion.rates)
    rows, columns = slice(n, None), np.r_[:n, 2 * n : len(look.A)]
    return _Place(state, x, np.r_[look.of_motion.rates, look.rates], look.A[rows][:, columns])


def _damped(loop: ClosedLoop, equations: Equations, here: _Place, inverse: Real, step: Real) -> _Place:
    """The result of the longest of the steps 1, 1/2, 1/4 ... whose simplified correction is shorter.

    EquilibriumError if there is none.
    """
    at, n = equations.variations(here.state), equations.freedom
    factor = longest = min(1.0, LONGEST / max(np.abs(step[:n]).max(initial=0.0), LONGEST))
    while factor >= SMALLEST * longest:
        try:
            there = _look(loop, equations.moved(at, factor * step[:n]), here.x + factor * step[n:])
            if np.linalg.norm(inverse @ there.left) <= (1.0 - 0.25 * factor) * np.linalg.norm(step):
                return there
        except DynamicsError:
            pass  # cannot be evaluated there: take a shorter step
        factor *= 0.5
    raise EquilibriumError(f"no step leads closer: {_CLOSER}")


def _if_nothing_is_left(system: System, here: _Place) -> State:
    """The state; EquilibriumError if no displacement removes the residual, as when a controller saturates."""
    size = np.linalg.norm(here.derivative) if here.derivative.size else 0.0
    if np.linalg.norm(here.left) > 1e3 * CONVERGED * max(size, 1.0):
        raise EquilibriumError(
            f'scene "{system.scene.name}": no equilibrium found: accelerations or rates of controllers\' states of '
            f"{np.abs(here.left).max():.3g} are left that no displacement removes: {_CLOSER}"
        )
    return here.state
