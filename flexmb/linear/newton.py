"""States of rest: Newton's method on the generalised forces, with their exact tangent stiffness.

Forces are those of inverse dynamics without accelerations. These, M udot, vanish where the accelerations do, but not
their derivatives: where the inertia depends on the coordinates, those of accelerations would lead astray. Steps and
errors are measured in the metric of kinetic energy, sqrt(xi' M xi) in m sqrt(kg), in which the method does not depend
on units or scales of modes. Damping follows Deuflhard, Newton Methods for Nonlinear Problems (2004), sec. 3.3 and 3.1:
steps stay so short that they follow the path along which all forces that the guess leaves fade in proportion, so that
one does not jump to another branch. If this fails, or ends far away in an unstable equilibrium, pseudo-transient
continuation (overdamped motion) provides a better guess.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from scipy.linalg import eigvals

from flexmb.linear.linear_model import Complex
from flexmb.linear.triangular import backward, forward
from flexmb.linear.variations import Equations, RestForces
from flexmb.tables.state import DynamicsError, State
from flexmb.typing import Real

CONVERGED = 1e-12  # last correction, as part of a displacement of all free coordinates by 1 (rad, m, unit of a mode)
RESIDUAL = 1e-9  # remaining acceleration, relative to that at the start
ROUNDING = 2.0**-46  # the same, as part of the stiffness times a displacement of 1: 128 roundings
STEPS = 400
ASTRAY = 0.5  # distance of a step's end from that path, parts of the step
SMALLEST = 2.0**-12  # damping factor
SHORTENINGS = 20  # by 4, of a step of overdamped motion
RELAXATIONS = 200  # steps of overdamped motion
FIRST, LONGEST = 0.1, 0.5  # lengths of steps, parts of a displacement of all free coordinates by 1
DOUBLE = 2.0**-20  # imaginary part that rounding gives to double eigenvalues
STRAINED = 0.01  # of a displacement of length 1 without stiffness: strains from which on it is no motion of free bodies
RANK = 1e-14  # stiffness relative to the largest; directions with less are free to move and are not corrected


Stability = Literal["stable", "neutral", "unstable"]


class EquilibriumError(ArithmeticError):
    """No state without acceleration was found; the message says which acceleration remains and where."""


def balanced(equations: Equations, guess: State) -> RestForces:
    """The state near the guess, with the guess's speeds, in which the free accelerations vanish; its forces."""
    start = equations.on_functions(guess)
    if not equations.freedom:
        return equations.forces(start)
    equilibrium = _newton(equations, start)
    if equilibrium is not None and (equilibrium.settling or equilibrium.is_near):
        return equilibrium.at
    try:
        return _relaxed(equations, start)
    except EquilibriumError:
        if equilibrium is None:
            raise
    except (DynamicsError, np.linalg.LinAlgError) as error:
        if equilibrium is None:
            raise EquilibriumError(f'scene "{equations.system.scene.name}": no equilibrium found: {error}') from None
    return equilibrium.at


def corrected(equations: Equations, at: RestForces) -> State:
    """The state that the next correction of an equilibrium leads to.

    `balanced` ends where it is below `CONVERGED`, and leaves it. It is of second order in what was left before, and
    brings the state to the rounding of its forces.
    """
    return equations.moved(at, _Linearised(at).step)


def _relaxed(equations: Equations, start: State) -> RestForces:
    """Overdamped motion, M xi' = load, by implicit steps tau that grow as they succeed, then Newton's method.

    Pseudo-transient continuation (Kelley & Keyes 1998), with steps chosen as in a trust region (Nocedal & Wright 2006,
    alg. 4.1): the loads do work in every step. Newton's method is tried only where the loads oppose every displacement,
    so that it does not converge to an unstable equilibrium.
    """
    here = _Loads(equations.forces(start))
    tau = FIRST * here.scale / here.size
    for _ in range(RELAXATIONS):
        if here.settling and (found := _newton(equations, here.at.state)) is not None and found.settling:
            return found.at
        further = _downhill(equations, here, tau)
        if further is None:
            break
        here, tau = _Loads(further[0]), further[1]
    found = _newton(equations, here.at.state)
    if found is None:
        raise EquilibriumError(_report(equations, here.at))
    return found.at


