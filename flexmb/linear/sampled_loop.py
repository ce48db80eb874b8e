"""The linear loop of sampled controllers over one period: what happens at instants, and the exact flow between them.

Between instants z' = A z + B f with the states z of the motion, of continuous controllers and of what sampled ones hold
(`flexmb.control.held`), so that z(t + h) = exp(A h) z(t) + (integral of exp(A s) B ds over h) f with loads f that are
held. At an instant delayed outputs change first, then the sampled controllers act in the order of the scene, as in a
run (`flexmb.control.schedule`). The state over the common period T of all controllers is [z; s; p], with the states s
of sampled controllers and the outputs p that were computed but do not act yet. Its map is the product of all these: the
lifted model (Bittanti, Colaneri, Periodic Systems, 2009, 6.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import gcd, lcm
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from flexmb.control.sampled_laws import SampledLaw
from flexmb.control.schedule import instants, slack
from flexmb.control.tables import APPLY
from flexmb.scene.control import Controller
from flexmb.typing import Flags, Real, Record

MOST_INSTANTS = 100_000
"""In one common period: each takes a product of matrices."""
COMMENSURABLE = 1e-9  # relative distance of a ratio of periods from one of whole numbers
LARGEST_RATIO = 10_000


class BetweenInstants(NamedTuple):
    """The linear model between instants: A (z,z), B (z,f); signals (S,z) and by_load (S,f): all signals; places: of the
    outputs of the sampled controllers, by name, among z; outputs C (y,z), D (y,f), of which the last are the sensors'
    signals."""

    A: Real
    B: Real
    signals: Real
    by_load: Real
    places: dict[str, list[int]]
    C: Real
    D: Real


class Cut(NamedTuple):
    """A loop that is opened at one signal: what the controllers read there, or put out, is an input, and the signal an
    output."""

    signal: int
    is_sensor: bool


class Lifted(NamedTuple):
    """x(t + T) = A x + B i, y = C x + D i just after the instants at t. Inputs i: loads, what is added to sensors'
    signals as sampled controllers read them, and with a cut the signal that replaces the one that is cut; the last row
    of y is the one that it replaces. read (x,): whether anything depends on a state."""

    A: Real
    B: Real
    C: Real
    D: Real
    read: Flags


class LiftedLoop:
    """The controllers of a scene with the linear model between their instants.

    laws: of the sampled controllers, by name; sensors: how many signals sensors have.
    """

    def __init__(
        self, controllers: Sequence[Controller], held: BetweenInstants, laws: dict[str, SampledLaw], sensors: int
    ) -> None:
        self.controllers, self.held, self.laws, self.sensors = tuple(controllers), held, laws, sensors
        self.sampled = [controller for controller in self.controllers if controller.period_s is not None]
        self._flows: dict[float, tuple[Real, Real]] = {}

    def period(self, asked: float | None) -> float:
        """The common period (s) of the controllers, or the one asked for if it is a multiple of it; else ValueError."""
        periods = [controller.period_s or 0.0 for controller in self.sampled]
        if not periods:
            if asked is None:
                raise ValueError("period: no controller of the scene is sampled: give the period (s) of the model")
            return asked
        common = _common(periods, [controller.name for controller in self.sampled])
        if asked is None:
            return common
        times = round(asked / common)
        if times < 1 or abs(asked - times * common) > COMMENSURABLE * asked:
            raise ValueError(
                f"period: {asked:g} s is no multiple of {common:g} s, after which the controllers of the scene repeat: "
                "leave it out, or give a multiple"
            )
        return times * common

    def lifted(self, period: float, cut: Cut | None = None) -> Lifted:
        """The model over a period, from an instant of the first sampled controller on.

        ValueError for a cut at a signal that is not sampled exactly once in a period.
        """
        start, table = self._instants(period)
        state_of, n = self._state_places(), len(self.held.A) + sum(len(law.A) for law in self.laws.values())
        waiting = _waiting(table, start)
        by = dict(zip(table["row"].tolist(), table["controller"].tolist(), strict=True))
        slots, size = dict[int, slice](), n
        for i, rows in waiting.items():
            for row in rows:
                width = len(self.laws[self.controllers[i].name].outputs)
                slots[row] = slice(size, size + width)
                size += width
        loads = self.held.B.shape[1]
        inputs = loads + self.sensors + (cut is not None)
        walk = _PeriodWalk(self, np.eye(size, size + inputs), size, cut)
        later = {row: walk.x[place] for row, place in slots.items()}
        now, end, out = start, start + period, None
        for due in table[table["time"] >= start]:
            time = float(due["time"])
            if time > now:
                out = walk.looked() if out is None else out
                walk.advance(time - now)
                now = time
            controller = self.controllers[int(due["controller"])]
            if due["kind"] == APPLY:
                walk.put(controller.name, later.pop(int(due["row"])))
                continue
            found = walk.sampled(controller.name, state_of[controller.name])
            if due["immediate"]:
                walk.put(controller.name, found)
            else:
                later[int(due["row"])] = found
        out = walk.looked() if out is None else out
        if end > now:
            walk.advance(end - now)
        last = walk.x.copy()
        left = sorted(later, key=lambda row: (by[row], row))  # as many of each controller as at the start
        for place, row in zip(slots.values(), left, strict=True):
            last[place] = later[row]
        if cut is not None:
            out = np.vstack([out, walk.cut_row()])
        A, B = last[:, :size], last[:, size:]
        return Lifted(A, B, out[:, :size], out[:, size:], _read(A, out[:, :size]))

    def state_names(self, period: float) -> list[str]:
        """Of the states after those between instants: of sampled controllers, then outputs that do not act yet."""
        start, table = self._instants(period)
        names = [f"{name}.state[{i}]" for name, law in self.laws.items() for i in range(len(law.A))]
        for i, rows in _waiting(table, start).items():
            name = self.controllers[i].name
            for ago in range(len(rows), 0, -1):
                names += [f"{name}.delayed[{ago}][{j}]" for j in range(len(self.laws[name].outputs))]
        return names

    def start(self, period: float) -> float:
        """The time (s) at which the period of `lifted` starts: all controllers have begun before."""
        return self._instants(period)[0]

    def flow(self, h: float) -> tuple[Real, Real]:
        """exp(A h), and its integral from 0 to h times B."""
        if h not in self._flows:
            n, f = self.held.B.shape
            both = np.zeros((n + f, n + f))
            both[:n, :n], both[:n, n:] = self.held.A, self.held.B
            moved = expm(h * both)[:n]
            if not np.isfinite(moved).all():
                raise ValueError(f"period: within {h:g} s the motion grows beyond all numbers: give a shorter one")
            self._flows[h] = moved[:, :n], moved[:, n:]
        return self._flows[h]

    def _state_places(self) -> dict[str, slice]:
        places, first = dict[str, slice](), len(self.held.A)
        for name, law in self.laws.items():
            places[name] = slice(first, first + len(law.A))
            first += len(law.A)
        return places

    def _instants(self, period: float) -> tuple[float, Record]:
        """The start (s) of a period before which all controllers have begun, and all instants before its end."""
        if not self.sampled:
            return 0.0, instants((), 0.0, period, ())
        first = self.sampled[0].offset_s
        begun = max(each.offset_s + each.delay_s + (each.period_s or 0.0) for each in self.sampled)
        start = first + period * max(1, int(np.ceil((begun - first) / period)))
        count = sum(period / (controller.period_s or period) for controller in self.sampled)
        if count > MOST_INSTANTS:
            raise ValueError(
                f"the controllers act {count:.0f} times until all repeat, after {period:g} s; {MOST_INSTANTS} are "
                "allowed: give them periods with a smaller common one"
            )
        apart = slack(0.0, start + period)
        table = instants(self.controllers, 0.0, start + 1.5 * period, (start, start + period))
        table = table[table["time"] < start + period - 2.0 * apart]
        return start, table


class _PeriodWalk:
    """The state at a time as a linear function of that at the start and of the inputs: rows x (size, size + inputs)."""

    def __init__(self, loop: LiftedLoop, x: Real, size: int, cut: Cut | None) -> None:
        self._loop, self.x, self._cut = loop, x, cut
        n, loads = len(loop.held.A), loop.held.B.shape[1]
        self._z = slice(0, n)
        unit = np.eye(x.shape[1])[size:]
        self._loads, self._added = unit[:loads], unit[loads : loads + loop.sensors]
        self._replacing = None if cut is None else unit[-1]
        self._seen: Real | None = None
        self._cut_rows = list[Real]()
        self._cut_now = False

    def advance(self, h: float) -> None:
        moved, driven = self._loop.flow(h)
        self.x[self._z] = moved @ self.x[self._z] + driven @ self._loads
        self._seen, self._cut_now = None, False

    def looked(self) -> Real:
        """Rows of all outputs, then of the controllers' outputs."""
        held = self._loop.held
        outputs = held.C @ self.x[self._z] + held.D @ self._loads
        return np.vstack([outputs, self._signals()[self._loop.sensors :]])

    def put(self, name: str, rows: Real) -> None:
        """The outputs of a sampled controller change."""
        self.x[self._loop.held.places[name]] = rows

    def sampled(self, name: str, own: slice) -> Real:
        """A controller acts; returns the rows of its outputs."""
        law, states = self._loop.laws[name], self.x[own]
        read = self._read()[law.reads]
        outputs, self.x[own] = law.C @ states + law.D @ read, law.A @ states + law.B @ read
        if self._cut is not None and not self._cut.is_sensor and self._cut.signal in law.signals:
            j = int(self._cut.signal - law.signals[0])
            self._cut_rows.append(outputs[j].copy())
            outputs[j] = self._replacing
        return outputs

    def cut_row(self) -> Real:
        """The row of the signal that is cut."""
        if len(self._cut_rows) != 1:
            raise ValueError(
                f"it is sampled {len(self._cut_rows)} times until all controllers repeat, so that no one transfer "
                "function describes its loop: see `multipliers`, or cut the loop at the slowest controller"
            )
        return self._cut_rows[0]

    def _signals(self) -> Real:
        held = self._loop.held
        signals: Real = held.signals @ self.x[self._z] + held.by_load @ self._loads
        return signals

    def _read(self) -> Real:
        """Rows of all signals as sampled controllers read them. Those of sensors and continuous controllers are looked
        at before the first of those that are due acts."""
        signals = self._signals()
        if self._seen is None:
            self._seen = signals.copy()
        for name, law in self._loop.laws.items():
            self._seen[law.signals] = self.x[self._loop.held.places[name]]
        read = self._seen.copy()
        read[: self._loop.sensors] += self._added
        if self._cut is not None and self._cut.is_sensor:
            if not self._cut_now:
                self._cut_rows.append(read[self._cut.signal].copy())
                self._cut_now = True
            read[self._cut.signal] = self._replacing
        return read


