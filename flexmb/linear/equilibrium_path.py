"""Paths of equilibria under a number of the scene, followed by arc length through limit points.

The unknowns are displacements and the number p. From an equilibrium a step along the tangent of the path is corrected
by Newton's method in the plane across that tangent (Riks 1979; Crisfield 1991, sec. 9.3):

    K xi - dr/dp dp = r,    tangent . (xi, dp) = 0

with the loads r and the tangent stiffness K of `flexmb.linear.newton`. dr/dp is a difference of two scenes: it aims
steps, while what is found is exact. Lengths are measured in the metric of kinetic energy, in units of what the whole
range of values would displace if the structure stayed as flexible as it is at the first, and p by that range: both
count alike then, and a limit point is no sharp corner of the path, however small the displacements are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.optimize import brentq

from flexmb.linear.equations import built, equations_of
from flexmb.linear.equilibrium import Equilibrium, as_equilibrium, found_equilibrium
from flexmb.linear.linear_model import Complex
from flexmb.linear.newton import EquilibriumError, squares, verdict
from flexmb.linear.variations import Equations, RestForces
from flexmb.parameters.numbers import Number
from flexmb.scene.open_loop import refuse_feedback
from flexmb.scene.schema import Scene
from flexmb.scene.sticking import refuse_sticking
from flexmb.scene.values import with_values
from flexmb.system.watches import of_states, warn
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.tables.state import DynamicsError, State
from flexmb.typing import Real

FIRST, SHORTEST = 0.02, 1e-7  # steps, in these units and ranges
LONGEST = 0.5  # the same, parts of the range, and of a displacement of all free coordinates by 1
LEAST_UNIT = 1e-6  # of displacements, parts of a displacement of all free coordinates by 1, which is the largest
CORRECTIONS = 12  # Newton steps; after more the step is halved
EASY = 4  # after fewer the next one is longer
CONVERGED = 1e-11  # the next correction, parts of a displacement of all free coordinates by 1
STRAIGHT = 0.9  # least cosine between the tangents at both ends of a step
MOST = 2000  # steps
FARTHEST = 10.0  # ranges beyond the values, where the path is given up
NEAR, FAR = 2.0**-18, 2.0**-6  # differences of p, parts of its range
LOCATED = 1e-6  # where in a step something happens, part of the step


@dataclass(frozen=True, eq=False)
class CriticalPoint:
    """Where a path of equilibria turns or others cross it.

    kind: "limit" where the number has a greatest or least value, "bifurcation" where the stiffness is singular while
    the number passes on; value of the number; the state there.
    """

    kind: Literal["limit", "bifurcation"]
    value: float
    state: Equilibrium

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class EquilibriumPath:
    """Equilibria along a path, in order: the values (n,) of the number, and the states, each with its stability."""

    number: str
    values: Real
    states: tuple[Equilibrium, ...]
    critical: tuple[CriticalPoint, ...]

    __repr__ = brief

    def at(self, value: float) -> tuple[Equilibrium, ...]:
        """All equilibria of the path at one of the values that were asked for, in order; ValueError for others."""
        value = arguments.number("value", value)
        found = tuple(
            state for value_of_state, state in zip(self.values, self.states, strict=True) if value_of_state == value
        )
        if not found:
            raise ValueError(f"{value:g} is not one of the values that the path was asked for, or it ends before")
        return found


def equilibrium_path(scene: Scene, number: str, values: Sequence[float] | Real) -> EquilibriumPath:
    """The equilibria of a scene as one of its numbers, named as in `Scene.with_values`, goes from the first of `values`
    to the last.

    It begins at the equilibrium that `equilibrium` finds at the first value, and passes every other value, some more
    than once where it turns back in between; it ends at the last. Limit and bifurcation points on the way are located.
    At a bifurcation it goes straight on. EquilibriumError where there is no equilibrium at the first value or the path
    does not reach the last; PathError for a number that the scene does not have; ValueError unless `values` are two or
    more, all rising or all falling; NotImplementedError as for `equilibrium`, and for scenes with controllers.
    Warns as `equilibrium` does.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"a Scene is needed, not {type(scene).__name__}: the path changes a number of it")
    refuse_feedback(scene, "a path of equilibria")
    refuse_sticking(scene, "a path of equilibria needs one equilibrium for each value")
    asked = arguments.finite("values", arguments.array("values", values))
    steps = np.diff(asked) if asked.ndim == 1 else np.zeros(0)
    if not len(steps) or not (np.all(steps > 0.0) or np.all(steps < 0.0)):
        raise ValueError("values: give two or more numbers in a row that all rise or all fall")
    family = _Family(scene, number, asked)
    points = list(_followed(family, asked))
    states = tuple(as_equilibrium(point.at.state, verdict(point.squares)) for _, point in points)
    warn(of_states(family.system, states))
    critical = [(kind, point, state) for (kind, point), state in zip(points, states, strict=True) if kind is not None]
    found = tuple(CriticalPoint(kind, point.p, state) for kind, point, state in critical)
    passed = np.array([point.p for _, point in points])
    passed.flags.writeable = False
    return EquilibriumPath(number, passed, states, found)


