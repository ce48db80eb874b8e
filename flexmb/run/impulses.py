"""Impulses along speeds, which give some speeds new values at once and leave positions as they are.

With A = [E; J], E picking these speeds, J u the rates of closures' rows, M = F F' and impulses p of both,

    M (u+ - u-) = A' p,    A u+ = [given; 0],

and x = F' (u+ - u-) is the shortest with (F^-1 A')' x = A u+ - A u-, p the shortest with F^-1 A' p = x. Impulses that
the motion does not determine, of redundant rows and what is held beside them, are NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexmb.closure.factor import DEPENDENT
from flexmb.system.tree_system import System
from flexmb.tables.state import DynamicsError, State, pack
from flexmb.typing import Real

if TYPE_CHECKING:
    from flexmb.closure.impulses import RowMotion

ROUNDING = 2.0**-52
SAME = 1e-7  # impulses that differ by less, beside the largest that do, are the same


class Struck(NamedTuple):
    """u (nu,) afterwards; impulses by place in u (N s or N m s), on the outboard side; energy gained (J).

    closures: (6,) [N m s; N s] on body_b about frame B, World axes, by name. NaN what the motion does not determine.
    """

    u: Real
    impulses: dict[int, float]
    energy: float
    closures: dict[str, Real]


def struck(system: System, state: State, speeds: Mapping[int, float]) -> Struck:
    """The speeds after impulses that give those at some places in u the values that `speeds` says.

    Prescribed speeds keep theirs, by impulses of their drives, and closures stay closed, by theirs. All momentum passes
    through the hinges: that of the whole changes by what those on the ground take. The energy is the impulses' work, at
    the mean of the speeds before and after. Raises DynamicsError where the mass matrix is not positive definite, or
    where closures do not allow such speeds.
    """
    prescribed = np.flatnonzero(system.constants.speed["prescribed"] >= 0).tolist()
    places = sorted({*prescribed, *speeds})
    rows = _rows(system, state) if system.scene.closures else None
    along = np.eye(system.nu)[places] if rows is None else np.vstack([np.eye(system.nu)[places], rows.jacobian])
    change = -along @ state.u
    change[: len(places)] = [speeds.get(j, state.u[j]) - state.u[j] for j in places]
    factors = system.factorise(state)
    half = factors.half_solve(along.T)
    size = _sizes(half, len(places))
    moved, _, rank, _ = np.linalg.lstsq((half / size).T, change / size, rcond=DEPENDENT)
    left = np.abs(half.T @ moved - change) / size
    moving = float(np.sqrt(state.u @ factors.multiply(state.u)))
    _refuse_unreached(left, _unavoidable(moved, moving, change[len(places) :] / size[len(places) :]), state)
    impulses = np.linalg.lstsq(half / size, moved, rcond=DEPENDENT)[0] / size
    u = state.u + factors.solve(along.T @ impulses)
    u[places] = state.u[places] + change[: len(places)]
    if rank == system.nu and not np.any(u[places]):
        u[:] = 0.0  # no freedom is left: of rounding alone closures would seem to open
    held = impulses[: len(places)]
    energy = 0.5 * float(held @ (u[places] + state.u[places]))
    if rows is None:
        return Struck(u, dict(zip(places, held.tolist(), strict=True)), energy, {})
    others = np.linalg.svd(half / size)[2][rank:] / size  # impulses that change no speed
    wrenches = np.array([rows.wrenches(each[len(places) :]) for each in others]).reshape(len(others), -1, 6)
    rounding = SAME * float(np.max(np.abs(others), initial=0.0))
    closures = _determined(rows.wrenches(impulses[len(places) :]), wrenches, rounding)
    held = _determined(held, others[:, : len(places)], rounding)
    return Struck(u, dict(zip(places, held.tolist(), strict=True)), energy, _by_name(system, closures))


def _determined(values: Real, others: Real, rounding: float) -> Real:
    """NaN where one of several sets (k,...) of impulses that change no motion would change a value."""
    return np.where(np.max(np.abs(others), axis=0, initial=0.0) > rounding, np.nan, values)


def _rows(system: System, state: State) -> RowMotion:
    """Of all closures."""
    from flexmb.closure.impulses import RowMotion  # a tree needs none of it
    from flexmb.system.closed import ClosedSystem

    assert isinstance(system, ClosedSystem)
    return RowMotion(system.closures, state.t, pack(state))


def _sizes(half: Real, coordinates: int) -> Real:
    """By which responses are compared: each coordinate's own, and one of all rows, whose impulses are the least."""
    size = np.linalg.norm(half, axis=0)
    size[coordinates:] = np.max(size[coordinates:], initial=0.0)
    return np.where(size > 0.0, size, 1.0)


def _by_name(system: System, wrenches: Real) -> dict[str, Real]:
    return {closure.name: wrench for closure, wrench in zip(system.scene.closures, wrenches, strict=True)}


def _unavoidable(moved: Real, moving: float, opening: Real) -> float:
    """What is left of a change that closures allow, as all here in roots of energy; moving: the speeds before.

    Rounding; motions that count as dependent, which do not take part, and move by twice the speeds at most; and by what
    closures open anyway, which redundant ones need not agree about.
    """
    rounding = (len(moved) + len(opening)) * ROUNDING * float(np.linalg.norm(moved))
    return rounding + 2.0 * DEPENDENT * moving + float(np.linalg.norm(opening))


def _refuse_unreached(left: Real, unavoidable: float, state: State) -> None:
    """DynamicsError where closures and drives leave too little freedom for what an event asks for."""
    if not np.max(left, initial=0.0) <= unavoidable:
        raise DynamicsError(
            f"at t = {state.t:g} s an event asks for a speed that closures and prescribed motions do not allow: the "
            "coordinate has no freedom of its own there; prescribe less, or act on what is free"
        )
