"""Which model of an appendage is better for which question, with the numbers of the paper's "Interpretation of
results".

A rigid body on a spring hinge has only one vibration per axis, but its motion is exact at any angle. Modes have one
vibration each, but omit all terms of second order in the deflection, except those of a beam of level exact: they are
its strains, which omit none.

The number of modes that an appendage needs follows from the right-hand sides of (149)-(151) as sums that converge to
the left ones. Let the undeformed appendage turn against the base at omega about the clamp; this gives the left-hand
sides. The modes are normalised by (41) and, all together, complete. In them this motion has the rates
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
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from flexmb.frisch.equivalence.appendage import Appendage, inertia_about_origin
from flexmb.frisch.equivalence.relations import (
    HingeFit,
    best_hinge,
    fit_at,
    modal_effective_inertia,
    weighted_difference,
)
from flexmb.scene.bodies import Level
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


AT_CLAMP, BEST, GIVEN = "hinge at the clamp", "best hinge", "given hinge"


@dataclass(frozen=True)
class Preference:
    """`better` is "rigid" for the spring-hinged rigid body, "flexible" for modes; `reason` has the numbers."""

    question: str
    better: Literal["rigid", "flexible", "either"]
    reason: str


@dataclass(frozen=True)
class Equivalence:
    """An appendage with modes compared with a rigid body on a spring hinge.

    `accuracy`: the requested accuracy, a fraction; `fits` by name: `AT_CLAMP`, `BEST` and, if a point was given,
    `GIVEN`; `directions`: convergence of the modes about and along the body axes and the hinge axes; `verdicts` about
    the given hinge, or the best one.
    """

    appendage: Appendage
    accuracy: float
    fits: dict[str, HingeFit]
    directions: tuple[Direction, ...]
    verdicts: tuple[Preference, ...]


def equivalence(
    body: Appendage,
    *,
    accuracy: float = 0.05,
    axes: ArrayLike | None = None,
    modes: tuple[int, ...] | None = None,
    point: ArrayLike | None = None,
) -> Equivalence:
    """Compare an appendage with rigid models of it.

    `accuracy`, a fraction, decides verdicts and counts of modes; `axes` (k,3) and `modes` as in `best_hinge`; `point`
    (3,) m: a hinge to be judged beside the best one. Raises ValueError as `best_hinge` does.
    """
    if not 0.0 < accuracy < 1.0:
        raise ValueError(f"accuracy is a fraction between 0 and 1, such as 0.05, got {accuracy:g}")
    best = best_hinge(body, axes, modes)
    axes, modes = best.hinge.axes, best.modes
    fits = {AT_CLAMP: fit_at(body, np.zeros(3), axes, modes), BEST: best}
    if point is not None:
        fits[GIVEN] = fit_at(body, point, axes, modes)
    aligned = np.max(np.abs(axes), axis=1) > 1.0 - 1e-9
    springs = directions(body, np.vstack([np.eye(3), axes[~aligned]]))
    return Equivalence(body, accuracy, fits, springs, _verdicts(body, accuracy, fits.get(GIVEN, best)))


def coupling_error(body: Appendage, fit: HingeFit) -> float:
    """Largest relative difference of effective mass and effective inertia between a hinge and its modes, along the
    modes.

    These determine the momentum that base and appendage exchange, and the reaction on the base at resonance.
    """
    hinge, modes = fit.effective_inertia, modal_effective_inertia(body, fit.modes)
    errors = []
    for part in (slice(0, 3), slice(3, 6)):
        size, along = np.linalg.eigh(modes[part, part])
        whole = np.trace(body.rigid_inertia[part, part])
        for value, axis in zip(size, along.T, strict=True):
            if value > 1e-6 * whole:
                errors.append(abs(axis @ hinge[part, part] @ axis / value - 1.0))
    return float(max(errors, default=0.0))


def _verdicts(body: Appendage, accuracy: float, fit: HingeFit) -> tuple[Preference, ...]:
    f = body.frequencies / (2.0 * np.pi)
    first = min(fit.modes)
    mismatch = max(relation.mismatch for group in fit.relations for relation in group)
    coupling = coupling_error(body, fit)
    follows = max(mismatch, coupling) <= accuracy
    named = " and ".join(f"{f[mode]:.4g} Hz" for mode in sorted(fit.modes))
    verdicts = [
        Preference(
            f"vibration at {named} and what it does to the base",
            "either" if follows else "flexible",
            f"(149)-(151) agree within {percent(mismatch)}, effective mass and inertia within {percent(coupling)}",
        )
    ]
    others = [n for n in range(body.mode_count) if n not in fit.modes]
    if others:
        left = _beyond(body, fit)
        verdicts.append(
            Preference(
                f"vibration at other frequencies, from {f[others[0]]:.4g} Hz",
                "flexible",
                f"the hinge has none; modes other than {_listed(fit.modes)} have {percent(left[1])} of the mass across "
                f"the appendage and {percent(left[0])} of its inertia about the clamp",
            )
        )
    return (*verdicts, *_at_large_motion(body.level, accuracy, f[first]))


def _at_large_motion(level: Level, accuracy: float, hertz: float) -> tuple[Preference, Preference]:
    """Where terms matter that the relations omit; hertz: the first frequency that the hinge replaces."""
    bent = f"deflections beyond {np.sqrt(2.0 * accuracy):.2g} rad at the hinge"
    spun = f"base spinning faster than {np.sqrt(accuracy) * hertz:.3g} Hz"
    if level == "exact":
        return (
            Preference(
                bent,
                "flexible",
                "strains of level exact omit terms of no order, and the beam bends all along; the rotation of a hinge "
                "is exact too, but in one place. The numbers above are those of small deflections",
            ),
            Preference(
                spun,
                "either",
                "centrifugal stiffening is in the kinematics of level exact, and of a rigid body on a hinge",
            ),
        )
    return (
        Preference(
            bent,
            "rigid",
            f"modes omit terms of second order, 1 - cos = {percent(accuracy)} there; the rotation of a hinge is exact",
        ),
        Preference(
            spun,
            "rigid",
            f"modes without second-order shapes have no centrifugal stiffening, an error of (spin / {hertz:.4g} "
            "Hz)^2 in the squared frequency; a rigid body on a hinge has it",
        ),
    )


def _beyond(body: Appendage, fit: HingeFit) -> tuple[float, float]:
    """Fractions of the inertia about the hinge axes, and of the mass along the modes' velocity, of all other modes."""
    modal, rigid = modal_effective_inertia(body, fit.modes), inertia_about_origin(body.moving)
    turning = [(q @ modal[:3, :3] @ q) / (q @ rigid[:3, :3] @ q) for q in fit.hinge.axes]
    velocity = [body.parameters.A[mode] for mode in fit.modes]
    moving = [(v @ modal[3:, 3:] @ v) / (v @ rigid[3:, 3:] @ v) for v in velocity if np.any(v)]
    return 1.0 - float(np.mean(turning)), 1.0 - float(np.mean(moving)) if moving else 1.0


def percent(value: float) -> str:
    """A fraction in percent with three digits; round-off is shown as zero."""
    if abs(value) < 1e-9:
        return "0 %"
    return f"{100.0 * value:.3g} %" if abs(value) >= 1e-5 else "< 0.001 %"


def _listed(modes: tuple[int, ...]) -> str:
    return " and ".join(str(mode + 1) for mode in sorted(modes))
