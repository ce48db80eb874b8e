"""Impulses along speeds, which give some speeds new values instantaneously and leave positions unchanged.

With A = [E; J], E picking these speeds, J u the rates of closures' rows, M = F F' and impulses p of both,

    M (u+ - u-) = A' p,    A u+ = [given; 0],

where x = F' (u+ - u-) is the minimum-norm solution of (F^-1 A')' x = A u+ - A u-, and p that of F^-1 A' p = x.
Impulses that the motion does not determine, because rows are redundant, are NaN.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexmb.closure.factor import DEPENDENT
from flexmb.system.system import System
from flexmb.tables.state import DynamicsError, State, pack
from flexmb.typing import Index, Real

if TYPE_CHECKING:
    from flexmb.closure.operators import RowMotion

ROUNDING = 2.0**-52
SAME = 1e-7  # relative to the largest component: smaller components of undetermined impulses count as zero


class Struck(NamedTuple):
    """u (nu,) after the impulses; impulses by index in u (N s or N m s), on the outboard side; energy gained (J).

    closures: (6,) [N m s; N s] on body_b about frame B, World axes, by name. Impulses that the motion does not
    determine are NaN.
    """

    u: Real
    impulses: dict[int, float]
    energy: float
    closures: dict[str, Real]


def struck(system: System, state: State, speeds: Mapping[int, float], closing: str | None = None) -> Struck:
    """The speeds after impulses that give some speeds new values: `speeds` by index in u. `closing`: a closure that
    closes at this instant, whose impulse takes the motion away that it suppresses, and does work on it.

    Impulses of drives keep prescribed speeds unchanged, and impulses of closures keep closures closed. All impulses act
    through hinges: the total momentum changes only by those of hinges on the ground. The energy is the impulses' work,
    at the mean of the speeds before and after. Raises DynamicsError if the mass matrix is not positive definite, or if
    closures do not allow such speeds.
    """
    prescribed = np.flatnonzero(system.constants.speed["prescribed"] >= 0).tolist()
    places = sorted({*prescribed, *speeds})
    rows = _rows(system, state) if system.scene.constraints else None
    along = np.eye(system.nu)[places] if rows is None else np.vstack([np.eye(system.nu)[places], rows.jacobian])
    change = -along @ state.u
    change[: len(places)] = [speeds.get(j, state.u[j]) - state.u[j] for j in places]
    factors = system.factorise(state)
    half = factors.half_solve(along.T)
    size = _sizes(half, len(places))
    moved, _, rank, _ = np.linalg.lstsq((half / size).T, change / size, rcond=DEPENDENT)
    left = np.abs(half.T @ moved - change) / size
    moving = float(np.sqrt(state.u @ factors.multiply(state.u)))
    takes = np.zeros(0, np.int64) if closing is None else len(places) + _rows_of(system, closing)
    opening = np.delete(change / size, takes)[len(places) :]  # but the rates that the impulse is to take away
    _refuse_unreached(left, _unavoidable(moved, moving, opening), state)
    impulses = np.linalg.lstsq(half / size, moved, rcond=DEPENDENT)[0] / size
    u = state.u + factors.solve(along.T @ impulses)
    u[places] = state.u[places] + change[: len(places)]
    if rank == system.nu and not np.any(u[places]):
        u[:] = 0.0  # no freedom is left: rounding errors in u would violate the closures
    held = impulses[: len(places)]
    energy = 0.5 * float(held @ (u[places] + state.u[places])) - 0.5 * float(impulses[takes] @ change[takes])
    if rows is None:
        return Struck(u, dict(zip(places, held.tolist(), strict=True)), energy, {})
    others = np.linalg.svd(half / size)[2][rank:] / size  # impulses that change no speed
    changes = [rows.wrenches(other[len(places) :]) for other in others]
    wrenches = np.array(changes).reshape(len(others), len(system.scene.constraints), 6)
    rounding = SAME * float(np.max(np.abs(others), initial=0.0))
    closures = _determined(rows.wrenches(impulses[len(places) :]), wrenches, rounding)
    held = _determined(held, others[:, : len(places)], rounding)
    return Struck(u, dict(zip(places, held.tolist(), strict=True)), energy, _by_name(system, closures))


class Mobility(NamedTuple):
    """Accelerations of k coordinates by unit loads along each (k,k), with what holds other speeds and closures and
    without it; energy (J): twice the kinetic energy."""

    constrained: Real
    free: Real
    energy: float


def mobility(system: System, t: float, y: Real, places: Sequence[int]) -> Mobility:
    """Of the speeds with these indices in u, at y = [q, u, work]; DynamicsError if the mass matrix is not positive
    definite."""
    state = system.state(y[: system.nq].copy(), y[system.nq : -1].copy(), t)
    held = np.flatnonzero(system.constants.speed["prescribed"] >= 0).tolist()
    factors, unit = system.factorise(state), np.eye(system.nu)
    half = factors.half_solve(unit[list(places)].T)
    along = unit[held] if not system.scene.constraints else np.vstack([unit[held], _rows(system, state).jacobian])
    free = half.T @ half
    if len(along):
        fixed = factors.half_solve(along.T)
        basis, size, _ = np.linalg.svd(fixed / _sizes(fixed, len(held)), full_matrices=False)
        basis = basis[:, size > DEPENDENT * size[0]]
        half = half - basis @ (basis.T @ half)
    return Mobility(half.T @ half, free, float(state.u @ factors.multiply(state.u)))


def _determined(values: Real, others: Real, rounding: float) -> Real:
    """The values, NaN where one of the sets `others` (k,...) of impulses that change no motion has a component."""
    return np.where(np.max(np.abs(others), axis=0, initial=0.0) > rounding, np.nan, values)


def _rows(system: System, state: State) -> RowMotion:
    """The rows of all closures."""
    from flexmb.closure.operators import RowMotion  # imported here because trees do not need it

    assert system.closures is not None  # it has rows
    return RowMotion(system.closures, state.t, pack(state))


def _rows_of(system: System, name: str) -> Index:
    """The numbers of the rows of a closure."""
    assert system.closures is not None  # the closure is one of them
    number = [closure.name for closure in system.scene.closures].index(name)
    return np.flatnonzero(system.closures.constants[1].row["closure"] == number)


def _sizes(half: Real, coordinates: int) -> Real:
    """Scales of the columns of `half`: for each coordinate its own norm, for all rows of closures their largest norm,
    because the impulses of closures are those of minimum norm."""
    size = np.linalg.norm(half, axis=0)
    size[coordinates:] = np.max(size[coordinates:], initial=0.0)
    return np.where(size > 0.0, size, 1.0)


def _by_name(system: System, wrenches: Real) -> dict[str, Real]:
    return {closure.name: wrench for closure, wrench in zip(system.scene.constraints, wrenches, strict=True)}


def _unavoidable(moved: Real, moving: float, opening: Real) -> float:
    """Bound on the residual of a change of speed that closures allow, in sqrt(J) as all arguments are; moving: the norm
    of the speeds before.

    It sums rounding; the motions that count as dependent and are left out, which change by at most twice the speeds;
    and the rates by which closures open already, which may be inconsistent for redundant rows.
    """
    rounding = (len(moved) + len(opening)) * ROUNDING * float(np.linalg.norm(moved))
    return rounding + 2.0 * DEPENDENT * moving + float(np.linalg.norm(opening))


def _refuse_unreached(left: Real, unavoidable: float, state: State) -> None:
    """DynamicsError if closures and drives leave too little freedom for the speed that an event requires."""
    if not np.max(left, initial=0.0) <= unavoidable:
        raise DynamicsError(
            f"at t = {state.t:g} s an event requires a speed that closures and prescribed motions do not allow: the "
            "coordinate has no freedom of its own there; prescribe fewer coordinates, or act on a free one"
        )
