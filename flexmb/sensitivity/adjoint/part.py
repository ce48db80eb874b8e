"""One part of a run between two events, passed backwards: the transposes of all that happens in it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from flexmb.control.wiring import wired
from flexmb.kept import kept
from flexmb.sensitivity.adjoint.arc import Arc
from flexmb.sensitivity.adjoint.sampling import ActedInstant
from flexmb.sensitivity.adjoint.transposes import Transposes
from flexmb.sensitivity.blocks import Blocks
from flexmb.typing import Real


@dataclass(frozen=True)
class StateDirections:
    """Where the directions are: parameters; values at which coordinates are held, by `slots`; entries of y; signals,
    then states, of controllers."""

    parameters: int
    slots: tuple[str, ...]
    entries: int
    memories: int

    @property
    def lanes(self) -> int:
        """Number of the first ones, on which the equations of motion depend beside y."""
        return self.parameters + len(self.slots)

    @property
    def memory(self) -> int:
        """The first direction of signals."""
        return self.lanes + self.entries

    @property
    def size(self) -> int:
        """Number of all directions."""
        return self.memory + self.memories

    @property
    def state(self) -> slice:
        """Those of y."""
        return slice(self.lanes, self.memory)

    @kept
    def along(self) -> Real:
        """(n,D) change of y along all directions."""
        directions = np.zeros((self.entries, self.size))
        directions[:, self.state] = np.eye(self.entries)
        return directions

    def held(self, name: str) -> Real:
        """(D,) change of the value at which a coordinate is held."""
        values = np.zeros(self.size)
        values[self.parameters + self.slots.index(name)] = 1.0
        return values


@dataclass
class PassedPart:
    """One part of a run.

    arc: its steps, None where it has no duration. begin (s); start (n,D): how the state there changes along the
    directions of the part before; held: likewise values at which coordinates are held; moved (D,): how the scalar
    changes with the instant between both. added: gradients (D,) of the scalar by instant (s); instants: those of
    sampled controllers, by time, and what they hold at the start.
    """

    places: StateDirections
    blocks: Blocks
    arc: Arc | None
    begin: float
    start: Real
    held: dict[str, Real]
    moved: Real | None = None
    added: dict[float, Real] = field(default_factory=dict)
    instants: dict[float, ActedInstant] = field(default_factory=dict)

    def passed(self, gradient: Real, rows: dict[int, Real]) -> Real:
        """The gradient (D,) before the events at its start, from that at its end; rows: of outputs that wait, by number
        of the row, which the parts of a run share."""
        sweep = _Sweep(self, gradient, rows)
        if self.arc is None:
            sweep.instant(self.begin)
        else:
            sweep.back(self.arc)
        return self._before(sweep.gradient)

    def _before(self, gradient: Real) -> Real:
        """Across the events."""
        places = self.places
        before = self.start.T @ gradient[places.state]
        if self.moved is not None:
            before += self.moved
        before[: places.parameters] += gradient[: places.parameters]
        before[places.memory :] += gradient[places.memory :]
        for name, rates in self.held.items():
            before += gradient[places.parameters + places.slots.index(name)] * rates
        return np.asarray(before)


class _Sweep:
    """The gradient (D,) while a part is passed, and that of outputs that wait."""

    def __init__(self, part: PassedPart, gradient: Real, rows: dict[int, Real]) -> None:
        self._part, self.gradient, self._rows = part, gradient.copy(), rows
        self._switches = sorted(part.instants)
        self._transposes: Transposes | None = None
        self.times: Collection[float] = {*part.added, *part.instants}
        self.switches: Collection[float] = set(part.instants)

    def back(self, arc: Arc) -> None:
        """Pass the steps of the part."""
        part, places = self._part, self._part.places
        power = places.memory - 1
        of_power = self.gradient[power] != 0.0 or any(rates[power] != 0.0 for rates in part.added.values())
        functions = wired(part.blocks.system).drive["function"].tolist() if part.instants else []
        self._transposes = Transposes(part.blocks, places.lanes, functions, of_power)
        state = arc.backwards(self.gradient[places.state], self._transposes, self)
        self.gradient[places.state] = state
        self.gradient[: places.lanes] += self._transposes.by_parameters()
        self.instant(part.begin)

    def held(self, t: float) -> Real | None:
        """See `flexmb.sensitivity.adjoint.arc.Stops`."""
        if not self._switches:
            return None
        return self._part.instants[self._switches[int(np.searchsorted(self._switches, t, side="right")) - 1]].values

    def visit(self, t: float, gradient: Real) -> None:
        """See `flexmb.sensitivity.adjoint.arc.Stops`."""
        place = self._part.places.state
        self.gradient[place] = gradient
        self.instant(t)
        gradient[:] = self.gradient[place]

    def instant(self, t: float) -> None:
        """What the scalar adds at t, and before it what controllers do there."""
        part, places = self._part, self._part.places
        instant = part.instants.get(t)
        if instant is not None and self._transposes is not None:
            self.gradient += self._transposes.by_driven() @ instant.driven
        self.gradient += part.added.get(t, 0.0)
        if instant is None:
            return
        of_memory = self.gradient[places.memory :].copy()
        self.gradient[places.memory :] = 0.0
        for row, place in instant.applied:
            self._rows[row] = self._rows.get(row, 0.0) + of_memory[place]
        self.gradient += of_memory @ instant.memory
        for row, rates in instant.rows.items():
            if row in self._rows:
                self.gradient += self._rows.pop(row) @ rates
