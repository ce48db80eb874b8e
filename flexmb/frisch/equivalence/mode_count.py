"""Number of modes that an appendage needs: the right-hand sides of (149)-(151) as sums that converge to the left ones.

Let the undeformed appendage turn against the base at omega about the clamp; this gives the left-hand sides of
(149)-(151). The modes are normalised by (41) and, all together, complete. In them this motion has the rates
adot_n = s_n . [omega; 0] / m, its projections in the norm of kinetic energy, where s_n is a mode's momentum
[Q_n + m alpha x A_n; m A_n] about the clamp. Hence

    (149)   sum_n adot_n A_n  ->  omega x alpha
    (150)   sum_n adot_n E_n  ->  omega x Phi - Phi x omega
    (151)   sum_n adot_n Q_n  ->  Phi . omega

and likewise for a velocity v of the clamp, with [0; v]. The sum of s_n s_n' / m over the modes is the effective inertia
(6,6) that is coupled to the base elastically; it converges to that of the rigid body about the clamp. A model with that
many modes treats the remainder as fixed to the base at all frequencies. Inertia at the clamp itself, which no mode
moves, is not counted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexmb.frisch.equivalence.appendage import Appendage, inertia_about_origin
from flexmb.frisch.equivalence.relations import weighted_difference
from flexmb.typing import Real

UNIT = np.eye(3)


@dataclass(frozen=True)
class Direction:
    """Convergence for one motion of the base, by number of modes N = 0..n, lowest first.

    `motion` (6,): unit [omega; velocity of the clamp], called `name`; `inertia`: that of the rigid body for it, kg m^2
    about the clamp or kg; `mode_shares` (n,): effective inertia of each mode as a fraction of it; `remainder` (n+1,):
    1 less the shares of the first N modes; `relations` (3,n+1): mismatches of (149)-(151) in the norm of
    `flexmb.frisch.equivalence.relations`, as fractions of the energy of the rigid motion; empty, (0,n+1), for
    translations, on which the relations do not depend.
    """

    name: str
    motion: Real
    inertia: float
    mode_shares: Real
    remainder: Real
    relations: Real

    @property
    def worst(self) -> Real:
        """The largest of remainder and relations (n+1,)."""
        return np.max(np.vstack([self.remainder, self.relations]), axis=0)

    def needed(self, accuracy: float) -> int | None:
        """Least N from which on remainder and relations are within `accuracy`; None if they are not with all modes."""
        within = np.logical_and.accumulate((self.worst <= accuracy)[::-1])[::-1]
        return int(np.argmax(within)) if within[-1] else None

    def taking_part(self, modes: int) -> int:
        """How many of the first `modes` modes have more than a millionth of the inertia for this motion."""
        return int(np.count_nonzero(self.mode_shares[:modes] > 1e-6))


def directions(body: Appendage, axes: ArrayLike = UNIT) -> tuple[Direction, ...]:
    """Turning about and moving along each of `axes` (k,3), left out where the body has no inertia against it."""
    unit = [axis / np.linalg.norm(axis) for axis in np.asarray(axes, dtype=float)]
    still = np.zeros(3)
    motions = [(f"about {_named(axis)}", np.concatenate([axis, still])) for axis in unit]
    motions += [(f"along {_named(axis)}", np.concatenate([still, axis])) for axis in unit]
    whole = inertia_about_origin(body.moving)
    floor = np.repeat([np.trace(whole[part, part]) for part in (slice(0, 3), slice(3, 6))], len(unit))
    inertias = [float(motion @ whole @ motion) for _, motion in motions]
    return tuple(
        _direction(body, name, motion, inertia)
        for (name, motion), inertia, size in zip(motions, inertias, floor, strict=True)
        if inertia > 1e-12 * size
    )


def _direction(body: Appendage, name: str, motion: Real, inertia: float) -> Direction:
    p, n = body.moving, body.mode_count
    mass = body.parameters.mass  # of the normalisation
    rates = body.momenta @ motion / mass
    shares = mass * rates**2 / inertia
    remainder = 1.0 - np.concatenate([[0.0], np.cumsum(shares)])
    relations = np.zeros((0, n + 1))
    if np.any(motion[:3]):
        partial = [np.where(np.arange(n) < N, rates, 0.0) for N in range(n + 1)]
        relations = np.array([weighted_difference(p, motion, some) for some in partial]).T / np.sqrt(inertia)
    return Direction(name, motion, inertia, shares, remainder, relations)


def _named(axis: Real) -> str:
    """x, y or z where it is one of these, else its components."""
    for name, unit in zip("xyz", UNIT, strict=True):
        if np.array_equal(np.abs(axis), unit):
            return name
    return "(" + ", ".join(f"{component:.3g}" for component in axis) + ")"