class _Loads:
    """Over the movable coordinates at a state: loads (n,), their derivative and inertia (n,n).

    settling: whether loads oppose every displacement; size of the accelerations and scale of a displacement by 1, both
    in the metric.
    """

    def __init__(self, at: RestForces) -> None:
        M, moving = at.mass, at.movable
        self.at = at
        self.loads, self.derivative = at.load[moving], -at.stiffness[np.ix_(moving, moving)]
        self.inertia, self.size = M[np.ix_(moving, moving)], float(np.sqrt(at.rates @ M @ at.rates))
        self.scale = float(np.sqrt(np.trace(M)))
        self.settling = _is_settling(-self.derivative)


def _downhill(equations: Equations, here: _Loads, tau: float) -> tuple[RestForces, float] | None:
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
                    return equations.forces(there), tau * (4.0 if work >= 0.75 * promised else 1.0)
        except (DynamicsError, np.linalg.LinAlgError):
            pass  # too long in any case
        tau *= 0.25
    return None


def _is_settling(stiffness: Real) -> bool:
    """Whether forces oppose every displacement, or none that leaves them as they are."""
    values = np.linalg.eigvalsh(stiffness + stiffness.T)
    return bool(np.min(values, initial=0.0) >= -ROUNDING * np.max(values, initial=0.0))


class _Found(NamedTuple):
    """An equilibrium; is_near: undamped steps led to it, from a guess with loads that some displacement follows."""

    at: RestForces
    settling: bool
    is_near: bool


def _newton(equations: Equations, state: State) -> _Found | None:
    """The state where the forces vanish; None if Newton's method does not reach it."""
    first: _Linearised | None = None
    undamped = True
    try:
        now = _Linearised(equations.forces(state))
        for _ in range(STEPS):
            first = now if first is None else first
            if now.length <= CONVERGED * now.scale:
                removed = now.left <= RESIDUAL * first.size + ROUNDING * now.stiffness * now.scale
                if not removed:
                    return None  # no displacement removes the rest
                if now.left > RESIDUAL * first.size:
                    _refuse_unresolved(equations, now)
                return _Found(now.at, now.settling, undamped and not first.settling)
            moved = _damped(equations, now)
            if moved is None:
                return None
            undamped = undamped and moved[1] == 1.0
            now = _Linearised(equations.forces(moved[0]))
    except (DynamicsError, np.linalg.LinAlgError):
        return None
    return None


class _Linearised:
    """Newton's correction at one state, lengths in the metric of kinetic energy, over the movable coordinates.

    step (n,) and its length; size: of the accelerations; left: size of the part that no step removes; stiffness: norm
    of the tangent; scale: length of a displacement of all free coordinates by 1; settling: see `_is_settling`.
    """

    def __init__(self, at: RestForces) -> None:
        M, moving = at.mass, at.movable
        self.at, self._moving = at, moving
        self._root, self._own = np.linalg.cholesky(M), np.linalg.cholesky(M[np.ix_(moving, moving)])
        half = forward(self._own, at.stiffness[:, moving].T).T
        U, values, Vt = np.linalg.svd(forward(self._root, half), full_matrices=False)
        self.stiffness = float(values[0]) if len(values) else 0.0
        kept = values > RANK * self.stiffness
        self._U, self._back, self._free = U[:, kept], Vt[kept].T / values[kept], Vt[~kept].T
        self.scale = float(np.sqrt(np.trace(M)))
        self.settling = _is_settling(forward(self._own, half[moving]))
        z = forward(self._root, at.load)
        self.size, self.left = float(np.linalg.norm(z)), float(np.linalg.norm(z - self._U @ (self._U.T @ z)))
        self._along = self.correction(at.load)
        self.length = float(np.linalg.norm(self._along))
        self.step = np.zeros(len(z))
        self.step[moving] = backward(self._own, self._along)

    def free(self) -> Real:
        """(n,k) displacements of length 1 without stiffness beside the largest one, by `RANK`."""
        found = np.zeros((len(self.step), self._free.shape[1]))
        found[self._moving] = backward(self._own, self._free)
        return found

    def correction(self, load: Real) -> Real:
        """The step that removes a load (n,) as far as the tangent here says, in orthonormal coordinates."""
        z = forward(self._root, load)
        return np.asarray(self._back @ (self._U.T @ z))

    def strays(self, factor: float, load: Real) -> float:
        """How far the load (n,) after `factor` of the step is from what the tangent says, as part of that step."""
        ahead = self.correction(load) - (1.0 - factor) * self._along
        return float(np.linalg.norm(ahead)) / (factor * self.length)