class _Corrected(NamedTuple):
    """What Newton's method found: p, the forces there, and the number of corrections."""

    p: float
    at: RestForces
    taken: int


class _Point(NamedTuple):
    """An equilibrium at p: its forces, dr/dp (f,), the tangent (n+1,) of the path over all free speeds and p, of
    length 1, and omega^2."""

    p: float
    at: RestForces
    by_number: Real
    tangent: Real
    squares: Complex

    @property
    def negative(self) -> int:
        """Number of negative omega^2: those that are real, as complex ones pass zero by no load."""
        return int(np.sum((self.squares.real < 0.0) & (self.squares.imag == 0.0)))

    @property
    def nearest(self) -> float:
        """How far the nearest real omega^2 is from zero."""
        return float(np.min(np.abs(self.squares[self.squares.imag == 0.0]), initial=np.inf))


class _Family:
    """The scenes with all values of one number; the system at the first one; range of the values.

    unit: of displacements; see the top of this module.
    """

    def __init__(self, scene: Scene, number: str, asked: Real) -> None:
        Number(scene, number)  # PathError unless it is one real number
        first: Scene = with_values(scene, {number: float(asked[0])})
        self.system = built(first)
        self.number = Number(self.system.scene, number)  # of which bodies in files have been read
        self.name, self.range, self._middle = scene.name, float(np.ptp(asked)), float(np.mean(asked[[0, -1]]))
        self.unit = 1.0
        self._here = self._beside = self._made(self.number.value, None)

    def start(self, onwards: float) -> _Point:
        """The equilibrium at the first value, with the tangent of the path that leaves it in the direction `onwards`;
        determines the unit of displacements."""
        p, equations = self._here
        at = equations.forces(found_equilibrium(self.system, None)[0])
        ahead = np.zeros(len(at.basis) + 1)
        ahead[-1] = onwards * self.range
        corrected = _Corrected(p, at, 0)
        tangent = self.point(corrected, ahead).tangent
        displaced = self.length(at, np.r_[tangent[:-1], 0.0]) * self.range / abs(float(tangent[-1]))
        self.unit = float(np.clip(displaced, LEAST_UNIT, 1.0))
        return self.point(corrected, ahead)

    def _made(self, p: float, like: Equations | None) -> tuple[float, Equations]:
        """At rest, with functions of time at their values at t = 0."""
        return p, equations_of(self.system.with_numbers(self.number.scene_at(p)), like).held(0.0)

    def equations(self, p: float) -> Equations:
        """Those at a value."""
        if p != self._here[0]:
            self._here = self._made(p, self._here[1])
        return self._here[1]

    def by_number(self, p: float, at: RestForces) -> Real:
        """dr/dp (f,) at a state."""
        if not NEAR * self.range <= abs(self._beside[0] - p) <= FAR * self.range:
            aside = float(np.copysign(0.5 * FAR * self.range, self._middle - p))
            self._beside = self._made(p + aside, self._here[1])
        other, beside = self._beside
        return (beside.loads(at.state, at) - self.equations(p).loads(at.state, at)) / (other - p)

    def bordered(self, at: RestForces, by_number: Real, row: Real) -> Callable[[Real, float], Real]:
        """Solver of K xi - dr/dp dp = load, row . (xi, dp) = rest, for (xi, dp) over all free speeds (n+1,)."""
        moving = at.movable
        K = np.zeros((len(moving) + 1, len(moving) + 1))
        K[:-1, :-1], K[:-1, -1] = at.stiffness[np.ix_(moving, moving)], -by_number[moving]
        across = self.weighed(at, row)
        K[-1, :-1], K[-1, -1] = (across[:-1] @ at.basis)[moving], across[-1]

        def solve(load: Real, rest: float) -> Real:
            found, xi = np.linalg.solve(K, np.r_[load[moving], rest]), np.zeros(len(load))
            xi[moving] = found[:-1]
            return np.r_[at.basis @ xi, found[-1]]

        return solve

    def weighed(self, at: RestForces, x: Real) -> Real:
        """Of (xi, dp) (n+1,), the row by which lengths are measured: x . weighed(x) is the square of one."""
        independent = x[:-1][at.chosen]
        back = np.zeros(len(x) - 1)
        back[at.chosen] = at.mass @ independent / np.trace(at.mass) / self.unit**2
        return np.r_[back, x[-1] / self.range / self.range]

    def length(self, at: RestForces, x: Real) -> float:
        return float(np.sqrt(self.weighed(at, x) @ x))

    def longest(self, point: _Point) -> float:
        """The longest step from a point."""
        xi = np.r_[point.tangent[:-1], 0.0]
        return LONGEST / max(self.unit * self.length(point.at, xi), abs(float(point.tangent[-1])) / self.range)

    def point(self, found: _Corrected, before: Real) -> _Point:
        """An equilibrium with its tangent, which goes on as the one before it (n+1,)."""
        p, at, _ = found
        by_number = self.by_number(p, at)
        solve = self.bordered(at, by_number, before)
        tangent = solve(np.zeros(len(at.load)), 1.0)
        return _Point(p, at, by_number, tangent / self.length(at, tangent), squares(at))

    def corrected(self, p: float, state: State, by_number: Real, row: Real, farthest: float) -> _Corrected | None:
        """The equilibrium near a state at p, across `row` (n+1,), no correction longer than `farthest`; None if not
        found."""
        for taken in range(CORRECTIONS):
            equations = self.equations(p)
            at = equations.forces(state)
            step = self.bordered(at, by_number, row)(at.load, 0.0)
            length = self.length(at, step)
            if not np.isfinite(step).all() or length > farthest:
                return None
            if self.unit * length <= CONVERGED:
                return _Corrected(p, at, taken)
            p, state = p + float(step[-1]), equations.moved(at, step[:-1][at.chosen])
        return None

    def stepped(self, point: _Point, h: float) -> tuple[_Point, int] | None:
        """The point at a distance h, and the number of corrections; None if Newton's method does not find it."""
        try:
            equations, ahead = self.equations(point.p), h * point.tangent
            state = equations.moved(point.at, ahead[:-1][point.at.chosen])
            corrected = self.corrected(point.p + float(ahead[-1]), state, point.by_number, point.tangent, h)
            if corrected is None:
                return None
            there = self.point(corrected, point.tangent)
        except (DynamicsError, np.linalg.LinAlgError):
            return None
        turned = float(self.weighed(there.at, there.tangent) @ point.tangent)
        return (there, corrected.taken) if turned >= STRAIGHT or h <= 16.0 * SHORTEST else None

    def exactly(self, point: _Point, value: float) -> _Point | None:
        """The equilibrium at a value near that of a point."""
        try:
            across = np.zeros(len(point.tangent))
            across[-1] = self.range
            corrected = self.corrected(value, point.at.state, point.by_number, across, LONGEST / self.unit)
            return None if corrected is None else self.point(corrected, point.tangent)
        except (DynamicsError, np.linalg.LinAlgError):
            return None


