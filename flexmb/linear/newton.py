"""States without acceleration: Newton's method with the exact derivative of the accelerations.

Steps and errors are measured in the metric of kinetic energy, sqrt(xi' M xi) in m sqrt(kg), in which the method does
not depend on units or scales of modes. Damping follows Deuflhard, Newton Methods for Nonlinear Problems (2004), sec.
3.3: a step is accepted if the next, simplified correction is shorter. If this fails from the guess, pseudo-transient
continuation (overdamped motion) provides a better guess.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from flexmb.linear.linearize import displacement_names
from flexmb.linear.variations import Equations, Variations
from flexmb.tables.state import DynamicsError, State
from flexmb.typing import Real

CONVERGED = 1e-12  # last correction, as part of a displacement of all free coordinates by 1 (rad, m, unit of a mode)
RESIDUAL = 1e-9  # remaining acceleration, relative to that at the start
ROUNDING = 2.0**-46  # the same, as part of the stiffness times a displacement of 1: 128 roundings
STEPS = 100
SMALLEST = 2.0**-12  # damping factor
SHORTENINGS = 20  # by 4, of a step of overdamped motion
RELAXATIONS = 200  # steps of overdamped motion
FIRST, LONGEST = 0.1, 0.5  # lengths of steps, parts of a displacement of all free coordinates by 1
RANK = 1e-14  # stiffness relative to the largest; directions with less are free to move and are not corrected


class EquilibriumError(ArithmeticError):
    """No state without acceleration was found; the message says which acceleration remains and where."""


def balanced(equations: Equations, guess: State) -> State:
    """The state near the guess, with the guess's speeds, in which the free accelerations vanish."""
    start = equations.on_functions(guess)
    if not equations.freedom:
        return start
    found = _newton(equations, start)
    if found is not None:
        return found
    try:
        return _relaxed(equations, start)
    except (DynamicsError, np.linalg.LinAlgError) as error:
        raise EquilibriumError(f'scene "{equations.system.scene.name}": no equilibrium found: {error}') from None


def _relaxed(equations: Equations, start: State) -> State:
    """Overdamped motion, M xi' = load, by implicit steps tau that grow as they succeed, then Newton's method.

    Pseudo-transient continuation (Kelley & Keyes 1998), with steps chosen as in a trust region (Nocedal & Wright 2006,
    alg. 4.1): the loads do work in every step. Newton's method is tried only where the loads oppose every displacement,
    so that it does not converge to an unstable equilibrium.
    """
    here = _Loads(equations, equations.variations(start))
    tau = FIRST * here.scale / here.size
    for _ in range(RELAXATIONS):
        if here.settling and (found := _newton(equations, here.at.state)) is not None:
            return found
        further = _downhill(equations, here, tau)
        if further is None:
            break
        here, tau = _Loads(equations, further[0]), further[1]
    found = _newton(equations, here.at.state)
    if found is None:
        raise EquilibriumError(_report(equations, here.at))
    return found


class _Loads:
    """Over the movable coordinates at a state: loads (n,), their derivative and inertia (n,n).

    settling: whether loads oppose every displacement; size of the accelerations and scale of a displacement by 1, both
    in the metric.
    """

    def __init__(self, equations: Equations, at: Variations) -> None:
        M, moving = at.mass, at.movable
        self.at = at
        self.loads, self.derivative = (M @ at.rates)[moving], (M @ at.by_displacement)[np.ix_(moving, moving)]
        self.inertia, self.size = M[np.ix_(moving, moving)], float(np.sqrt(at.rates @ M @ at.rates))
        self.scale = float(np.sqrt(np.trace(M)))
        growth = np.linalg.eigvalsh(self.derivative + self.derivative.T)
        self.settling = bool(np.max(growth, initial=0.0) <= -ROUNDING * np.min(growth, initial=0.0))


def _downhill(equations: Equations, here: _Loads, tau: float) -> tuple[Variations, float] | None:
    """The result of the longest of the steps tau, tau/4, tau/16 ... that does at least a quarter of the predicted work,
    and the next tau."""
    moving, step = here.at.movable, np.zeros(len(here.at.rates))
    for _ in range(SHORTENINGS):
        flow = here.inertia / tau - here.derivative
        try:
            np.linalg.cholesky(flow + flow.T)  # otherwise the step is longer than the fastest growth, and leads uphill
            s = np.linalg.solve(flow, here.loads)
            if s @ here.inertia @ s <= (LONGEST * here.scale) ** 2:
                step[moving] = s
                there = equations.moved(here.at, step)
                left = equations.loads(there, here.at)[moving]
                work, promised = 0.5 * s @ (here.loads + left), s @ here.loads + 0.5 * s @ here.derivative @ s
                if work >= 0.25 * promised:
                    return equations.variations(there), tau * (4.0 if work >= 0.75 * promised else 1.0)
        except (DynamicsError, np.linalg.LinAlgError):
            pass  # too long in any case
        tau *= 0.25
    return None


def _newton(equations: Equations, state: State) -> State | None:
    """The state where the accelerations vanish; None if Newton's method does not reach it."""
    first = None
    try:
        at = equations.variations(state)
        for _ in range(STEPS):
            now = _Linearised(at)
            first = now.size if first is None else first
            if now.length <= CONVERGED * now.scale:
                removed = now.left <= RESIDUAL * first + ROUNDING * now.stiffness * now.scale
                return at.state if removed else None  # otherwise no displacement removes the rest
            moved = _damped(equations, now)
            if moved is None:
                return None
            at = equations.variations(moved)
    except (DynamicsError, np.linalg.LinAlgError):
        return None
    return None


class _Linearised:
    """Newton's correction at one state, lengths in the metric of kinetic energy, over the movable coordinates.

    step (n,) and its length; size: of the accelerations; left: size of the part that no step removes; stiffness: norm
    of the derivative; scale: length of a displacement of all free coordinates by 1.
    """

    def __init__(self, at: Variations) -> None:
        M, moving = at.mass, at.movable
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
    """The result of the longest of the steps 1, 1/2, 1/4 ..., LONGEST at most, whose simplified correction is shorter.
    """
    factor = longest = min(1.0, LONGEST * now.scale / now.length)
    while factor >= SMALLEST * longest:
        try:
            moved = equations.moved(now.at, factor * now.step)
            if now.correction(equations.rates(moved)[now.at.chosen])[1] <= (1.0 - 0.25 * factor) * now.length:
                return moved
        except DynamicsError:
            pass  # cannot be evaluated there: take a shorter step
        factor *= 0.5
    return None


def _report(equations: Equations, at: Variations) -> str:
    """The error message: which acceleration remains, where, and the remedy."""
    left = at.mass @ at.rates
    names, _ = displacement_names(equations)
    worst = int(np.argmax(np.abs(left)))
    return (
        f'scene "{equations.system.scene.name}": no equilibrium found; {left[worst]:.3g} N (N m) are left along '
        f"{names[at.chosen[worst]]}. Look for a coordinate without a spring that loads push away, or give a guess "
        "closer to it"
    )
