"""The result of many runs: states at the output times, and how each run ended."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from flexmb.run.event_record import EventRecord
from flexmb.run.outputs import ending
from flexmb.system.batch import Batch
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.tables.status import OK, Status
from flexmb.typing import Index, Real


@dataclass(frozen=True)
class BatchTrajectory:
    """n runs at T output times t (s).

    q (n,T,nq), u (n,T,nu) and work (n,T) J are as in `flexmb.Trajectory`, NaN at times that a run did not reach.
    `status` (n,) holds values of `flexmb.Status`, `stopped_at` (n,) s the time of the last good state of each run;
    evaluations, accepted_steps, rejected_steps (n,) count. `batch.system(copy)` evaluates all other quantities. Of
    scenes with events or controllers: `events` (n) holds those of each copy, as `flexmb.Trajectory.events`, `signals`
    those (n,T,k) of sensors and controllers by name, `messages` (n) how each run ended; all are empty for others.
    """

    batch: Batch
    t: Real
    q: Real
    u: Real
    work: Real
    status: Index
    fault: Index
    stopped_at: Real
    evaluations: Index
    accepted_steps: Index
    rejected_steps: Index
    events: tuple[tuple[EventRecord, ...], ...] = ()
    signals: dict[str, Real] = field(default_factory=dict)
    messages: tuple[str, ...] = ()

    __repr__ = brief

    def __post_init__(self) -> None:
        """TypeError or ValueError for inconsistent arrays. Methods that use them check again, as arrays may change."""
        self._refuse_torn()

    def _refuse_torn(self) -> None:
        if not isinstance(self.batch, Batch):
            raise TypeError(f"batch is a {type(self.batch).__name__}: give the Batch of these runs")
        arguments.held("t", self.t, (None,))
        arguments.held("status", self.status, (None,), "i")
        n, T = len(self.status), len(self.t)
        shapes = {"q": (n, T, self.batch.nq), "u": (n, T, self.batch.nu), "work": (n, T), "stopped_at": (n,)}
        for name, shape in shapes.items():
            arguments.held(name, getattr(self, name), shape)
        for name in ("fault", "evaluations", "accepted_steps", "rejected_steps"):
            arguments.held(name, getattr(self, name), (n,), "i")
        for name in ("events", "messages"):
            if len(getattr(self, name)) not in (0, n):
                raise ValueError(f"there are {n} runs, but {name} of {len(getattr(self, name))}")
        if not self.batch.shares_constants and n != len(self.batch.systems):
            raise ValueError(f"there are {n} runs, but the batch has {len(self.batch.systems)} copies")

    @property
    def finished(self) -> bool:
        """Whether all runs reached their end."""
        return not len(self.failed)

    @property
    def statuses(self) -> tuple[Status, ...]:
        """How the runs ended, by name."""
        return tuple(map(Status, self.status.tolist()))

    @property
    def failed(self) -> Index:
        """Indices of the copies whose runs did not reach their end."""
        return np.flatnonzero(self.status != OK)

    def message(self, copy: int) -> str:
        """How the run of a copy ended, in words; ValueError or TypeError for an invalid index."""
        self._refuse_torn()
        copy = arguments.index("copy", copy, len(self.status))
        if self.messages:
            return self.messages[copy]
        status, fault, t = int(self.status[copy]), int(self.fault[copy]), float(self.stopped_at[copy])
        return ending(self.batch.system(copy), Status(status), fault, t)