Kind = Literal["limit", "bifurcation"]


def _followed(family: _Family, asked: Real) -> Iterator[tuple[Kind | None, _Point]]:
    """The points of the path, and what those are that are critical."""
    try:
        here, h = family.start(float(np.sign(asked[1] - asked[0]))), FIRST
    except (DynamicsError, np.linalg.LinAlgError):
        raise EquilibriumError(
            f'scene "{family.name}": no path of equilibria leaves {asked[0]:g}, because something there may move '
            "without resistance: give it a spring, prescribe it, or begin at another value"
        ) from None
    yield None, here
    for _ in range(MOST):
        there = family.stepped(here, h)
        if there is None:
            h *= 0.5
            if h < SHORTEST:
                raise EquilibriumError(_lost(family, here, "no equilibrium follows"))
            continue
        for kind, point in _between(family, here, there[0], h, asked):
            yield kind, point
            if kind is None and point.p == asked[-1]:
                return
        yield None, there[0]
        here = there[0]
        h = min(family.longest(here), 1.5 * h if there[1] <= EASY else h)
        if np.min(np.abs(here.p - asked)) > FARTHEST * family.range:
            raise EquilibriumError(_lost(family, here, "the path turned away for good"))
    raise EquilibriumError(_lost(family, here, f"{MOST} steps were too few"))


