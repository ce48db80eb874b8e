"""Assembly: consistent initial conditions from a user's approximate ones, or an error that says why there are none.

Coordinates are corrected by damped Gauss-Newton steps (Levenberg-Marquardt), then the speeds. Each correction is the
smallest in the metric of kinetic energy, in which modal masses are increased in proportion to the modal stiffness, so
that modes change only where hinges cannot close the loop. Prescribed coordinates and speeds are not changed. Rows are
weighted with a length of the scene, and compared with the size of their closure.

Values that the user asked for (`flexmb.closure.asked`) are held if the remaining ones can close the loops. These are
tried in turn: all given values and all modes are held; all given values are held and modes may change; only insisted
values are held; nothing is held.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from flexmb.closure.asked import NO_HOLD, NOTHING_ASKED, AskedFor, KeptValues, Value, Wishes
from flexmb.closure.closures import ClosureError, Closures
from flexmb.closure.factor import DEPENDENT
from flexmb.closure.null_loads import GroupResponse
from flexmb.closure.projection import CLOSED, MOVING_APART, OPEN
from flexmb.tables.status import OK
from flexmb.typing import Real

STEPS = 200
NEARLY_CLOSED = 2.0**-40  # gap that counts as closed if values are held: few free speeds amplify rounding
STRONGEST = 1e12  # damping at which the iteration gives up


def consistent(closures: Closures, t: float, y: Real, asked: AskedFor = NOTHING_ASKED) -> Real:
    """y = [q, u, work] near the given one that fulfils all closures and keeps the requested values exactly.

    If these cannot be kept, the nearest closed state. ClosureError if there is none, or if values that the scene marks
    as given cannot be kept.
    """
    y = _as_asked(closures, t, y.copy(), asked.coordinates, asked, _closed, _errors)
    closures.linearise(t, y)
    closures.count_rows()
    _refuse_half_a_turn(closures)
    return _as_asked(closures, t, y, asked.speeds, asked, _moving, _rates)


Closing = Callable[[Closures, float, Real, KeptValues], Real]
Opening = Callable[[Closures, float, Real, Real], float]


def _as_asked(
    closures: Closures, t: float, y: Real, wishes: Wishes, asked: AskedFor, closing: Closing, opening: Opening
) -> Real:
    """The result of `closing`, which takes the values to hold and may raise ClosureError.

    `opening`: how far a state y is from closed, relative to another state.
    """
    if opening(closures, t, y, y) <= CLOSED:
        return y
    for wish in dict.fromkeys((wishes.given, wishes.insisted)):
        for hold in _holds(closures, t, y, wish, asked, closing) if wish else ():
            try:
                kept = closing(closures, t, y, hold)
            except ClosureError:
                continue
            turned = any(turned for _, turned in closures.half_turned())
            if opening(closures, t, kept, y) <= NEARLY_CLOSED and not turned:
                return kept
    nearest = closing(closures, t, y, NO_HOLD)
    if wishes.insisted and asked.is_marked:
        names = ", ".join(f'"{asked.name(each)}"' for each in wishes.insisted)
        raise ClosureError(
            f"marked as given, but closures do not allow these values: {names}. Correct them, or remove the mark of "
            "one, which then follows from the others"
        )
    return nearest


def _holds(
    closures: Closures, t: float, y: Real, wish: tuple[Value, ...], asked: AskedFor, closing: Closing
) -> Iterator[KeptValues]:
    """The values to hold, in the order in which they are tried: modes are released only if hinges alone fail."""
    yield asked.hold(wish, modes=True)
    if asked.modes and not _closes(closing, closures, t, y, asked.hold((), modes=True)):
        yield asked.hold(wish, modes=False)


def _closes(closing: Closing, closures: Closures, t: float, y: Real, hold: KeptValues) -> bool:
    try:
        closing(closures, t, y, hold)
    except ClosureError:
        return False
    return True


def _closed(closures: Closures, t: float, y: Real, hold: KeptValues) -> Real:
    start, y = y, y.copy()
    errors, damping = _all_errors(closures, t, y), 1e-3
    for _ in range(STEPS):
        if _largest(errors) <= CLOSED or damping > STRONGEST:
            break
        found = decomposed(closures, t, y, hold)
        # The damping decreases with the errors, so that convergence is quadratic, also where rows become dependent.
        fading = damping * min(1.0, float(np.linalg.norm(errors)))
        floor = fading * found.largest**2 + np.finfo(float).tiny
        trial = closures.moved(t, y, -found.damped(errors, floor))
        trial[hold.coordinates] = start[hold.coordinates]
        smaller = np.linalg.norm(closures.errors()) < np.linalg.norm(errors)
        if smaller and closures.linearise_stiff(t, trial) == OK:
            y, errors, damping = trial, closures.errors(), damping / 10.0
        else:
            damping *= 10.0
            closures.linearise_stiff(t, y)
    if not _largest(errors) <= OPEN:
        where = closures.worst(errors)
        raise ClosureError(
            f"{where}: no coordinates close it; this gap remains in the nearest configuration found. Check lengths, "
            "axes and offsets, or give initial coordinates closer to a closed configuration; if the closures "
            "overconstrain the rigid bodies, give more digits or use flexible bodies"
        )
    return y


def _moving(closures: Closures, t: float, y: Real, hold: KeptValues) -> Real:
    """y with speeds that the closures allow."""
    start = y
    closures.linearise_stiff(t, y)
    rates, largest = closures.rates()
    taken = _largest(rates)
    for _ in range(3):
        if largest <= CLOSED:
            break
        found = decomposed(closures, t, y, hold)
        y = closures.pushed(t, y, -found.damped(rates, 0.0))
        y[hold.speeds] = start[hold.speeds]
        rates, largest = closures.rates()
    if not (largest <= MOVING_APART or _largest(rates) <= NEARLY_CLOSED * taken):  # the second where it is at rest
        where = closures.worst(rates, rates=True)
        raise ClosureError(
            f"{where}: no speeds keep it closed; this remains with the nearest ones. The closures do not allow the "
            "prescribed motions: the mechanism is locked. Free a hinge, or use flexible bodies"
        )
    return y


class Group(NamedTuple):
    """Singular value decomposition U s V' of B' of a group in its own columns, and U' times the shared columns."""

    of: GroupResponse
    U: Real
    s: Real
    Vt: Real
    shared: Real


