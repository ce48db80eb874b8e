"""The closures and couplings of one scene as a Python object: accelerations and loads of the closed chain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexmb.closure import dynamics
from flexmb.closure.branch import GAPS, UNRECORDED
from flexmb.closure.constants import suppressed
from flexmb.closure.factor import DEPENDENT
from flexmb.closure.null_loads import GroupResponse, blocks, null_loads
from flexmb.closure.tables import ROTATION, Closed, ClosureConstants, ClosureWorkspace, Recursion, workspace
from flexmb.jain.places import Matrices, matrices
from flexmb.jain.response import Response, response
from flexmb.kept import kept
from flexmb.levels.body import LEVELS
from flexmb.scene.schema import Closure, Coupling
from flexmb.tables.arrays import Constants, Workspace
from flexmb.tables.state import Layout
from flexmb.tables.status import CLOSURE_SINGULAR
from flexmb.typing import Flags, Index, Real

STIFF = 100.0  # in assembly, modes weigh M + K (STIFF/omega)^2 with the lowest modal frequency omega
BESIDE = 2.0**-11  # distance from a singular position, in sizes of the mechanism, at which loads are evaluated
SAME = 1e-7  # relative difference below which loads count as equal


class ClosureError(ValueError):
    """Closures cannot be closed or allow no motion; the message names the closure, the gap and the remedy."""


def called(item: Closure | Coupling) -> str:
    """What messages call a closure or coupling."""
    return f'{"coupling" if isinstance(item, Coupling) else "closure"} "{item.name}"'


class Strain(NamedTuple):
    """Modes of one body: their places in q and in u, and the weight (m,m) of a change of theirs."""

    coordinates: slice
    speeds: slice
    weight: Real


class Spread(NamedTuple):
    """Change of the loads by each of k null loads of the rows (loads that cause no acceleration): drives (k,nu),
    hinges (k,N,6), closures (k,C,6), World axes. A change of `rounding` or less counts as zero."""

    drives: Real
    hinges: Real
    closures: Real
    rounding: float

    @property
    def open_parts(self) -> dict[str, NDArray[np.bool_]]:
        """The components that are not determined, by the names of these parts in a row of observed quantities."""
        changes = {"drives": self.drives, "loads": self.hinges, "closures": self.closures}
        return {name: self.leaves_open(change) for name, change in changes.items()}

    def leaves_open(self, changes: Real) -> NDArray[np.bool_]:
        """Which components are not determined by the motion, from their changes (k,...)."""
        is_open: NDArray[np.bool_] = np.any(np.abs(changes) > self.rounding, axis=0)
        return is_open


class ClosedMotion(NamedTuple):
    """Accelerations (nu,), drive loads (nu,), loads (N,6) of hinges and (C,6) of closures, World axes.

    The loads are those of the minimum-norm row loads. `spread` is None where the loads are unique.
    """

    accelerations: Real
    drives: Real
    hinges: Real
    closures: Real
    spread: Spread | None = None


@dataclass(frozen=True, eq=False)
class _Counted:
    """Number of independent rows of each group in a closed configuration, -1 before it is known, and the size of all
    rows' ports there. Immutable: a new count replaces the whole object, so that threads read a consistent one."""

    ranks: Index
    size: Real

    @kept
    def rank(self) -> int:
        """Of all groups; -1 before it is known."""
        return int(np.sum(self.ranks)) if np.all(self.ranks >= 0) else -1