def _between(family: _Family, here: _Point, there: _Point, h: float, asked: Real) -> list[tuple[Kind | None, _Point]]:
    """What lies on a step of length h, in order: critical points, and values that were asked for."""
    crossings: list[tuple[float, Kind | None, _Point]] = []
    turns = here.tangent[-1] * there.tangent[-1] < 0.0
    changes = abs(there.negative - here.negative)
    tests: list[tuple[Kind, Callable[[_Point], float], bool]] = [
        ("limit", lambda point: float(point.tangent[-1]), turns),
        ("bifurcation", lambda point: point.nearest * (1 if point.negative == here.negative else -1), changes > turns),
    ]
    for kind, test, happens in tests:
        place = _located(family, here, h, there, test) if happens else None
        if place is not None:
            crossings.append((place[0], kind, place[1]))
    ends = sorted([(0.0, here), *((s, point) for s, _, point in crossings), (h, there)], key=lambda item: item[0])
    for (s0, a), (s1, b) in zip(ends[:-1], ends[1:], strict=True):
        for value in asked:
            if (a.p < value <= b.p) or (b.p <= value < a.p):
                s = s0 + (s1 - s0) * (float(value) - a.p) / (b.p - a.p)
                near = family.stepped(here, s) if s > 0.0 else None
                exact = family.exactly(b if near is None else near[0], float(value))
                if exact is None:
                    raise EquilibriumError(_lost(family, here, f"no equilibrium at {value:g} was found on it"))
                crossings.append((s, None, exact))
    return [(kind, point) for _, kind, point in sorted(crossings, key=lambda item: item[0])]


def _located(
    family: _Family, here: _Point, h: float, there: _Point, test: Callable[[_Point], float]
) -> tuple[float, _Point] | None:
    """Where on a step of length h a test changes sign, and the point there."""
    known = {0.0: here, h: there}

    def value(s: float) -> float:
        if s not in known:
            stepped = family.stepped(here, s)
            if stepped is None:
                raise EquilibriumError(_lost(family, here, "no equilibrium follows"))
            known[s] = stepped[0]
        return test(known[s])

    if value(0.0) * value(h) >= 0.0:
        return None
    s = float(brentq(value, 0.0, h, xtol=LOCATED * h))
    return s, known[s]


def _lost(family: _Family, here: _Point, why: str) -> str:
    return (
        f'scene "{family.name}": the path of equilibria under {family.number.name} ends at {here.p:.6g}, '
        f"{verdict(here.squares)}: {why}. Ask for values up to there, begin elsewhere, or free what is in the way"
    )
