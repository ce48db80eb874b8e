"""Assembly: consistent initial conditions from a user's approximate ones, or an error that says why there are none.

Coordinates are corrected by damped Gauss-Newton steps (Levenberg-Marquardt), then the speeds. Modes keep their values
where hinges alone can close the loops. Elsewhere each correction is the smallest in the metric of kinetic energy, to
which modes add their strain energy with so large a factor that they do only what hinges cannot; the result is then
moved along the closed states to the least strain energy of the change. Prescribed coordinates and speeds are not
changed. Rows are weighted with a length of the scene, and compared with the size of their closure.

Values that the user asked for (`flexmb.closure.given_values`) are held if the remaining ones can close the loops. These
are tried in turn: all given values are held; only insisted values are held; nothing is held. Only if all of this fails
with the modes held, it is tried with modes that may change.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from flexmb.closure.closures import ClosureError, Closures
from flexmb.closure.factor import DEPENDENT
from flexmb.closure.given_values import NO_HOLD, NOTHING_ASKED, AskedFor, KeptValues, Wishes
from flexmb.closure.null_loads import GroupResponse
from flexmb.closure.projection import CLOSED, MOVING_APART, OPEN
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real

STEPS = 200
NEARLY_CLOSED = 2.0**-40  # gap that counts as closed if values are held: few free speeds amplify rounding
STRONGEST = 1e12  # damping at which the iteration gives up
FARTHEST = 2.0**20  # growth of a closure at which it counts as open: gaps relative to its size vanish by themselves
RELAXATIONS = 20  # steps to the least strain energy ...
RELAXED = 1e-6  # ... which end when one reduces it by less than this part


def consistent(closures: Closures, t: float, y: Real, asked: AskedFor = NOTHING_ASKED) -> Real:
    """y = [q, u, work] near the given one that fulfils all closures and keeps the requested values exactly.

    If these cannot be kept, the nearest closed state. ClosureError if there is none, or if values that the scene marks
    as given cannot be kept.
    """
    y = closed_positions(closures, t, y, asked)
    return _as_asked(closures, t, y, asked.speeds, asked, _moving, _rate)


def closed_positions(closures: Closures, t: float, y: Real, asked: AskedFor = NOTHING_ASKED) -> Real:
    """The same of the coordinates alone, with the speeds as they are; the independent rows are counted there."""
    start = y.copy()
    closures.linearise(t, start)
    y = _as_asked(closures, t, start, asked.coordinates, asked, _closed, _gap)
    if y is not start:
        closures.linearise(t, y)
    closures.count_rows()
    _refuse_half_a_turn(closures)
    return y


class Opening(NamedTuple):
    """How far closures are from closed, relative to their sizes or to the speeds of their ports; and, of speeds, the
    largest rate of a row, beside which smaller ones are small even where nothing else moves."""

    relative: float
    rate: float = 0.0

    def beside(self, before: Opening) -> float:
        """What is left of the opening before."""
        return min(self.relative, self.rate / before.rate) if before.rate > 0.0 else self.relative


Closing = Callable[[Closures, float, Real, KeptValues], Real]


def _as_asked(
    closures: Closures, t: float, y: Real, wishes: Wishes, asked: AskedFor, closing: Closing,
    opening: Callable[[Closures], Opening],
) -> Real:  # fmt: skip
    """The result of `closing`, which takes the values to hold and may raise ClosureError; y itself if it is closed.

    y is the state linearised last; `opening`: of that state.
    """
    first = opening(closures)
    if first.relative <= CLOSED:
        return y
    for hold, is_wished in _holds(wishes, asked):
        kept = _unless_turned(closures, t, y, hold, closing)
        if kept is None:
            continue
        if is_wished:
            closures.linearise(t, kept)
            if opening(closures).beside(first) > NEARLY_CLOSED:
                continue
        if wishes.insisted and asked.is_marked and not is_wished:
            names = ", ".join(f'"{asked.name(wish)}"' for wish in wishes.insisted)
            raise ClosureError(
                f"marked as given, but closures do not allow these values: {names}. Correct them, or remove the mark "
                "of one, which then follows from the others"
            )
        return kept
    return closing(closures, t, y, NO_HOLD)


def _holds(wishes: Wishes, asked: AskedFor) -> Iterator[tuple[KeptValues, bool]]:
    """What to hold, in the order in which it is tried, and whether values that the user gives are among it: modes are
    released only if hinges alone fail."""
    for modes in (True, False) if any(q for q, _ in asked.modes) else (False,):
        for wish in dict.fromkeys((wishes.given, wishes.insisted, ())):
            yield asked.hold(wish, modes=modes), bool(wish)


def _unless_turned(closures: Closures, t: float, y: Real, hold: KeptValues, closing: Closing) -> Real | None:
    """The result of `closing`, None where there is none or closed axes are opposite."""
    try:
        closed = closing(closures, t, y, hold)
    except ClosureError:
        return None
    return None if closures.half_turned() else closed


def _closed(closures: Closures, t: float, y: Real, hold: KeptValues) -> Real:
    """y with coordinates that close the closures, with the least strain energy of the change that this takes."""
    start, y = y, _gap_closed(closures, t, y, hold)
    energy = _strain(closures, y - start)
    for _ in range(RELAXATIONS if energy > 0.0 else 0):
        closed = decomposed(closures, t, y, hold)
        assert isinstance(closed, Weighed)  # there are strains
        further = _moved(closures, t, y, -closed.relaxing(closures.errors(), y - start), hold)
        try:
            further = _gap_closed(closures, t, further, hold)
        except (ClosureError, DynamicsError):
            break
        before, energy = energy, _strain(closures, further - start)
        if not energy < before:
            break
        y = further
        if energy >= (1.0 - RELAXED) * before:
            break
    closures.linearise(t, y)
    return y


def _gap_closed(closures: Closures, t: float, y: Real, hold: KeptValues) -> Real:
    closures.linearise(t, y)  # raises where the tree itself has no dynamics
    sizes, damping = closures.sizes, 1e-3
    errors = closures.errors(sizes)  # not of the present sizes: they would seem to vanish as a hinge slides away
    for _ in range(STEPS):
        if _largest(closures.errors()) <= CLOSED or damping > STRONGEST:
            break
        closed = decomposed(closures, t, y, hold, sizes)
        # The damping decreases with the errors, so that convergence is quadratic, also where rows become dependent.
        fading = damping * min(1.0, float(np.linalg.norm(errors)))
        floor = fading * closed.largest**2 + np.finfo(float).tiny
        trial = _moved(closures, t, y, -closed.damped(errors, floor), hold)
        smaller = np.linalg.norm(closures.errors(sizes)) < np.linalg.norm(errors)
        if smaller and _has_dynamics(closures, t, trial):
            y, errors, damping = trial, closures.errors(sizes), damping / 10.0
        else:
            damping *= 10.0
            closures.linearise(t, y)
    if not (_largest(closures.errors()) <= OPEN and np.all(closures.sizes <= FARTHEST * sizes)):
        where = closures.worst(errors)
        raise ClosureError(
            f"{where}: no coordinates close it; this gap remains in the nearest configuration found. Check lengths, "
            "axes and offsets, or give initial coordinates closer to a closed configuration; if the closures "
            "overconstrain the rigid bodies, give more digits or use flexible bodies"
        )
    return y


def _moved(closures: Closures, t: float, y: Real, x: Real, hold: KeptValues) -> Real:
    """As `Closures.moved`, with the held coordinates as they were."""
    trial = closures.moved(t, y, x)
    trial[hold.coordinates] = y[hold.coordinates]
    return trial


def _has_dynamics(closures: Closures, t: float, y: Real) -> bool:
    """Whether the tree has dynamics at y, which is then linearised there."""
    try:
        closures.linearise(t, y)
    except DynamicsError:
        return False
    return True


def _strain(closures: Closures, change: Real) -> float:
    """Of a change of [q, u, work]: the strain energy, up to a factor."""
    return float(sum(eta @ strain.weight @ eta for strain in closures.strains for eta in [change[strain.coordinates]]))


def _moving(closures: Closures, t: float, y: Real, hold: KeptValues) -> Real:
    """y with speeds that the closures allow."""
    start = y
    closures.linearise(t, y)
    rates, largest = closures.rates()
    taken = _largest(rates)
    for _ in range(3):
        if largest <= CLOSED:
            break
        closed = decomposed(closures, t, y, hold)
        y = closures.pushed(t, y, -closed.damped(rates, 0.0))
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
            C = np.eye(T[0].shape[1]) + sum(block.T @ block for block in T)
            y = np.linalg.solve(C, sum(block.T @ part for block, part in zip(T, z, strict=True)))
            for group, k, r, t, part in zip(groups, kept, root, T, z, strict=True):
                f = (part - t @ y) / r
                x[group.of.columns[: group.of.own]] += group.Vt[k].T @ (group.s[k] * f)
                x[group.of.columns[group.of.own :]] += group.shared[k].T @ f
        return x


class Weighed(NamedTuple):
    """The responses of all rows to changes Z z that leave the held values as they are, whose square z'z is the kinetic
    energy plus the weighted strain energy: B'Z = U s V'. Z (nu,z); strain (z,nq+nu+1): derivative of the latter;
    least: singular values up to these are rounding, as that of rows which only held values move."""

    U: Real
    s: Real
    Vt: Real
    Z: Real
    strain: Real
    least: Real

    @property
    def largest(self) -> float:
        """The largest singular value."""
        return float(self.s[0]) if len(self.s) else 0.0

    def damped(self, values: Real, floor: float) -> Real:
        """See `Decomposed.damped`."""
        return np.asarray(self.Z @ self._damped(values, floor))

    def relaxing(self, values: Real, change: Real) -> Real:
        """x (nu,) that closes values (G,) and reduces most the weighted strain energy of a change of [q, u, work]."""
        downhill = self.strain @ change
        kept = self.s > self.least
        stopped = self.U[:, kept] @ (self.s[kept] * (self.Vt[kept] @ downhill))
        return np.asarray(self.Z @ (downhill + self._damped(values - stopped, 0.0)))

    def _damped(self, values: Real, floor: float) -> Real:
        kept = self.s > (0.0 if floor > 0.0 else self.least)
        s = self.s[kept]
        step: Real = self.Vt[kept].T @ (s / (s * s + floor) * (self.U[:, kept].T @ values))
        return step


def decomposed(
    closures: Closures, t: float, y: Real, hold: KeptValues, largest: Real | float = np.inf
) -> Decomposed | Weighed:
    """The decomposition at the state y that was linearised last; `largest` as for `Closures.responses`."""
    speeds, responses = len(closures.constants[0].speed), closures.responses(largest)
    if not len(hold.fixed) and not closures.strains:
        return Decomposed(speeds, [[_decomposed(of) for of in groups] for groups in responses])
    half = np.zeros((sum(len(of.half) for groups in responses for of in groups), speeds))
    for of in (group for groups in responses for group in groups):
        half[of.rows, of.columns] = of.half
    moving = closures.moving(t, y)
    Z = np.linalg.qr(moving[hold.fixed].T, mode="complete")[0][:, len(hold.fixed) :]
    inertia, strain = np.eye(Z.shape[1]), np.zeros((Z.shape[1], len(y)))
    for each in closures.strains:
        modes = moving[each.speeds] @ Z
        strain[:, each.coordinates] = modes.T @ each.weight
        inertia += strain[:, each.coordinates] @ modes
    root = np.linalg.cholesky(inertia)
    Z, strain = np.linalg.solve(root, Z.T).T, np.linalg.solve(root, strain)
    U, s, Vt = np.linalg.svd(half @ Z, full_matrices=False)
    reference = np.linalg.norm(half, 2) if half.size else 0.0  # of all changes, also of those that are held
    least = DEPENDENT * np.maximum(np.max(s, initial=0.0), reference * np.linalg.norm(Z @ Vt.T, axis=0))
    return Weighed(U, s, Vt, Z, strain, least)


def _decomposed(of: GroupResponse) -> Group:
    U, s, Vt = np.linalg.svd(of.half[:, : of.own], full_matrices=False)
    return Group(of, U, s, Vt, U.T @ of.half[:, of.own :])


def _refuse_half_a_turn(closures: Closures) -> None:
    """ClosureError where axes that should be equal are opposite: the rows vanish there too."""
    turned = closures.half_turned()
    if turned:
        raise ClosureError(
            f'closure "{turned[0]}" closes only with its frames half a turn apart: turn quaternion_b, or give initial '
            "coordinates closer to the closed configuration"
        )


def _gap(closures: Closures) -> Opening:
    return Opening(_largest(closures.errors()))


def _rate(closures: Closures) -> Opening:
    rates, largest = closures.rates()
    return Opening(largest, _largest(rates))


def _largest(errors: Real) -> float:
    return float(np.abs(errors).max(initial=0.0))
