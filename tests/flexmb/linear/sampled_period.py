"""A period of a sampled loop by integration of the nonlinear equations, from any state: what its linear model is of."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import flexmb as fm
from flexmb.control import loop
from flexmb.control.feedback import Feedback
from flexmb.control.laws import BEGUN, INTEGRAL
from flexmb.control.loop_run import FreshStart
from flexmb.control.schedule import instants
from flexmb.control.tables import APPLY
from flexmb.integrate.problem import Accuracy, Clock
from flexmb.system import algorithms
from flexmb.typing import Real

SIZE = 5e-6  # of deviations: what is not linear is its square, and 1e-16 over it is rounding


class NonlinearPeriod:
    """Of a scene that rests with all controllers' states and outputs zero, but for PID controllers whose integrals are
    `integrals`, from `start` (s) on. motion: as of a `LinearModel`."""

    def __init__(
        self, scene: fm.Scene, model: fm.SampledModel, start: float, motion: Real, integrals: dict[str, float]
    ) -> None:
        self._integrals = integrals
        self._system, self._model, self._start, self._motion = fm.compile(scene), model, start, motion
        end = start + model.period
        self._table = instants(scene.controllers, 0.0, end, (start, end))
        self._table = self._table[self._table["time"] < end - 1e-9]

    def matrix(self) -> Real:
        """A by central differences."""
        n = len(self._model.states)
        return np.array([(self(e) - self(-e)) / (2.0 * SIZE) for e in SIZE * np.eye(n)]).T

    def __call__(self, x: Real) -> Real:
        """Deviations (n,) at the end of the period, from those at its start."""
        system, names = self._system, [name for name, _ in self._model.states]
        n = len(self._model.rates)
        rest = self._model.state
        u = rest.u.copy()
        free = [i for i, (name, _) in enumerate(system.state_names[1]) if name in names]
        u[free] += x[n : 2 * n]
        state = replace(rest, q=rest.q + self._motion @ x[:n], u=u, t=self._start)
        route = system.route()
        feedback = Feedback(system, algorithms.chosen("articulated"), route, route.tables())
        end = self._start + self._model.period
        clock = Clock(np.array([self._start, end]), np.array([end]))
        y = feedback.begin(FreshStart(state), clock, Accuracy(0.0, 0.0, 0, 0), None).y
        made = feedback.running
        made.following[0], made.state[:], made.signal[:], made.held[:] = 0, 0.0, 0.0, 0.0
        made.following[0] = np.searchsorted(self._table["time"], self._start - 1e-9)
        for row, controller in zip(made.controller, feedback.controllers, strict=True):
            if row["sampled"] and isinstance(controller, fm.Pid):
                integral = self._integrals.get(controller.name, 0.0)
                made.state[row["state"] + BEGUN], made.state[row["state"] + INTEGRAL] = 1.0, integral
                made.signal[row["signal"]] = integral
                i = [each.name for each in feedback.controllers].index(controller.name)
                own = (self._table["controller"] == i) & (self._table["kind"] != APPLY)
                made.held[self._table["row"][own], 0] = integral
        first = system.nq + system.nu
        y[first:-1] = 0.0
        places = {name: self._place(feedback, name) for name in names[2 * n :]}
        base = np.array([(y if array is None else array)[place] for array, place in places.values()])
        for value, (array, place) in zip(base + x[2 * n :], places.values(), strict=True):
            (y if array is None else array)[place] = value
        times = np.unique([self._start, *self._table["time"][self._table["time"] >= self._start], end])
        slope = np.empty(len(y))
        for begin, stop in zip(times[:-1], times[1:], strict=True):
            assert loop.rhs(begin, y, slope, made, made) == 0  # the instants there
            middle = 0.5 * (begin + stop)

            def rhs(_: float, at: Real, middle: float = middle) -> Real:
                assert loop.rhs(middle, at, slope, made, made) == 0
                return slope.copy()

            y = solve_ivp(rhs, (begin, stop), y, "DOP853", rtol=3e-14, atol=1e-17).y[:, -1]
        moved = np.linalg.lstsq(self._motion, y[: system.nq] - rest.q, rcond=None)[0]
        last = [self._place(feedback, name, after=True) for name in names[2 * n :]]
        now = np.array([(y if array is None else array)[place] for array, place in last])
        return np.r_[moved, (y[system.nq : first] - rest.u)[free], now - base]

    def _place(self, feedback: Feedback, name: str, after: bool = False) -> tuple[Real | None, Any]:
        """The array and index of a state of controllers; None for y."""
        made, (law, _, kind) = feedback.running, name.partition(".")
        i = [controller.name for controller in feedback.controllers].index(law)
        row, numbers = made.controller[i], [int(part.rstrip("]")) for part in kind.split("[")[1:]]
        if kind.startswith("held"):
            return made.signal, row["signal"] + numbers[0]
        if kind.startswith("delayed"):
            edge = self._start + (self._model.period if after else 0.0)
            taken = self._table[(self._table["controller"] == i) & (self._table["kind"] != APPLY)]
            rows = taken["row"][taken["time"] < edge - 1e-9]
            return made.held, (rows[-numbers[0]], numbers[1])
        if row["sampled"]:
            return made.state, row["state"] + numbers[0]
        return None, feedback._plant.nq + feedback._plant.nu + row["x"] + numbers[0]
