"""The feedback of a scene: its closed loop in a run (`LoopRun`), and at single states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flexmb.control import loop
from flexmb.control.loop_run import LoopRun, Starting
from flexmb.control.measuring import sensors_by_time
from flexmb.control.schedule import LoopMemory
from flexmb.integrate.problem import Accuracy, Clock
from flexmb.tables.arguments import finite, vector
from flexmb.typing import Real

DISPLACEMENT = 1e-6  # m, rad: displacement of the finite difference for signal rates before integration starts
SLOWEST = 1e-100  # m/s, rad/s: slower motion counts as rest, since DISPLACEMENT over the speed would overflow
NOISE = 1e-8  # relative to DISPLACEMENT: a smaller change of a signal counts as zero


class Feedback(LoopRun):
    """The controllers of a system, for runs and single states."""

    def look(self, begin: Starting, acts: bool, anew: bool = False) -> LoopMemory:
        """Evaluate the loop at one state, as at the only output time of a finished run.

        acts: after the controllers that are due there have acted, see `conclude`.
        """
        y = self.only_at(begin)
        if acts:
            self.running.replaying[0] = 0
            self.conclude(begin.state.t, y, anew)
        known = self.remember()
        self.replay()
        return known

    def signals(self, begin: Starting) -> Real:
        """(S,) signals at one state, before the sampled controllers that are due there act."""
        y = self.only_at(begin)
        signals = np.zeros(len(self.running.signal))
        loop.project(begin.state.t, y.copy(), self.running)
        loop.look(begin.state.t, y, signals, self.running)
        self.raise_trouble()
        return signals

    def signal_rates(self, begin: Starting) -> Real:
        """(S,) rates (1/s) of the signals that are not sampled, by a finite difference; 0 at rest."""
        t, y = begin.state.t, self.only_at(begin)
        slope, there, ahead = np.zeros(len(y)), np.zeros(len(self.running.signal)), np.zeros(len(self.running.signal))
        loop.project(t, y.copy(), self.running)
        loop.rhs(t, y, slope, self.running, self.running)
        fastest = float(np.max(np.abs(slope[: self._plant.nq]), initial=0.0))
        if not SLOWEST < fastest < np.inf:
            return there
        loop.look(t, y, there, self.running)
        loop.look(t + DISPLACEMENT / fastest, y + DISPLACEMENT / fastest * slope, ahead, self.running)
        self.raise_trouble()
        change = ahead - there
        change[np.abs(change) <= NOISE * DISPLACEMENT + 64.0 * np.spacing(np.abs(ahead) + np.abs(there))] = 0.0
        rates: Real = change * (fastest / DISPLACEMENT)
        return rates

    def accelerations(self, begin: Starting) -> Real:
        """(nu,) accelerations at one state under the controllers; DynamicsError where they do not exist."""
        y, nq, nu = self.only_at(begin), self._plant.nq, self._plant.nu
        slope = np.empty(len(y))
        loop.project(begin.state.t, y, self.running)  # also sets the state of the closures
        status = loop.rhs(begin.state.t, y, slope, self.running, self.running)
        self.raise_trouble()
        self._plant.check_status(status, int(self._tables[1].fault[0]))
        return slope[nq : nq + nu]

    def only_at(self, begin: Starting) -> Real:
        """y (n,) = [q, u, x, work] at one state, as at the only output time of a finished run."""
        t = begin.state.t
        clock = Clock(np.array([t]), np.array([t]))
        y = self.begin(begin, clock, Accuracy(0.0, 0.0, 0, 0), None).y
        self.replay()
        return y

    def begin_at(self, begin: Starting, held: Mapping[str, Any]) -> Real:
        """`only_at` with these outputs of sampled controllers in force; TypeError, KeyError and ValueError for what are
        none."""
        if not isinstance(held, Mapping):
            raise TypeError(
                f"held is {held!r}: give the outputs of sampled controllers by name, as a dict; these are: "
                f"{sorted(self.sampled_widths)}"
            )
        y, widths = self.only_at(begin), self.sampled_widths
        for name, values in held.items():
            if name not in widths:
                raise KeyError(f'held: "{name}" is no sampled controller; these are: {sorted(widths)}')
            called, given = f'held["{name}"]', [values] if np.isscalar(values) else values
            self.running.signal[self.names[name]] = finite(called, vector(called, given, widths[name]))
        if held:
            loop.start(begin.state.t, y, self.running)
        return y

    def put_drive(self, i: int, value: float) -> None:
        """Give the i-th function of time that controllers drive another value, until the loop is evaluated again."""
        loop.put_drive(i, value, self.running)

    def rates_of_time(self, t: float) -> Real:
        """(S,) how the signals of sensors change with time at a state that is held."""
        rates_of_time = np.zeros(int(np.sum(self._wiring.sensor["width"])))
        sensors_by_time(t, self.running, rates_of_time)
        return rates_of_time
