"""The controllers of a run in dual numbers: one `LoopVariation` for each block of directions."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from flexmb.control import variation
from flexmb.control.feedback import Feedback
from flexmb.control.tables import (
    ADDRESSES,
    MARKERS,
    MOTION,
    OBSERVING,
    OUTPUTS,
    TREE,
    TREE_WORKSPACE,
    WORKSPACE,
    Loop,
    LoopVariation,
    PlainLaw,
)
from flexmb.control.wiring import wired
from flexmb.jit.direct import address, addresses
from flexmb.jit.duals import DUAL
from flexmb.jit.pointer import REAL, STATUS, VOID
from flexmb.jit.wide_arrays import as_duals, wide_zeros
from flexmb.sensitivity import tree
from flexmb.sensitivity.blocks import Blocks, set_lanes
from flexmb.sensitivity.law_rates import LawRates
from flexmb.typing import Real

KEPT = "signal", "state", "held"
"""What controllers remember from one part of a run to the next."""
_SHARED = "y", "dy", "rates", "markers", "loads", "drives", "function"
"""Arrays of the motion's workspace, constants and outputs."""


class Loops:
    """The loops of all blocks, in the part of a run that `feedback` has begun.

    law (B,states,8), law_rate: states of controllers and their rates, the memory of the loops.
    """

    def __init__(self, feedback: Feedback, blocks: Blocks, rates: LawRates, before: Loops | None, ends: bool) -> None:
        """before: the loops of the part of the run before, None at its start; ends: whether the run ends where this
        part begins, so that controllers which act there have acted in floats only."""
        made, self._feedback, self.blocks = feedback.running, feedback, blocks
        plain, shape = variation.plain_laws(made), (len(blocks), len(made.state))
        self.law, self.law_rate = (wide_zeros(shape, number=DUAL) for _ in range(2))
        self.law[..., 0] = made.state
        self.continuous = np.array(feedback.continuous_states, np.int64)
        self.tables = [
            _variation(made, feedback, plain, blocks, b, state=self.law[b], change=self.law_rate[b])
            for b in range(len(blocks))
        ]
        for b, tables in enumerate(self.tables):
            set_lanes(tables.number, rates.number, b)
            set_lanes(tables.drive["gain"], rates.gain, b)
            set_lanes(tables.course["data"], rates.course, b)
            set_lanes(tables.piece, rates.piece, b)
            if before is None:
                set_lanes(tables.state, rates.state, b)
            else:
                for name in KEPT:
                    old, new = getattr(before.tables[b], name), getattr(tables, name)
                    rows = min(len(old), len(new))
                    new[:rows, ..., 0 if ends else 1 :] = old[:rows, ..., 0 if ends else 1 :]
                if ends:
                    tables.following[:] = before.tables[b].following
        first = self.tables[0]
        self.steer, _ = addresses(variation.steer, STATUS, REAL, first)
        self.follow = addresses(variation.follow, STATUS, REAL, first)[0] if made.follows[0] else 0

    @property
    def where(self) -> list[int]:
        """Addresses of the tables of all loops."""
        return [address(table) for table in self.tables]

    def begin(self, t: float) -> None:
        """Begin the continuous controllers at the states of the blocks; sampled ones that are due at t act first."""
        for table in self.tables:
            variation.begin(t, table)
            if table.continuous[0] and len(table.instant) and table.instant["time"][table.following[0], 0] == t:
                variation.steer(t, table)
                variation.begin(t, table)

    def is_due(self, t: float) -> bool:
        """Whether a sampled controller acts at t."""
        first = self.tables[0]
        waiting = first.instant["time"][first.following[0] :, 0]
        return bool(len(waiting)) and bool(waiting[0] <= t)

    def is_sampled(self, signal: str) -> bool:
        """Whether a signal is an output of a sampled controller."""
        return self._feedback.is_sampled(signal)

    def place_of(self, signal: str) -> int:
        """The index of a signal among all of them."""
        return self._feedback.place_of(signal)

    def just_before(self, t: float) -> float:
        """A time (s) before t at which no instant counts as reached that is due at t."""
        return float(np.nextafter(t - 2.0 * self.tables[0].slack[0, 0], -np.inf))

    def distance_to_instants(self, t: float) -> float:
        """The time (s) from t to the nearest sampling instant, infinite without one."""
        times = self.tables[0].instant["time"][:, 0]
        return float(np.min(np.abs(times - t), initial=np.inf))

    def replay(self) -> None:
        """From now on outputs of sampled controllers are read back."""
        for table in self.tables:
            table.replaying[0] = 1
            table.now[0] = np.inf

    def look(self, t: float) -> tuple[Real, Real]:
        """All signals (S,) and their derivatives (S,P) at t, at the states of the blocks."""
        for table in self.tables:
            self.blocks.check(variation.look(t, table))
        self._feedback.raise_trouble()
        return self.tables[0].signal[:, 0].copy(), self.blocks.joined([table.signal for table in self.tables])


def _variation(made: Loop, feedback: Feedback, plain: PlainLaw, blocks: Blocks, b: int, **own: Any) -> LoopVariation:
    w, out, c = blocks.workspaces[b], blocks.outputs[b], blocks.duals[b].constants
    arrays: dict[str, Any] = {
        field.name: as_duals(getattr(made, field.name))
        for field in fields(LoopVariation)
        if field.name not in ("plain", "address", "drive", "instant", "held", *_SHARED, *own)
    }
    where = np.zeros(ADDRESSES, np.int64)
    where[MOTION], where[WORKSPACE], where[OUTPUTS] = blocks.motion, blocks.where[b], address(out)
    where[TREE], where[TREE_WORKSPACE] = address(c), address(w)
    if made.has_markers[0]:
        where[MARKERS] = addresses(tree.see, VOID, REAL, c, w, out)[0]
    if made.has_at_once[0]:
        where[OBSERVING] = blocks.observing_at
    held, table = np.zeros((max(feedback.samples, len(made.held)), made.held.shape[1])), feedback.schedule
    held[: len(made.held)] = made.held
    return LoopVariation(
        **arrays, **own, plain=plain, address=where, instant=as_duals(table), held=as_duals(held), function=c.function,
        drive=as_duals(wired(blocks.system).drive), y=w.state, dy=w.slope, rates=out.rates, markers=out.markers,
        loads=out.loads, drives=out.drives,
    )  # fmt: skip