class Decomposed(NamedTuple):
    """The responses of all rows, by cluster and group."""

    speeds: int
    clusters: list[list[Group]]

    @property
    def largest(self) -> float:
        """The largest singular value of all groups."""
        return max((float(group.s[0]) for groups in self.clusters for group in groups if len(group.s)), default=0.0)

    def damped(self, values: Real, floor: float) -> Real:
        """x (nu,) = B (B'B + floor)^-1 values (G,) of the rows; with a floor of zero the least-squares solution.

        Shared columns enter by the Woodbury formula, as in `flexmb.closure.clusters`.
        """
        x = np.zeros(self.speeds)
        for groups in self.clusters:
            kept = [group.s > (0.0 if floor > 0.0 else DEPENDENT * self.largest) for group in groups]
            root = [np.sqrt(group.s[k] ** 2 + floor) for group, k in zip(groups, kept, strict=True)]
            T = [group.shared[k] / r[:, None] for group, k, r in zip(groups, kept, root, strict=True)]
            z = [group.U[:, k].T @ values[group.of.rows] / r for group, k, r in zip(groups, kept, root, strict=True)]
            C = np.eye(T[0].shape[1]) + sum(each.T @ each for each in T)
            y = np.linalg.solve(C, sum(each.T @ part for each, part in zip(T, z, strict=True)))
            for group, k, r, t, part in zip(groups, kept, root, T, z, strict=True):
                f = (part - t @ y) / r
                x[group.of.columns[: group.of.own]] += group.Vt[k].T @ (group.s[k] * f)
                x[group.of.columns[group.of.own :]] += group.shared[k].T @ f
        return x


class Held(NamedTuple):
    """The responses of all rows, projected on changes that leave the held values as they are: B'P = U s V'."""

    U: Real
    s: Real
    Vt: Real

    @property
    def largest(self) -> float:
        """The largest singular value."""
        return float(self.s[0]) if len(self.s) else 0.0

    def damped(self, values: Real, floor: float) -> Real:
        """See `Decomposed.damped`."""
        kept = self.s > (0.0 if floor > 0.0 else DEPENDENT * self.largest)
        s = self.s[kept]
        found: Real = self.Vt[kept].T @ (s / (s * s + floor) * (self.U[:, kept].T @ values))
        return found


def decomposed(closures: Closures, t: float, y: Real, hold: KeptValues) -> Decomposed | Held:
    """The decomposition at the state y that was linearised last."""
    speeds, responses = len(closures.constants[0].speed), closures.responses()
    if not len(hold.fixed):
        return Decomposed(speeds, [[_decomposed(of) for of in groups] for groups in responses])
    half = np.zeros((sum(len(of.half) for groups in responses for of in groups), speeds))
    for of in (each for groups in responses for each in groups):
        half[of.rows, of.columns] = of.half
    Q = np.linalg.qr(closures.moving(t, y)[hold.fixed].T)[0]
    return Held(*np.linalg.svd(half - (half @ Q) @ Q.T, full_matrices=False))


def _decomposed(of: GroupResponse) -> Group:
    U, s, Vt = np.linalg.svd(of.half[:, : of.own], full_matrices=False)
    return Group(of, U, s, Vt, U.T @ of.half[:, of.own :])


def _refuse_half_a_turn(closures: Closures) -> None:
    """ClosureError where axes that should be equal are opposite: the rows vanish there too."""
    for name, turned in closures.half_turned():
        if turned:
            raise ClosureError(
                f'closure "{name}" closes only with its frames half a turn apart: turn quaternion_b, or give initial '
                "coordinates closer to the closed configuration"
            )


def _all_errors(closures: Closures, t: float, y: Real) -> Real:
    closures.linearise(t, y)  # raises where the tree itself has no dynamics
    closures.linearise_stiff(t, y)
    return closures.errors()


def _errors(closures: Closures, t: float, y: Real, _: Real) -> float:
    return _largest(_all_errors(closures, t, y))


def _rates(closures: Closures, t: float, y: Real, before: Real) -> float:
    """How fast closures open, relative to the present speeds or, at rest, to the speeds that were removed."""
    closures.linearise_stiff(t, before)
    taken = _largest(closures.rates()[0])
    closures.linearise_stiff(t, y)
    rates, largest = closures.rates()
    return min(largest, _largest(rates) / taken) if taken > 0.0 else largest


def _largest(errors: Real) -> float:
    return float(np.max(np.abs(errors), initial=0.0))
