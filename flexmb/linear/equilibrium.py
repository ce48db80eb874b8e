"""States in which nothing accelerates: Newton's method with the exact derivative of the accelerations.

Steps and errors are measured in the metric of kinetic energy, sqrt(xi' M xi) in m sqrt(kg), in which the method does
not depend on units or scales of modes. Damping follows Deuflhard, Newton Methods for Nonlinear Problems (2004), sec.
3.3: a step is accepted where the next, simplified correction is shorter. Where that fails from the guess, overdamped
motion leads on.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from flexmb.arrays import Index, Real
from flexmb.linear.linearize import displacement_names
from flexmb.linear.variations import Equations, Variations
from flexmb.scene.schema import Scene
from flexmb.state import DynamicsError, State
from flexmb.system import System, compile

CONVERGED = 1e-12  # last correction, part of a displacement of all free coordinates by 1 (rad, m, unit of a mode)
RESIDUAL = 1e-9  # acceleration left, part of that at the start
ROUNDING = 2.0**-46  # the same, part of the stiffness times a displacement of 1: 128 roundings
STEPS = 100
SMALLEST = 2.0**-12  # damping factor
HALVINGS = 10  # of a step of overdamped motion that ends where no accelerations exist
RELAXATIONS, BETWEEN = 200, 4  # steps of overdamped motion, and how many between attempts of Newton's method
FIRST, LONGEST = 0.1, 0.5  # lengths of steps, parts of a displacement of all free coordinates by 1
RANK = 1e-14  # directions stiffer by less than this part of the stiffest one are free to move: they are left alone


class EquilibriumError(ArithmeticError):
    """No state without acceleration was found; the message says what is left and where."""


def equilibrium(system: System | Scene, guess: State | None = None) -> State:
    """The static equilibrium that Newton's method finds from a guess (default: the initial state).

    All speeds are zero; prescribed coordinates, motors and loads keep the values their functions have at the guess's
    time. Wheels without springs stay at their angles. Stable or not: `linearize(..., held=True)` tells.
    Raises EquilibriumError where none is found, NotImplementedError for closed chains.
    """
    if isinstance(system, Scene):
        system = compile(system)
    equations = Equations(system)  # before all else: it refuses closed chains
    guess = system.initial_state if guess is None else guess
    return balanced(equations.held(guess.t), State(guess.q, np.zeros(system.nu), guess.t))


def balanced(equations: Equations, guess: State) -> State:
    """The state near the guess, its speeds kept, in which the free accelerations vanish: static or relative."""
    start = equations.on_functions(guess)
    if not len(equations.free):
        return start
    found = _newton(equations, start)
    if found is not None:
        return found
    try:
        return _relaxed(equations, start)
    except (DynamicsError, np.linalg.LinAlgError) as error:
        raise EquilibriumError(f'scene "{equations.system.scene.name}": no equilibrium found: {error}') from None


def _relaxed(equations: Equations, start: State) -> State:
    """Overdamped motion, M xi' = load, by implicit steps tau that grow as loads fall, until Newton's method converges.

    Pseudo-transient continuation (Kelley & Keyes 1998): it goes downhill, hence to an equilibrium that is stable.
    """
    at, tau, before, moving = equations.variations(start), 0.0, 0.0, equations.movable
    for i in range(1, RELAXATIONS + 1):
        M = equations.mass(at.state)
        scale, size = float(np.sqrt(np.trace(M))), float(np.sqrt(at.rates @ M @ at.rates))
        tau = FIRST * scale / size if i == 1 else tau * before / size
        before, step = size, np.zeros(len(M))
        flow = (M / tau - M @ at.by_displacement)[np.ix_(moving, moving)]
        step[moving] = np.linalg.solve(flow, (M @ at.rates)[moving])
        length = max(float(np.sqrt(step @ M @ step)), CONVERGED * scale)
        at = _moved(equations, at, min(1.0, LONGEST * scale / length) * step)
        if i % BETWEEN == 0 and (found := _newton(equations, at.state)) is not None:
            return found
    raise EquilibriumError(_report(equations, at))


def _moved(equations: Equations, at: Variations, step: Real) -> Variations:
    """After a step, or a half, a quarter ... of it: the longest that ends where the accelerations exist."""
    for halvings in range(HALVINGS):
        try:
            return equations.variations(equations.moved(at, 0.5**halvings * step))
        except DynamicsError:
            continue
    return equations.variations(equations.moved(at, 0.5**HALVINGS * step))


def _newton(equations: Equations, state: State) -> State | None:
    """Where the accelerations vanish; None where Newton's method does not get there."""
    first = None
    try:
        at = equations.variations(state)
        for _ in range(STEPS):
            now = _Linearised(at, equations.mass(at.state), equations.movable)
            first = now.size if first is None else first
            if now.length <= CONVERGED * now.scale:
                removed = now.left <= RESIDUAL * first + ROUNDING * now.stiffness * now.scale
                return at.state if removed else None  # else something accelerates that no displacement holds
            moved = _damped(equations, now)
            if moved is None:
                return None
            at = equations.variations(moved)
    except (DynamicsError, np.linalg.LinAlgError):
        return None
    return None


