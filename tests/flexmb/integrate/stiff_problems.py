"""Stiff test problems with Jacobians by hand and closed forms; one kernel for all of them.

`constants.kind[0]` selects the problem, `constants.value` its parameters.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flexmb.integrate.control import COUNTS
from flexmb.integrate.memory import memory
from flexmb.integrate.problem import Accuracy, Clock, Linear, stiff_problem
from flexmb.integrate.watch import nothing_watched
from flexmb.jit.bundle import bundle
from flexmb.jit.kernel import kernel
from flexmb.tables.status import NOT_POSITIVE_DEFINITE, OK
from tests.flexmb.integrate.integration_problems import (
    BREAKDOWN_AT,
    CONE_ANGLE,
    CONE_RATE,
    SPIN_RATE,
    SWITCH_OFF,
    SWITCH_ON,
    Workspace,
    cone,
    normalise,
)

LINEAR, PROTHERO, KAPS, VAN_DER_POL, CONING, SPRING, BREAKDOWN, SWITCHED, DRIVEN, BLOW_UP, OSCILLATOR = range(11)


@bundle
class Constants:
    kind: np.ndarray
    value: np.ndarray  # (2,)


@kernel
def rhs(t, y, dy, constants, workspace):
    kind, a, b = constants.kind[0], constants.value[0], constants.value[1]
    if kind == LINEAR:  # eigenvalues a +- ib
        dy[0], dy[1] = a * y[0] - b * y[1], b * y[0] + a * y[1]
    elif kind == PROTHERO:  # y = sin t, whatever the rate a
        dy[0] = a * (y[0] - math.sin(t)) + math.cos(t)
    elif kind == KAPS:  # y = (exp -2t, exp -t), whatever the rate a
        dy[0] = -(a + 2.0) * y[0] + a * y[1] * y[1]
        dy[1] = y[0] - y[1] - y[1] * y[1]
    elif kind == VAN_DER_POL:
        dy[0], dy[1] = y[1], a * ((1.0 - y[0] * y[0]) * y[1] - y[0])
    elif kind == CONING:
        cone(t, y, dy)
    elif kind == SPRING:  # pendulum of unit mass and length on a spring of frequency a: stretch, angle, their rates
        r = 1.0 + y[0]
        dy[0], dy[1] = y[2], y[3]
        dy[2] = r * y[3] * y[3] - a * a * y[0] + b * math.cos(y[1])
        dy[3] = -(2.0 * y[2] * y[3] + b * math.sin(y[1])) / r
    elif kind == BREAKDOWN:
        dy[0] = 1.0
        if y[0] > BREAKDOWN_AT:
            workspace.fault[0] = 7
            return NOT_POSITIVE_DEFINITE
    elif kind == SWITCHED:
        dy[0] = 1.0 if SWITCH_ON <= t < SWITCH_OFF else 0.0
    elif kind == DRIVEN:  # oscillator of frequency a following sin t, and the work of its drive
        dy[0], dy[1] = y[1], a * a * (math.sin(t) - y[0])
        dy[2] = a * a * math.sin(t) * y[1]
    elif kind == BLOW_UP:
        dy[0] = y[0] * y[0]
    elif kind == OSCILLATOR:  # of frequency a and damping ratio b
        dy[0], dy[1] = y[1], -a * a * y[0] - 2.0 * a * b * y[1]
    return OK


@kernel
def jacobian(t, y, J, constants, workspace):
    kind, a = constants.kind[0], constants.value[0]
    for i in range(J.shape[0]):
        for j in range(J.shape[1]):
            J[i, j] = 0.0
    if kind == LINEAR:
        b = constants.value[1]
        J[0, 0], J[0, 1], J[1, 0], J[1, 1] = a, -b, b, a
    elif kind == PROTHERO:
        J[0, 0] = a
    elif kind == KAPS:
        J[0, 0], J[0, 1], J[1, 0], J[1, 1] = -(a + 2.0), 2.0 * a * y[1], 1.0, -1.0 - 2.0 * y[1]
    elif kind == VAN_DER_POL:
        J[0, 1], J[1, 0], J[1, 1] = 1.0, -a * (2.0 * y[0] * y[1] + 1.0), a * (1.0 - y[0] * y[0])
    elif kind == CONING:
        x = CONE_RATE * math.sin(CONE_ANGLE) * math.sin(SPIN_RATE * t)
        w = CONE_RATE * math.sin(CONE_ANGLE) * math.cos(SPIN_RATE * t)
        z = CONE_RATE * math.cos(CONE_ANGLE) + SPIN_RATE
        J[0, 1], J[0, 2], J[0, 3] = -0.5 * x, -0.5 * w, -0.5 * z
        J[1, 0], J[1, 2], J[1, 3] = 0.5 * x, 0.5 * z, -0.5 * w
        J[2, 0], J[2, 3], J[2, 1] = 0.5 * w, 0.5 * x, -0.5 * z
        J[3, 0], J[3, 1], J[3, 2] = 0.5 * z, 0.5 * w, -0.5 * x
    elif kind == SPRING:
        r, b = 1.0 + y[0], constants.value[1]
        J[0, 2] = J[1, 3] = 1.0
        J[2, 0], J[2, 1], J[2, 3] = y[3] * y[3] - a * a, -b * math.sin(y[1]), 2.0 * r * y[3]
        J[3, 0] = (2.0 * y[2] * y[3] + b * math.sin(y[1])) / (r * r)
        J[3, 1], J[3, 2], J[3, 3] = -b * math.cos(y[1]) / r, -2.0 * y[3] / r, -2.0 * y[2] / r
    elif kind == DRIVEN:
        J[0, 1], J[1, 0], J[2, 1] = 1.0, -a * a, a * a * math.sin(t)
    elif kind == BLOW_UP:
        J[0, 0] = 2.0 * y[0]
    elif kind == OSCILLATOR:
        J[0, 1], J[1, 0], J[1, 1] = 1.0, -a * a, -2.0 * a * constants.value[1]
    return OK


@kernel
def project(t, y, constants):
    if constants.kind[0] == CONING:
        normalise(y)


@kernel
def move(y, increment, result, constants):
    for i in range(increment.shape[0]):
        result[i] = y[i] + increment[i]


@kernel
def resolve(y, u, x, how, constants):
    pass


def coning(t: float) -> np.ndarray:
    """Closed form of CONING."""
    a, b, c = 0.5 * CONE_RATE * t, 0.5 * CONE_ANGLE, 0.5 * SPIN_RATE * t
    return np.array([
        math.cos(b) * math.cos(a + c), math.sin(b) * math.cos(a - c), math.sin(b) * math.sin(a - c),
        math.cos(b) * math.sin(a + c),
    ])  # fmt: skip


def data(kind: int, *value: float) -> tuple[Constants, Workspace]:
    return Constants(np.array([kind]), np.array([*value, 0.0, 0.0][:2])), Workspace(np.zeros(1, np.int64))


class Result(NamedTuple):
    """What an integration left behind; `states` (samples reached, n)."""

    status: int
    t: float
    last: np.ndarray
    states: np.ndarray
    evaluations: int
    accepted: int
    rejected: int
    jacobians: int
    factorisations: int
    fault: int


def solve(integrator, problem, y, times, rtol, atol, controlled, *, ends=None, max_steps=100_000, **more) -> Result:
    """Integrate `problem` = (constants, workspace) from y with an integrator; `more`: fields of `Accuracy`."""
    constants, workspace = problem
    equations = stiff_problem(rhs, project, constants, workspace, Linear(jacobian, move, resolve, constants, workspace))
    times, y = np.asarray(times, float), np.array(y, float)
    ends = np.array([times[-1]] if ends is None else ends, float)
    out, counts = np.full((len(times), len(y)), np.nan), np.zeros(COUNTS, np.int64)
    accuracy = Accuracy(rtol, atol, controlled, max_steps, **more)
    given = equations, y, Clock(times, ends), accuracy, out, counts, memory(len(y), len(y) + 3), nothing_watched()
    status, t = integrator(*given)
    evaluations, accepted, rejected, samples, _, jacobians, factorisations = map(int, counts)
    return Result(
        status, t, y, out[:samples], evaluations, accepted, rejected, jacobians, factorisations, int(workspace.fault[0])
    )