def _common(periods: Sequence[float], names: Sequence[str]) -> float:
    ratios = []
    for period, name in zip(periods, names, strict=True):
        ratio = Fraction(period / periods[0]).limit_denominator(LARGEST_RATIO)
        if abs(float(ratio) * periods[0] - period) > COMMENSURABLE * period:
            raise ValueError(
                f'controllers "{names[0]}" and "{name}" are sampled every {periods[0]:g} s and {period:g} s, which '
                "never repeat together: give them periods whose ratio is one of whole numbers"
            )
        ratios.append(ratio)
    return periods[0] * lcm(*(ratio.numerator for ratio in ratios)) / gcd(*(ratio.denominator for ratio in ratios))


def _waiting(table: Record, start: float) -> dict[int, list[int]]:
    """By controller the rows of samples before the start whose outputs change at it or later."""
    before = table[table["time"] < start]
    sampled = before[before["kind"] != APPLY]
    applied = set(before["row"][before["kind"] == APPLY].tolist())
    found = dict[int, list[int]]()
    for due in sampled:
        if not due["immediate"] and int(due["row"]) not in applied:
            found.setdefault(int(due["controller"]), []).append(int(due["row"]))
    return {i: found[i] for i in sorted(found)}


def _read(A: Real, C: Real) -> Flags:
    """Which states anything depends on: all of the motion, and what is not overwritten before it is read."""
    read = np.ones(len(A), bool)
    while True:
        idle = read & ~np.any(A[read] != 0.0, axis=0) & ~np.any(C != 0.0, axis=0)
        if not idle.any():
            return read
        read &= ~idle