def _refuse_unresolved(equations: Equations, now: _Linearised) -> None:
    """EquilibriumError if strains of a body are among the directions without stiffness, along which load is left.

    A strain is never free: its stiffness is below the rounding of the largest one, so that the load along it is neither
    removed nor told from rounding.
    """
    free, mass = now.free(), now.at.mass
    strains = np.zeros(equations.system.nu, bool)
    for body in equations.constants.body:
        strains[int(body["etad_index"]) : int(body["etad_index"] + body["modes"])] = True
    own = free * strains[equations.free[now.at.chosen]][:, None]
    shares = np.einsum("ik,ij,jk->k", own, mass, own)
    if np.max(shares, initial=0.0) <= STRAINED:
        return
    worst = int(np.argmax(np.abs(own[:, np.argmax(shares)])))
    raise EquilibriumError(
        f'scene "{equations.system.scene.name}": no equilibrium can be told: the stiffness along '
        f"{equations.labels.displacements[now.at.chosen[worst]][0]} is below {RANK:g} of the largest one, and lost in "
        "rounding. Give the body fewer polynomials or modes, or pieces"
    )


def _damped(equations: Equations, now: _Linearised) -> tuple[State, float] | None:
    """The result of the longest of the steps 1, 1/2, 1/4 ..., LONGEST at most, that does not lead astray; and that."""
    factor = longest = min(1.0, LONGEST * now.scale / now.length)
    while factor >= SMALLEST * longest:
        try:
            moved = equations.moved(now.at, factor * now.step)
            if now.strays(factor, equations.loads(moved, now.at)) <= ASTRAY:
                return moved, factor
        except DynamicsError:
            pass  # cannot be evaluated there: take a shorter step
        factor *= 0.5
    return None


def squares(at: RestForces) -> Complex:
    """The eigenvalues omega^2 (rad^2/s^2) of the tangent stiffness along what closures allow, against the inertia."""
    square = np.ix_(at.movable, at.movable)
    values: Complex = eigvals(at.stiffness[square], at.mass[square]) if len(at.movable) else np.zeros(0, complex)
    return values


def verdict(squares: Complex) -> Stability:
    """Of an equilibrium, by its `squares`.

    "stable": all are positive; where forces have a potential the stiffness is definite then. "neutral": some vanish
    within rounding. "unstable": some are negative, or complex as under forces that follow what they load.
    """
    rounding = ROUNDING * np.max(np.abs(squares), initial=0.0)
    if np.any(squares.real < -rounding) or np.any(np.abs(squares.imag) > DOUBLE * np.abs(squares) + rounding):
        return "unstable"
    return "stable" if np.all(squares.real > rounding) else "neutral"


def _report(equations: Equations, at: RestForces) -> str:
    """The error message: which acceleration remains, where, and the remedy."""
    left, now = at.mass @ at.rates, _Linearised(at)
    names = [name for name, _ in equations.labels.displacements]
    worst = int(np.argmax(np.abs(left)))
    try:
        ahead = LONGEST * now.scale / max(now.length, LONGEST * now.scale)
        equations.loads(equations.moved(at, ahead * now.step), at)
    except DynamicsError as error:
        return f'scene "{equations.system.scene.name}": no equilibrium found as far as the search can go: {error}'
    return (
        f'scene "{equations.system.scene.name}": no equilibrium found; {left[worst]:.3g} N (N m) are left along '
        f"{names[at.chosen[worst]]}. Look for a coordinate without a spring that loads push away, or give a guess "
        "closer to it"
    )