class _Linearised:
    """Newton's correction at one state, lengths in the metric of kinetic energy, over the movable coordinates.

    step (n,); length: of it; size: of the accelerations; left: of what of them no step removes; stiffness: norm of the
    derivative; scale: length of a displacement of all free coordinates by 1.
    """

    def __init__(self, at: Variations, M: Real, moving: Index) -> None:
        self.at, self._moving = at, moving
        self._root, self._own = np.linalg.cholesky(M), np.linalg.cholesky(M[np.ix_(moving, moving)])
        K = self._root.T @ solve_triangular(self._own, at.by_displacement[:, moving].T, lower=True).T
        U, values, Vt = np.linalg.svd(K, full_matrices=False)
        self.stiffness = float(values[0]) if len(values) else 0.0
        kept = values > RANK * self.stiffness
        self._U, self._back = U[:, kept], Vt[kept].T / values[kept]
        self.scale = float(np.sqrt(np.trace(M)))
        z = self._root.T @ at.rates
        self.size, self.left = float(np.linalg.norm(z)), float(np.linalg.norm(z - self._U @ (self._U.T @ z)))
        self.step, self.length = self.correction(at.rates)

    def correction(self, rates: Real) -> tuple[Real, float]:
        """The step (n,) that removes accelerations (n,) as far as the derivative here says, and its length."""
        y = -self._back @ (self._U.T @ (self._root.T @ rates))
        step = np.zeros(len(rates))
        step[self._moving] = solve_triangular(self._own.T, y, lower=False)
        return step, float(np.linalg.norm(y))


def _damped(equations: Equations, now: _Linearised) -> State | None:
    """After the longest of the steps 1, 1/2, 1/4 ..., LONGEST at most, whose simplified correction is shorter."""
    factor = longest = min(1.0, LONGEST * now.scale / now.length)
    while factor >= SMALLEST * longest:
        moved = equations.moved(now.at, factor * now.step)
        try:
            if now.correction(equations.rates(moved))[1] <= (1.0 - 0.25 * factor) * now.length:
                return moved
        except DynamicsError:
            pass  # beyond what can be evaluated: closer
        factor *= 0.5
    return None


def _report(equations: Equations, at: Variations) -> str:
    """What is left, where, and what to do."""
    left = equations.mass(at.state) @ at.rates
    names, _ = displacement_names(equations)
    worst = int(np.argmax(np.abs(left)))
    return (
        f'scene "{equations.system.scene.name}": no equilibrium found; {left[worst]:.3g} N (N m) are left along '
        f"{names[worst]}. Look for a coordinate without a spring that loads push away, or give a guess closer to it"
    )
