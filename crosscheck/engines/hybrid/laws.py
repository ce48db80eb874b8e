"""Control laws of a scene: outputs, rates of continuous states and next states of sampled ones."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, exp, inf, sin
from typing import Protocol, assert_never

import numpy as np

from flexmb.scene.schema import Controller, GainTable, Pid, Saturation, StateSpace, UserLaw
from flexmb.typing import Real

Numbers = list[float]
NONE = np.zeros(0)


class Law(Protocol):
    """A law of inputs u and states x. A continuous one has the rates of its states in `change`, a sampled one their
    next values."""

    def start(self, u: Numbers) -> Real:
        """States before the first evaluation, whose inputs are u."""

    def outputs(self, u: Numbers, x: Real) -> Numbers: ...

    def change(self, u: Numbers, x: Real) -> Real: ...


class _Stateless:
    """y = f(u)."""

    def __init__(self, function: Callable[[Numbers], Numbers]) -> None:
        self._function = function

    def start(self, u: Numbers) -> Real:
        return NONE

    def outputs(self, u: Numbers, x: Real) -> Numbers:
        return self._function(u)

    def change(self, u: Numbers, x: Real) -> Real:
        return NONE


class _Linear:
    """y = C x + D u; A x + B u is the rate of x, or its next value."""

    def __init__(self, law: StateSpace) -> None:
        self._A, self._B, self._C = (np.array(matrix, dtype=float) for matrix in (law.A, law.B, law.C))
        rows, columns = len(law.C), len(law.B[0])
        self._D = np.array(law.D, dtype=float) if law.D else np.zeros((rows, columns))
        self._initial = np.array(law.initial or np.zeros(len(law.A)), dtype=float)

    def start(self, u: Numbers) -> Real:
        return self._initial.copy()

    def outputs(self, u: Numbers, x: Real) -> Numbers:
        outputs: Numbers = (self._C @ x + self._D @ u).tolist()
        return outputs

    def change(self, u: Numbers, x: Real) -> Real:
        return np.asarray(self._A @ x + self._B @ u)


class _Regulator:
    """A PID with the states [integral part; filtered or previous error]."""

    def __init__(self, law: Pid) -> None:
        self._law = law
        self._lower = -inf if law.lower is None else law.lower
        self._upper = inf if law.upper is None else law.upper
        self._untwist = 0.0  # 1/s: how fast the integral part follows a limit
        if law.ki and (law.lower is not None or law.upper is not None):
            self._untwist = 1.0 / law.tracking_s if law.tracking_s else law.ki / law.kp

    def start(self, u: Numbers) -> Real:
        return np.array([0.0, self._error(u)])

    def outputs(self, u: Numbers, x: Real) -> Numbers:
        return [self._limited(self._asked(u, x))]

    def change(self, u: Numbers, x: Real) -> Real:
        law, error, asked = self._law, self._error(u), self._asked(u, x)
        growth = law.ki * error + self._untwist * (self._limited(asked) - asked)
        if law.period_s is None:
            return np.array([growth, (error - x[1]) / law.filter_s if law.filter_s else 0.0])
        kept = exp(-law.period_s / law.filter_s) if law.filter_s else 0.0
        return np.array([x[0] + law.period_s * growth, error + kept * (x[1] - error)])

    def _error(self, u: Numbers) -> float:
        return (u[1] if len(u) > 1 else self._law.setpoint) - u[0]

    def _asked(self, u: Numbers, x: Real) -> float:
        law, error = self._law, self._error(u)
        over = law.filter_s or law.period_s
        slope = law.kd * (error - x[1]) / over if law.kd and over else 0.0
        return float(law.kp * error + x[0] + slope)

    def _limited(self, asked: float) -> float:
        return min(max(asked, self._lower), self._upper)


def eigenaxis(parameters: tuple[float, ...]) -> Callable[[Numbers], Numbers]:
    """Torques -2 k e - d (w - rate n) of a slew about n: e is the vector of the shorter error quaternion.

    Inputs: orientation (4), angular velocity w in body axes (3), angle and rate of the slew; parameters n, k and d (3
    each). The body's orientation is R(n, angle) after the error.
    """
    n, k, d = np.reshape(parameters, (3, 3))

    def torques(u: Numbers) -> Numbers:
        scalar, vector, w = u[0], np.array(u[1:4]), np.array(u[4:7])
        c, s = cos(0.5 * u[7]), sin(0.5 * u[7])
        of_error = c * scalar + s * (n @ vector)
        error = c * vector - s * (scalar * n + np.cross(n, vector))
        if of_error < 0.0:
            error = -error
        outputs: Numbers = (-2.0 * k * error - d * (w - u[8] * n)).tolist()
        return outputs

    return torques


WRITTEN = {"flexmb.control.attitude:eigenaxis_slew": eigenaxis}
"""Laws of functions that a scene may name, written once more."""


def law_of(controller: Controller) -> Law:
    """The law; NotImplementedError for a function that `hybrid.refusals` refuses."""
    match controller:
        case StateSpace():
            if controller.A:
                return _Linear(controller)
            D = np.array(controller.D, dtype=float)
            return _Stateless(lambda u: [float(y) for y in D @ u])
        case Pid():
            return _Regulator(controller)
        case Saturation(lower=lower, upper=upper):
            return _Stateless(lambda u: [min(max(each, lower), upper) for each in u])
        case GainTable(points=points, values=values):
            return _Stateless(_table(points, values))
        case UserLaw(function=function, parameters=parameters):
            if function not in WRITTEN:
                raise NotImplementedError(f'"{function}", which `refusal` refuses, has reached the loop')
            return _Stateless(WRITTEN[function](parameters))
        case _:
            assert_never(controller)


def _table(points: tuple[float, ...], values: tuple[float, ...]) -> Callable[[Numbers], Numbers]:
    def outputs(u: Numbers) -> Numbers:
        gain = float(np.interp(u[0], points, values))
        return [gain * each for each in u[1:]] if len(u) > 1 else [gain]

    return outputs
