"""The closures of one scene from Python: accelerations and loads of the closed chain."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexmb.arrays import Constants, Index, Real, Workspace
from flexmb.closure import dynamics
from flexmb.closure.tables import ROTATION, ClosureConstants, ClosureWorkspace, workspace
from flexmb.scene.schema import Closure

STIFF = 100.0  # periods of the slowest mode, over 2 pi, for which bodies resist being bent by the closing of loops
SAME = 1e-7  # loads that differ by less, in the size of the loads, are the same


class ClosureError(ValueError):
    """Closures that cannot be closed, or leave no motion; the message names the closure, the gap and the remedy."""


class ClosedWorkspace(NamedTuple):
    """What one evaluation of a closed chain writes: of its tree, of its closures."""

    tree: Workspace
    closures: ClosureWorkspace

    @property
    def fault(self) -> Index:
        """(1,) body or closure where an evaluation failed."""
        return self.tree.fault


class ClosedMotion(NamedTuple):
    """Accelerations (nu,), drive loads (nu,), loads (N,6) of hinges and (C,6) of closures, World axes."""

    accelerations: Real
    drives: Real
    hinges: Real
    closures: Real


class Closures:
    """The closures of one scene and the tree under them. It owns one workspace: threads must not share it."""

    def __init__(
        self,
        closures: Sequence[Closure],
        constants: Constants,
        own: ClosureConstants,
        tree: Workspace,
        slowest: float,
        check: Callable[[int, int], None],
    ) -> None:
        """`slowest`: lowest modal frequency (rad/s), infinite without modes.

        `check` raises unless a status is OK; its second argument is the body or closure at fault.
        """
        self.scene, self._check, self._slowest = closures, check, slowest
        self.constants = constants, own
        self.rank = -1  # independent rows of a closed configuration; -1 before the first one is known
        self._tree, self._own = self.workspace(tree)

    def workspace(self, tree: Workspace, rate: float = 0.0) -> ClosedWorkspace:
        """A fresh workspace of the closures beside one of the tree; with a `rate` (1/s) closures are stabilised."""
        c, cc = self.constants
        bodies, modes = c.mode.shape
        own = workspace(cc, bodies, modes, len(c.speed))
        own.rank[0], own.gain[:] = self.rank, (2.0 * rate, rate * rate)
        return ClosedWorkspace(tree, own)

    @property
    def _arrays(self) -> tuple[Constants, Workspace, ClosureConstants, ClosureWorkspace]:
        c, cc = self.constants
        return c, self._tree, cc, self._own

    @property
    def fault(self) -> int:
        """Body or closure at which the last evaluation failed."""
        return int(self._tree.fault[0])

    def motion(self, t: float, y: Real) -> ClosedMotion:
        """Everything about accelerations and loads at y = [q, u, work], which must be closed."""
        c, w, cc, cw = self._arrays
        hinges, closures = np.zeros((len(c.body), 6)), np.zeros((len(cc.closure), 6))
        cw.rank[0] = self.rank
        self.linearise(t, y)
        self._check(dynamics.closure_loads(c, w, cc, cw), self.fault)
        cw.row["load"] = self._last = self._least(cw.row["load"])
        dynamics.loads(c, w, cc, cw, hinges, closures)
        drives = np.where(c.speed["prescribed"] >= 0, w.speed["drive"], 0.0)
        return ClosedMotion(w.speed["acceleration"].copy(), drives, hinges, closures)

    # Newton's steps, for initial conditions

    def linearise(self, t: float, y: Real) -> None:
        """Rows' values, rates and responses to unit loads at y."""
        self._check(dynamics.linearise(t, y, *self._arrays), self.fault)

    def linearise_stiff(self, t: float, y: Real) -> int:
        """The same with the metric that hardly bends bodies; returns the status code."""
        _, *others = self._arrays
        return int(dynamics.linearise(t, y, self._stiff, *others))

    @cached_property
    def _stiff(self) -> Constants:
        """The tree with modal masses M + K (STIFF/omega)^2, omega its lowest modal frequency."""
        c = self.constants[0]
        pair = c.pair.copy()
        pair["mff"] += (STIFF / self._slowest) ** 2 * pair["stiffness"]
        return replace(c, pair=pair)

    def responses(self) -> Real:
        """B' (G,nu) of the rows in the size of their closures: Lambda^-1 = B'B."""
        return self._scale("size")[:, None] * self._own.half

    def errors(self) -> Real:
        """Values of the rows in the size of their closures (G,)."""
        return self._scale("size") * self._own.row["value"]

    def rates(self) -> tuple[Real, float]:
        """Rates of the rows (G,) scaled as `responses` are, and the largest in the speed of its ports."""
        fastest = np.abs(self._scale("speed") * self._own.row["rate"])
        return self._scale("size") * self._own.row["rate"], float(np.max(fastest, initial=0.0))

    def _scale(self, key: str) -> Real:
        c = self.constants[1]
        size = self._own.closure[key][c.row["closure"]]
        return c.weight / np.where(size > 0.0, size, 1.0)

    def moved(self, t: float, y: Real, x: Real) -> Real:
        """y displaced by the motion that x stands for; rows' values are those of the result."""
        y = y.copy()
        dynamics.move(t, y, x, dynamics.COORDINATES, *self._arrays)
        return y

    def pushed(self, t: float, y: Real, x: Real) -> Real:
        """y with its speeds changed by what x stands for; rows' rates are those of the result."""
        y = y.copy()
        dynamics.move(t, y, x, dynamics.SPEEDS, *self._arrays)
        return y

    def gaps(self, t: float, y: Real) -> dict[str, tuple[float, float]]:
        """Distance and (sine of the) angle by which every closure is open."""
        dynamics.move(t, y, np.zeros(0), dynamics.NOTHING, *self._arrays)
        return {closure.name: self._gap(i, "value") for i, closure in enumerate(self.scene)}

    def _gap(self, i: int, key: str) -> tuple[float, float]:
        c = self.constants[1]
        rows = slice(c.closure["row_start"][i], c.closure["row_stop"][i])
        values, turns = self._own.row[key][rows], c.row["type"][rows] == ROTATION
        return float(np.linalg.norm(values[~turns])), float(np.linalg.norm(values[turns]))

    def count_rows(self) -> None:
        """Independent rows at the state linearised last, taken as those of the mechanism."""
        _, _, cc, cw = self._arrays
        dynamics.count_rows(cc, cw)
        self.rank = int(cw.rank[0])

    @property
    def independent(self) -> int:
        """Independent rows at the state evaluated last."""
        return int(self._own.rank[0])

    @property
    def mobility(self) -> int:
        """Free speeds that the closures leave, modes and wheels included."""
        return int(np.sum(self.constants[0].speed["prescribed"] < 0)) - self.rank

    def worst(self, errors: Real, *, rates: bool = False) -> str:
        """The closure with the largest error, and its gap or the speed at which it opens."""
        i = int(self.constants[1].row["closure"][np.argmax(np.abs(errors))])
        gap, angle = self._gap(i, "rate" if rates else "value")
        s = "/s" if rates else ""
        return f'closure "{self.scene[i].name}" (gap {gap:.3g} m{s}, angle {angle:.3g} rad{s})'

    def half_turned(self) -> Iterator[tuple[str, bool]]:
        """Whether axes that a closure keeps parallel point opposite ways."""
        for closure, state in zip(self.scene, self._own.closure, strict=True):
            R = state["rotation"].reshape(3, 3)
            about = {"weld": (1, 2), "prismatic": (1, 2), "universal": (), "spherical": ()}.get(closure.type, (2,))
            yield closure.name, any(R[i, i] < 0.0 for i in about)

    def determined(self, t: float, y: Real) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Whether each component of the hinges' (N,6) and closures' (C,6) loads is the same for all null loads."""
        c, w, cc, cw = self._arrays
        found = [self.motion(t, y)]
        size = max(1.0, float(np.max(np.abs(cw.row["load"]))))
        for null in self.null_loads().T:
            self.linearise(t, y)
            hinges, closures = np.zeros((len(c.body), 6)), np.zeros((len(cc.closure), 6))
            cw.row["load"] = self._last + size * null
            dynamics.loads(c, w, cc, cw, hinges, closures)
            found.append(found[0]._replace(hinges=hinges, closures=closures))
        return (
            np.ptp([each.hinges for each in found], axis=0) <= SAME * size,
            np.ptp([each.closures for each in found], axis=0) <= SAME * size,
        )

    def _least(self, loads: Real) -> Real:
        """Of all loads of the rows that move the mechanism alike, the least in the sum of squares (SI)."""
        null = self.null_loads()
        return loads - null @ (null.T @ loads)

    def null_loads(self) -> Real:
        """Orthonormal loads (G,k) of the rows that move nothing, at the state evaluated last."""
        half = self._own.half
        rows, rank = len(half), int(self._own.rank[0])
        if rank == rows:
            return np.zeros((rows, 0))
        chosen, rest = self._own.chosen[:rank], self._own.chosen[rank:]
        null = np.zeros((rows, rows - rank))
        null[rest] = np.eye(rows - rank)
        null[chosen] = -np.linalg.lstsq(half[chosen].T, half[rest].T, rcond=None)[0]
        return np.linalg.qr(null)[0]