class Closures:
    """The closures of one scene and their tree.

    Methods keep results in workspaces for later calls. Each thread needs an object of its own: see `for_thread`.
    """

    def __init__(
        self,
        closures: Sequence[Closure | Coupling],
        constants: tuple[Constants, ClosureConstants],
        layout: Layout,
        tree: Callable[[], Workspace],
        slowest: float,
        check: Callable[[int, int], None],
        like: Closures | None = None,
    ) -> None:
        """`tree` makes workspaces of the tree; `slowest`: lowest modal frequency (rad/s), infinite without modes.

        `check` raises unless a status is OK; its second argument is the body or closure at fault. `like`: closures with
        other numbers, in tables of the same structure, whose workspaces and count of rows serve these too.
        """
        self.scene, self._tree, self._slowest, self._check = closures, tree, slowest, check
        self._layout = layout
        self.constants = constants
        if like is None:
            own = constants[1]
            self._counted = [_Counted(np.full(len(own.group), -1), np.zeros(len(own.row)))]
            self._chain = self._evaluated = self.chain("articulated")
        else:
            self._counted = like._counted
            self._chain = self._evaluated = self.chain_in(like._chain)
        self._composite: Closed | None = None
        self.is_singular = False
        """Whether the last motion failed at a singular position, where fewer rows are independent than elsewhere."""

    def check(self, status: int, fault: int) -> None:
        """DynamicsError unless a status is OK; `fault`: the body or closure at fault."""
        self._check(status, fault)

    def on_tree(self, constants: Constants, tree: Callable[[], Workspace], like: Closures | None = None) -> Closures:
        """The same closures and tree with other functions of time, and with workspaces of their own, or of `like`."""
        both = constants, self.constants[1]
        return Closures(self.scene, both, self._layout, tree, self._slowest, self._check, like)

    def for_thread(self, like: Closures | None = None) -> Closures:
        """The same closures with workspaces of their own, or of `like`; the count of independent rows is shared."""
        closures = self.on_tree(self.constants[0], self._tree, like)
        closures._counted = self._counted
        return closures

    @property
    def row_loads(self) -> Real:
        """(G,) loads of the rows in the last evaluated motion."""
        return self._evaluated.cw.row["load"].copy()

    @property
    def coordinates(self) -> int:
        """Number of coordinates of the tree."""
        return len(self._chain.w.q)

    @staticmethod
    def chosen_in(s: Closed) -> Index:
        """Numbers of the independent rows that carry the loads at the motion evaluated last in a chain."""
        pairs = zip(s.cc.group["row_start"].tolist(), s.cw.rank.tolist(), strict=True)
        return np.concatenate([s.cw.chosen[at : at + rank] for at, rank in pairs])

    def expect_rows(self, s: Closed) -> None:
        """Have the next motion in a chain choose as many rows as are counted, or count them where they are not."""
        s.cw.rank[:] = self._counted[0].ranks

    def chain(self, algorithm: str, rate: float = 0.0) -> Closed:
        """The chain for an algorithm, with workspaces of its own; with a `rate` (1/s) closures are stabilised."""
        c, cc = self.constants
        w, route = self._tree(), self._route(algorithm)
        own = workspace(cc, c, len(w.q))
        counted = self._counted[0]
        own.rank[:], own.size[:], own.gain[:] = counted.ranks, counted.size, (2.0 * rate, rate * rate)
        own.notices[0] = GAPS if rate > 0.0 else UNRECORDED
        return Closed(c, w, cc, own, w if isinstance(route, Recursion) else self._tree(), route)

    def chain_in(self, other: Closed) -> Closed:
        """The chain in the workspaces of another one, of closures with other numbers, that is used no more."""
        c, cc = self.constants
        return replace(other, c=c, cc=cc)

    def _route(self, algorithm: str) -> Recursion | Response | Matrices:
        c = self.constants[0]
        if algorithm == "composite":
            return matrices(c)
        return response(c) if self.at_rest else Recursion()

    @kept
    def at_rest(self) -> list[int]:
        """Bodies whose inertia is that of the undeformed shape, while closures act on the deformed one."""
        body = self.constants[0].body
        return [k for k in np.flatnonzero(body["modes"]).tolist() if LEVELS[body["level"][k]].at_rest]

    @property
    def _own(self) -> ClosureWorkspace:
        return self._chain.cw

    @property
    def doubt(self) -> Index:
        """(1,) whether a pivot of the tree was at rounding level in the last motion."""
        return self._evaluated.w.doubt

    @property
    def fault(self) -> int:
        """Body or closure at which the last evaluation failed."""
        return int(self._chain.fault[0])

    def motion(self, t: float, y: Real) -> ClosedMotion:
        """Accelerations and loads at y = [q, u, work], which must fulfil the closures.

        ValueError or TypeError if y does not fit the system, DynamicsError where the closures are singular.
        """
        return self._motion(t, y, self._chain)

    def composite_motion(self, t: float, y: Real) -> ClosedMotion:
        """As `motion`, by composite bodies."""
        if self._composite is None:
            self._composite = self.chain("composite")
        return self._motion(t, y, self._composite)

    def beside(self, t: float, y: Real, rates: Real, side: int) -> tuple[float, Real]:
        """Time and closed state just before (side -1) or after (1) a singular state with rates dq/dt (nq,)."""
        moving = self._evaluated.cw.closure
        moving = moving[moving["speed"] > 0.0]
        step = side * BESIDE * float(np.min(moving["size"] / moving["speed"], initial=1.0))
        there = y.copy()
        there[: len(rates)] += step * rates
        dynamics.project(t + step, there, self.chain("articulated"))
        return t + step, there

    def _motion(self, t: float, y: Real, s: Closed) -> ClosedMotion:
        self.expect_rows(s)
        self._evaluated = s
        self._check(dynamics.linearise(*self._layout.whole(t, y), s), int(s.fault[0]))
        status = dynamics.closure_loads(s.w, s.cc, s.cw)
        self.is_singular = status == CLOSURE_SINGULAR
        self._check(status, int(s.fault[0]))
        least, null = s.cw.row["load"].copy(), self._null_loads(s)
        least -= null @ (null.T @ least)  # without their component along null loads they have minimum norm
        if not null.shape[1]:
            return self._under(s, least)
        size = max(1.0, float(np.max(np.abs(least))))
        others = [self._under_anew(t, y, s, least + size * direction) for direction in null.T]
        motion = self._under_anew(t, y, s, least)
        return motion._replace(
            spread=Spread(
                np.array([other.drives - motion.drives for other in others]),
                np.array([other.hinges - motion.hinges for other in others]),
                np.array([other.closures - motion.closures for other in others]),
                SAME * size,
            )
        )

    def _under_anew(self, t: float, y: Real, s: Closed, loads: Real) -> ClosedMotion:
        """As `_under`, after another state has been linearised."""
        self._check(dynamics.linearise(*self._layout.whole(t, y), s), int(s.fault[0]))
        return self._under(s, loads)

    def _under(self, s: Closed, loads: Real) -> ClosedMotion:
        """The motion under row loads (G,) at the state linearised last."""
        hinges, closures = np.zeros((len(s.c.body), 6)), np.zeros((len(s.cc.closure), 6))
        s.cw.row["load"] = loads
        dynamics.loads(s, hinges, closures)
        drives = np.where(s.c.speed["prescribed"] >= 0, s.w.speed["drive"], 0.0)
        return ClosedMotion(s.w.speed["acceleration"].copy(), drives, hinges, closures)

    @staticmethod
    def begin_in(s: Closed, t: float, y: Real) -> None:
        """Have a chain choose its independent rows at y = [q, u, work], which fulfils the closures, as where a run
        begins. If they are singular there, the next right-hand side of the chain says so."""
        s.cw.time[0] = -np.inf  # nothing went before
        dynamics.project(t, y.copy(), s)

    # Newton steps for initial conditions

    def linearise(self, t: float, y: Real) -> None:
        """Evaluate values and rates of the rows and their responses to unit loads at y."""
        self._check(dynamics.linearise(t, y, self._chain), self.fault)

    @kept
    def strains(self) -> tuple[Strain, ...]:
        """The strain energy of every body with modes, as the inertia by which `flexmb.closure.assembly` keeps them."""
        body, stiffness = self.constants[0].body, self.constants[0].stiffness
        scale = (STIFF / self._slowest) ** 2
        return tuple(
            Strain(slice(q, q + m), slice(u, u + m), scale * stiffness[k, :m, :m])
            for k, (q, u, m) in enumerate(body[["eta_index", "etad_index", "modes"]].tolist()) if m and scale > 0.0
        )  # fmt: skip

    @property
    def sizes(self) -> Real:
        """(C,) of the closures (m) at the state evaluated last."""
        return self._own.closure["size"].copy()

    def responses(self, largest: Real | float = np.inf) -> list[list[GroupResponse]]:
        """By cluster and group, B' of the rows relative to the size of their closures; zero for ineffective rows.

        `largest` (C,): sizes beyond these count as these.
        """
        cc, own = self.constants[1], self._own
        scale = self._scale("size", largest)
        responses = []
        for group in blocks(cc, own):
            left = np.linalg.norm(group.half[:, : group.own], axis=1)
            felt = cc.weight[group.rows] * left > DEPENDENT * own.size[group.rows]
            responses.append(group._replace(half=(scale[group.rows] * felt)[:, None] * group.half))
        return [responses[cluster["group_start"] : cluster["group_stop"]] for cluster in cc.cluster]

    def errors(self, largest: Real | float = np.inf) -> Real:
        """Values of the rows (G,) relative to the size of their closures; `largest` as for `responses`."""
        return self._scale("size", largest) * self._own.row["value"]

    def rates(self) -> tuple[Real, float]:
        """Rates of the rows (G,), scaled as in `responses`, and the largest one relative to the speed of its ports."""
        rate = self._own.row["rate"]
        return self._scale("size") * rate, float(np.abs(self._scale("speed") * rate).max(initial=0.0))

    def _scale(self, key: str, largest: Real | float = np.inf) -> Real:
        c = self.constants[1]
        sizes = self._own.closure[key]
        size = (sizes if largest is np.inf else np.minimum(sizes, largest)).take(self._closure_of_row)
        size[~(size > 0.0)] = 1.0
        return c.weight / size

    @kept
    def _closure_of_row(self) -> Index:
        return np.array(self.constants[1].row["closure"])

    def moved(self, t: float, y: Real, x: Real) -> Real:
        """y displaced by the motion M^-1 J' of x; the row values are evaluated at the result."""
        y = y.copy()
        dynamics.move(t, y, x, dynamics.COORDINATES, self._chain)
        return y

    def pushed(self, t: float, y: Real, x: Real) -> Real:
        """y with its speeds changed likewise; the row rates are evaluated at the result."""
        y = y.copy()
        dynamics.move(t, y, x, dynamics.SPEEDS, self._chain)
        return y

    def moving(self, t: float, y: Real) -> Real:
        """(nu,nu) change of the speeds by every component of x in `pushed`, at the state y linearised last."""
        c = self.constants[0]
        still, found = y.copy(), np.empty((len(c.speed), len(c.speed)))
        place = slice(len(y) - 1 - len(c.speed), len(y) - 1)
        still[place] = 0.0
        for j, x in enumerate(np.eye(len(c.speed))):
            found[:, j] = self.pushed(t, still, x)[place]
        dynamics.move(t, y, np.zeros(0), dynamics.UNCHANGED, self._chain)
        return found

    def gaps(self, t: float, y: Real) -> dict[str, tuple[float, float]]:
        """Gap of every closure: distance, and sine of the angle."""
        dynamics.move(*self._layout.whole(t, y), np.zeros(0), dynamics.UNCHANGED, self._chain)
        return {closure.name: self._gap(i, "value") for i, closure in enumerate(self.scene)}

    def relative_pose(self, t: float, y: Real, name: str) -> tuple[Real, Real]:
        """R_AB (3,3) and the position (3,) m of B from A of a closure, in axes of A in which its axis is z."""
        dynamics.move(*self._layout.whole(t, y), np.zeros(0), dynamics.UNCHANGED, self._chain)
        own = self._own.closure[[closure.name for closure in self.scene].index(name)]
        return own["rotation"].reshape(3, 3).copy(), own["position"].copy()

    def passing_time(self, t: float, y: Real) -> float:
        """The least time (s) in which a closure moves by its own size; inf at rest."""
        dynamics.move(*self._layout.whole(t, y), np.zeros(0), dynamics.UNCHANGED, self._chain)
        moving = self._own.closure[self._own.closure["speed"] > 0.0]
        return float(np.min(moving["size"] / moving["speed"], initial=np.inf))

    def _gap(self, i: int, key: str) -> tuple[float, float]:
        c = self.constants[1]
        rows = slice(c.closure["row_start"][i], c.closure["row_stop"][i])
        values, turns = self._own.row[key][rows], c.row["type"][rows] == ROTATION
        return float(np.linalg.norm(values[~turns])), float(np.linalg.norm(values[turns]))

    def count_rows(self) -> None:
        """Count the independent rows at the state linearised last, and keep the count for the mechanism."""
        dynamics.count_rows(self._chain.cc, self._own)
        self._counted[0] = _Counted(self._own.rank.copy(), self._own.size.copy())

    def begin_at(self, t: float, y: Real, before: Closures | None = None) -> None:
        """Count the independent rows at y = [q, u, work], which fulfils all closures (the scene's values may not).

        `before`: the same closures in the previous scene; its count is reused if the same speeds are prescribed and the
        same closures are closed.
        """
        if before is not None and self._is_counted_as(before):
            self._counted[0] = before._counted[0]
        else:
            self.linearise(t, y)
            self.count_rows()

    def _is_counted_as(self, other: Closures) -> bool:
        """Whether the same rows are independent as in other closures of the same bodies."""
        same_rows = np.array_equal(self.constants[1].row, other.constants[1].row)
        return same_rows and np.array_equal(self._is_prescribed, other._is_prescribed)

    @property
    def _is_prescribed(self) -> Flags:
        return self.constants[0].speed["prescribed"] >= 0

    @property
    def rank(self) -> int:
        """Number of independent rows in a closed configuration; -1 before it is known."""
        return self._counted[0].rank

    @property
    def counted(self) -> tuple[bytes, bytes]:
        """The counts and sizes that chains are built from, as a key that changes with a new count."""
        counted = self._counted[0]
        return counted.ranks.tobytes(), counted.size.tobytes()

    @property
    def independent(self) -> int:
        """Number of independent rows at the state evaluated last."""
        return int(np.sum(self._own.rank))

    @property
    def mobility(self) -> int:
        """Degrees of freedom that the closures leave, modes and wheels included."""
        return int(np.sum(self.constants[0].speed["prescribed"] < 0)) - self.rank

    def worst(self, errors: Real, *, rates: bool = False) -> str:
        """The closure with the largest error, and its gap or opening speed."""
        i = int(self.constants[1].row["closure"][np.argmax(np.abs(errors))])
        gap, angle = self._gap(i, "rate" if rates else "value")
        s = "/s" if rates else ""
        return f"{called(self.scene[i])} (gap {gap:.3g} m{s}, angle {angle:.3g} rad{s})"

    def half_turned(self) -> list[str]:
        """Names of the closures of which axes that they keep parallel are opposite."""
        which, places = self._kept_parallel
        opposite = self._own.closure["rotation"][which, places] < 0.0
        return list(dict.fromkeys(self.scene[i].name for i in which[opposite].tolist())) if opposite.any() else []

    @kept
    def _kept_parallel(self) -> tuple[Index, Index]:
        """Numbers of closures, and places on the diagonals of their rotations, of all axes that are kept parallel."""
        about = {"xyz": (1, 2), "xy": (2,)}  # by the turns that a closure suppresses
        pairs = [
            (i, 4 * axis)
            for i, closure in enumerate(self.scene) if not isinstance(closure, Coupling)
            for axis in about.get(suppressed(closure)[0], ())
        ]  # fmt: skip
        which, places = np.array(pairs, np.int64).reshape(-1, 2).T
        return which, places

    def determined(self, t: float, y: Real) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Whether each component of the loads of hinges (N,6) and closures (C,6) is unaffected by all null loads."""
        motion = self.motion(t, y)
        if motion.spread is None:
            return np.ones(motion.hinges.shape, bool), np.ones(motion.closures.shape, bool)
        spread = motion.spread
        return ~spread.leaves_open(spread.hinges), ~spread.leaves_open(spread.closures)

    def opening(self, t: float, y: Real) -> tuple[Real, Real]:
        """Row accelerations (G,) without constraint loads, and B' (G,nu) of all rows."""
        self.linearise(t, y)
        c, own = self.constants[0], self._own
        half = np.zeros((len(own.row), len(c.speed)))
        for group in blocks(self.constants[1], own):
            half[group.rows, group.columns] = group.half
        return own.row["acceleration"].copy(), half

    def null_loads(self) -> Real:
        """Orthonormal null loads (G,k) of the rows (they cause no acceleration), at the state evaluated last."""
        return self._null_loads(self._chain)

    def _null_loads(self, s: Closed) -> Real:
        loads = null_loads(s.cc, s.cw)
        out = np.zeros((len(s.cw.row), sum(null.shape[1] for _, null in loads)))
        first = 0
        for rows, null in loads:
            out[rows, first : first + null.shape[1]] = null
            first += null.shape[1]
        return out
