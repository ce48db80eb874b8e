"""On which side of its level everything is that a run with events watches, from instant to instant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager

import numpy as np

from flexmb.integrate.settings import Settings
from flexmb.integrate.watch import UNKNOWN, Watch, watch
from flexmb.run.propagate import Integration, Raw
from flexmb.run.situation import Situation
from flexmb.scene.schema import SceneEvent
from flexmb.typing import Real

DIRECTIONS = {"rising": 1, "falling": -1, "either": 0}


class Sides:
    """`side` and `came` as in `Watch`, by the name of an event."""

    def __init__(
        self, situation: Situation, settings: Settings, integration: Callable[[], AbstractContextManager[Integration]]
    ) -> None:
        self.side, self.came = dict[str, int](), dict[str, int]()
        self._situation, self._settings, self._integration = situation, settings, integration

    def start(self, watched: Sequence[SceneEvent], y: Real) -> None:
        """Where a run starts."""
        self.side = {event.name: self._first_side(event, y) for event in watched}
        self.came = dict.fromkeys(self.side, 0)

    def make_known(self, watched: Sequence[SceneEvent]) -> None:
        """What was not watched before the instant is where it comes from."""
        for event in watched:
            if event.name not in self.side:
                self.side[event.name], self.came[event.name] = -DIRECTIONS[event.crossing], 0

    def take(self, watched: Sequence[SceneEvent], side: Sequence[int], came: Sequence[int]) -> None:
        """As they are in a `Watch`."""
        names = [event.name for event in watched]
        self.side, self.came = (dict(zip(names, map(int, each), strict=True)) for each in (side, came))

    def near(self, event: SceneEvent) -> float:
        """What is nearer to its level is at it: no run tells it from there."""
        return self._settings.atol + self._settings.rtol * abs(event.level)

    def _first_side(self, event: SceneEvent, y: Real) -> int:
        """On which side of its level something is where a run starts; at it, on that to which it moves.

        It has been at it before. Of signals the first step tells.
        """
        if self.is_signal(event):
            return UNKNOWN
        height, rate = y[self._situation.places[event.watch]] - event.level, self._situation.rate_of(event.watch)
        if abs(height) > self.near(event):
            return int(np.sign(height))
        return 0 if rate is None or self._situation.is_held(event.watch) else int(np.sign(y[rate]))

    def is_signal(self, event: SceneEvent) -> bool:
        return event.watch not in self._situation.places

    def probe(self, raw: Raw, event: SceneEvent, t: float, y: Real) -> tuple[float, float]:
        """See `flexmb.run.standing.Probe`."""
        rate = self._situation.rate_of(event.watch)
        if not self.is_signal(event):
            return float(y[self._situation.places[event.watch]] - event.level), 0.0 if rate is None else float(y[rate])
        begin = self._situation.going_on(self._situation.with_motion(raw, y))
        with self._integration() as solve:
            assert solve.feedback is not None
            place = solve.feedback.place_of(event.watch)
            height = solve.feedback.signals(begin)[place] - event.level
            return float(height), float(solve.feedback.signal_rates(begin)[place])

    def watching(self, watched: Sequence[SceneEvent], solve: Integration) -> Watch | None:
        if not watched:
            return None
        entries, still = [], []
        for event in watched:
            if self.is_signal(event):
                assert solve.feedback is not None
                entries.append(-1 - solve.feedback.place_of(event.watch))
                still.append(self.near(event))
            else:
                entries.append(self._situation.places[event.watch])
                still.append(0.0)
        directions = [DIRECTIONS[event.crossing] for event in watched]
        levels, names = [event.level for event in watched], [event.name for event in watched]
        sides, came = [self.side[name] for name in names], [self.came[name] for name in names]
        return watch(entries, levels, directions, sides, came, still, self.size(solve))

    def size(self, solve: Integration) -> int:
        """Of what is integrated, [q, u, work] or [q, u, x, work]."""
        controlled = 0 if solve.feedback is None else len(solve.feedback.state_names)
        return self._situation.system.nq + self._situation.system.nu + controlled + 1

    def arriving(
        self, watched: Sequence[SceneEvent], raw: Raw, found: Sequence[SceneEvent], levels: Watch | None, y: Real
    ) -> list[SceneEvent]:
        """Those that come to their levels, where coordinates are set exactly.

        Rounding may find one again that flies off.
        """
        off = []
        for i, event in enumerate(watched):
            if levels is not None and event in found:
                if self.is_signal(event):
                    has_jumped = not levels.found[i] or self.side[event.name] * levels.value[i] < -self.near(event)
                    rate = levels.rate[i] or self.probe(raw, event, raw.t, y)[1]  # steps may be roundings of time
                    rate = 0.0 if has_jumped else rate
                else:
                    y[self._situation.places[event.watch]] = event.level
                    place = self._situation.rate_of(event.watch)
                    rate = 0.0 if place is None else y[place]
                if self.side[event.name] * rate > 0.0:
                    off.append(event)
        return [event for event in found if event not in off]

    def move(self, watched: Sequence[SceneEvent], raw: Raw, found: Sequence[SceneEvent], y: Real) -> None:
        """After events. What was found at its level is beyond it, or back where it does not go on, or at it: 0; of
        what is left at rest the next steps tell, and `came` from where it came.

        By what events make of them signals pass no level.
        """
        heights = self._heights(raw, y, [event for event in watched if self.is_signal(event)])
        for event in watched:
            is_signal, side, came = self.is_signal(event), self.side.get(event.name, 0), self.came.get(event.name, 0)
            if event in found:
                self.side[event.name], self.came[event.name] = self._side_after(raw, event, side, y)
                continue
            height = heights[event.name] if is_signal else y[self._situation.places[event.watch]] - event.level
            if abs(height) > (self.near(event) if is_signal else 0.0):
                self.side[event.name], self.came[event.name] = int(np.sign(height)), 0
            else:
                self.side[event.name], self.came[event.name] = UNKNOWN if is_signal else side, came

    def _side_after(self, raw: Raw, event: SceneEvent, came: int, y: Real) -> tuple[int, int]:
        """Side, and `came`, of what was found at its level: it goes on, or back, or stays."""
        if self._situation.is_held(event.watch):
            return 0, 0
        if self._situation.rate_of(event.watch) is None and not self.is_signal(event):
            return -came, 0
        height, rate = self.probe(raw, event, raw.t, y)
        if abs(height) > self.near(event):
            return int(np.sign(height)), 0  # of a signal that jumped, or by its own event comes to jump
        if rate == 0.0:
            return UNKNOWN if self.is_signal(event) else 0, came
        return (-came if came * rate < 0.0 else came), 0

    def _heights(self, raw: Raw, y: Real, events: Sequence[SceneEvent]) -> dict[str, float]:
        """Of signals above their levels, before controllers act that are due."""
        if not events:
            return {}
        with self._integration() as solve:
            assert solve.feedback is not None
            signals = solve.feedback.signals(self._situation.going_on(self._situation.with_motion(raw, y)))
            return {event.name: float(signals[solve.feedback.place_of(event.watch)] - event.level) for event in events}
