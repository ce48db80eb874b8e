"""Steady spins: relative equilibria in which one hinge or wheel turns at a constant rate."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexmb.linear.equations import entering
from flexmb.linear.linear_model import LinearModel
from flexmb.linear.linearize import linear_model, looked_at
from flexmb.linear.newton import balanced
from flexmb.linear.variations import Equations
from flexmb.scene.open_loop import refuse_feedback
from flexmb.scene.problems import closest
from flexmb.scene.schema import Revolute, Scene
from flexmb.system.system import System
from flexmb.system.watches import warn
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.tables.state import State

DEPENDENT = 1e-9  # change of the accelerations with the angle, as part of the size of their derivatives

CLOSED = "look at the eigenvalues of the closed loop about a state: flexmb.linearize(scene, state)"


@dataclass(frozen=True, eq=False)
class SteadySpin:
    """A relative equilibrium: `state` with `hinge` driven at `rate` (rad/s), and other wheels at their speeds."""

    hinge: str
    rate: float
    state: State
    equations: Equations

    __repr__ = brief

    @property
    def moving(self) -> tuple[Equations, State]:
        """The equations, and the state with all speeds that they prescribe."""
        return self.equations, self.equations.on_functions(self.state)

    def linearize(self) -> LinearModel:
        """The linear model about it, with displacements in the rotating frame and constant coefficients."""
        if not isinstance(self.equations, Equations):
            raise TypeError(f"equations is a {type(self.equations).__name__}: give those of steady_spin")
        self.equations.system.layout.entering(self.state)
        return linear_model(*self.moving)


def steady_spin(system: System | Scene, hinge: str, rate: float, guess: State | None = None) -> SteadySpin:
    """The deformation in which nothing accelerates while `hinge` (revolute, or a wheel) turns at `rate` (rad/s).

    This drive replaces every other drive of it in the scene; other prescribed coordinates stand still, other wheels
    keep the speeds they have in the guess (default: the initial state), other speeds are zero. ValueError where the
    motion of what turns depends on the angle (gravity across the axis, loads in World axes), or where closures make it
    turn other hinges: there is no steady spin.
    EquilibriumError where no deformation is found. Warns (`SceneWarning`) as `simulate` does of levels, points and
    polynomials.
    """
    state_of_spin = spun(system, hinge, rate, guess)
    warn(looked_at([state_of_spin.moving]))
    return state_of_spin


def spun(system: System | Scene, hinge: str, rate: float, guess: State | None = None) -> SteadySpin:
    """The same without warnings: one of several that are looked at together."""
    if isinstance(system, System | Scene):
        scene = system if isinstance(system, Scene) else system.scene
        refuse_feedback(scene, "a steady spin or Campbell diagram", CLOSED)
    base, guess = entering(system, guess)
    system, rate = base.system, arguments.number("rate", rate)
    speed = _turning(system, hinge)
    equations = base.spinning(speed, rate, guess)
    u = np.zeros(system.nu)
    for wheel in system.scene.wheels:
        u[system.speed(wheel.name)] = guess.u[system.speed(wheel.name)]
    state = balanced(equations, replace(guess, u=u)).state
    if np.any(np.abs(state.u - u)[equations.free] > DEPENDENT * abs(rate)):
        raise ValueError(
            f'"{hinge}" turns other hinges through closures, or bends what they join: that is no steady spin; '
            "linearize about the states of a run"
        )
    at = equations.variations(state)
    size = np.sum(np.abs(at.by_displacement), axis=1) + rate**2
    if np.any(np.abs(at.drift) > DEPENDENT * abs(rate) * size):
        raise ValueError(
            f'"{hinge}": what turns feels the angle it is at (gravity across the axis, or a load in World axes): no '
            "deformation is steady; remove gravity, or linearize about the states of a run"
        )
    return SteadySpin(hinge, rate, state, equations)


def _turning(system: System, hinge: str) -> int:
    """Index of the speed of a hinge or wheel with one angle; ValueError for others."""
    angles = [found.name for found in system.scene.hinges if isinstance(found, Revolute)]
    angles += [wheel.name for wheel in system.scene.wheels]
    if hinge not in angles:
        raise ValueError(f"{hinge!r} does not spin about one axis: {closest(hinge, angles)}")
    return system.speed(hinge).start
