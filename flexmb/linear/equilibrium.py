"""Equilibria of scenes: states of rest, in which controller states are constant too.

Of a closed loop Newton's method is applied to displacements xi and controller states x together, with the linear model
of the loop, so that accelerations and rates of controller states vanish: the state of an integrating controller is not
determined by the displacements. Damping is as in `flexmb.linear.newton`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexmb.linear.equations import built, entering, equations_of
from flexmb.linear.linearize import held_model
from flexmb.linear.newton import LONGEST, SMALLEST, STEPS, EquilibriumError, Stability, balanced, squares, verdict
from flexmb.linear.variations import Equations
from flexmb.scene.schema import Scene
from flexmb.system.system import System
from flexmb.system.watches import of_states, warn
from flexmb.tables.named import brief
from flexmb.tables.state import DynamicsError, State
from flexmb.typing import Real

if TYPE_CHECKING:
    from flexmb.linear.closed_loop import ClosedLoop

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

    EquilibriumError where none is found, NotImplementedError for sampled controllers, ValueError or TypeError for a
    guess that is not a state of this system or leaves closures open.
    """
    from flexmb.linear.closed_loop import continuous_loop  # imported only for scenes with controllers

    t, y = system.layout.entering(guess)
    start = replace(guess, u=np.zeros_like(guess.u))
    if system.constraints:
        start = system.admissible(start)
    equations = equations_of(system).held(t)
    loop = continuous_loop(system)
    try:
        here = _look(loop, equations.on_functions(start), loop.initial(start, {}))
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
    from flexmb.linear.closed_loop import closed_model

    model, rates = closed_model(loop, state, x, held_model, one_sided=True)  # Newton's method needs either slope
    n = len(model.rates)
    rows, columns = slice(n, None), np.r_[:n, 2 * n : len(model.A)]
    return _Place(state, x, np.r_[model.rates, rates], model.A[rows][:, columns])


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

        state = resting(system, system.initial_state if guess is None else guess)
        return as_equilibrium(state, None), system
    equations, guess = entering(system, guess)
    held = equations.held(guess.t)
    equilibrium_state = balanced(held, replace(guess, u=np.zeros_like(guess.u)))
    return as_equilibrium(equilibrium_state.state, verdict(squares(equilibrium_state))), equations.system
