"""Test problems behind the signature of a scene's right-hand side, with closed forms; one kernel for all of them.

`constants.kind[0]` selects the problem.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.special import ellipj

from flexmb.integrate.control import ACCEPTED, COUNTS, Interval, copy, derivative
from flexmb.integrate.dop853 import ExplicitStages, dop853, stages, state_at
from flexmb.integrate.dop853_tableau import STAGES, STAGES_DENSE
from flexmb.integrate.memory import memory
from flexmb.integrate.problem import Accuracy, Clock, Problem, problem
from flexmb.integrate.rk4 import rk4
from flexmb.integrate.watch import Ends, nothing_watched
from flexmb.jit.bundle import bundle
from flexmb.jit.kernel import helper, kernel
from flexmb.tables.status import NOT_POSITIVE_DEFINITE, OK

HARMONIC, KEPLER, CONING, TOP, BLOW_UP, BREAKDOWN, SWITCHED, POWER = range(8)

CONE_RATE, CONE_ANGLE, SPIN_RATE = 1.3, 0.7, -0.9  # q(t) = z(CONE_RATE t) * x(CONE_ANGLE) * z(SPIN_RATE t)
INERTIA = (1.0, 2.0, 3.0)
BREAKDOWN_AT = 0.5  # the problem's own "articulated inertia" fails where y passes this value
SWITCH_ON, SWITCH_OFF = 0.3, 0.8


@bundle
class Constants:
    kind: np.ndarray


@bundle
class Workspace:
    fault: np.ndarray


@helper
def cone(t, y, dy):
    """Quaternion rates of CONING."""
    x = CONE_RATE * math.sin(CONE_ANGLE) * math.sin(SPIN_RATE * t)
    w = CONE_RATE * math.sin(CONE_ANGLE) * math.cos(SPIN_RATE * t)
    z = CONE_RATE * math.cos(CONE_ANGLE) + SPIN_RATE
    dy[0] = 0.5 * (-y[1] * x - y[2] * w - y[3] * z)
    dy[1] = 0.5 * (y[0] * x + y[2] * z - y[3] * w)
    dy[2] = 0.5 * (y[0] * w + y[3] * x - y[1] * z)
    dy[3] = 0.5 * (y[0] * z + y[1] * w - y[2] * x)


@helper
def normalise(y):
    """The quaternion y, unit again."""
    norm = math.sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2 + y[3] ** 2)
    for i in range(4):
        y[i] /= norm


@kernel
def rhs(t, y, dy, constants, workspace):
    kind = constants.kind[0]
    if kind == HARMONIC:
        dy[0], dy[1] = y[1], -y[0]
    elif kind == KEPLER:
        r3 = math.hypot(y[0], y[1]) ** 3
        dy[0], dy[1], dy[2], dy[3] = y[2], y[3], -y[0] / r3, -y[1] / r3
    elif kind == CONING:
        cone(t, y, dy)
    elif kind == TOP:
        dy[0] = (INERTIA[1] - INERTIA[2]) / INERTIA[0] * y[1] * y[2]
        dy[1] = (INERTIA[2] - INERTIA[0]) / INERTIA[1] * y[2] * y[0]
        dy[2] = (INERTIA[0] - INERTIA[1]) / INERTIA[2] * y[0] * y[1]
    elif kind == BLOW_UP:
        dy[0] = y[0] * y[0]
    elif kind == BREAKDOWN:
        dy[0] = 1.0
        if y[0] > BREAKDOWN_AT:
            workspace.fault[0] = 7
            return NOT_POSITIVE_DEFINITE
    elif kind == SWITCHED:
        dy[0] = 1.0 if SWITCH_ON <= t < SWITCH_OFF else 0.0
    elif kind == POWER:  # harmonic motion driven by cos t at resonance, and the work of the drive
        dy[0], dy[1] = y[1], math.cos(t) - y[0]
        dy[2] = math.cos(t) * y[1]
    return OK


@kernel
def project(t, y, constants):
    if constants.kind[0] == CONING:
        normalise(y)


@kernel
def run_dop853_fixed(problem, y, t0, h, steps, x, ends, dense, counts):
    """`steps` equal steps of the 8th-order formula.

    ends (steps, n): the state after each; dense (steps, n): the interpolant at the fraction x of each.
    """
    n = y.shape[0]
    s, y_new = ExplicitStages(np.empty((STAGES_DENSE, n)), np.empty((7, n)), np.zeros(1, np.int64)), np.empty(n)
    derivative(problem, t0, y, s.k[0], counts)
    for j in range(steps):
        t = t0 + j * h
        step, s.has_interpolant[0] = Interval(t, t + h, math.inf), 0
        stages(problem, step, y, s.k, y_new, counts)
        problem.project(t + h, y_new, problem.constants)
        derivative(problem, t + h, y_new, s.k[STAGES], counts)
        state_at(problem, step, Ends(y, s.k[0], y_new, s.k[STAGES]), s, t + x * h, dense[j], (0, counts))
        copy(y_new, y)
        copy(y_new, ends[j])
        copy(s.k[STAGES], s.k[0])
        counts[ACCEPTED] += 1


def data(kind: int) -> tuple[Constants, Workspace]:
    return Constants(np.array([kind])), Workspace(np.zeros(1, np.int64))


def equations(kind: int) -> Problem:
    return problem(rhs, project, *data(kind))


class Result(NamedTuple):
    """What an integration left behind; `states` (samples reached, n)."""

    status: int
    t: float
    last: np.ndarray
    states: np.ndarray
    evaluations: int
    accepted: int
    rejected: int
    fault: int


def solve(kind: int, times, *, rtol=None, step=None, ends=None, controlled=None, max_steps=100_000) -> Result:
    """Integrate a problem from its exact initial state: DOP853 with rtol = atol, or RK4 with `step`."""
    constants, workspace = data(kind)
    of_kind = problem(rhs, project, constants, workspace)
    times, y = np.asarray(times, float), exact(kind, times[0])
    ends = np.array([times[-1]] if ends is None else ends, float)
    out, counts = np.full((len(times), len(y)), np.nan), np.zeros(COUNTS, np.int64)
    accuracy = Accuracy(rtol or 0.0, rtol or 0.0, controlled or len(y), max_steps, step or 0.0)
    status, t = (dop853 if step is None else rk4)(
        of_kind, y, Clock(times, ends), accuracy, out, counts, memory(len(y), 0), nothing_watched()
    )
    return Result(status, t, y, out[: counts[3]], *map(int, counts[:3]), int(workspace.fault[0]))


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Quaternion product, scalar first."""
    return np.r_[a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])]


def exact(kind: int, t: float) -> np.ndarray:
    """The closed-form solution; its value at 0 is the initial state."""
    if kind == HARMONIC:
        return np.array([math.cos(t), -math.sin(t)])
    if kind == KEPLER:  # eccentricity 0.5, period 2 pi, from periapsis
        anomaly = t
        for _ in range(50):
            anomaly -= (anomaly - 0.5 * math.sin(anomaly) - t) / (1.0 - 0.5 * math.cos(anomaly))
        c, s, b = math.cos(anomaly), math.sin(anomaly), math.sqrt(0.75)
        return np.array([c - 0.5, b * s, -s / (1.0 - 0.5 * c), b * c / (1.0 - 0.5 * c)])
    if kind == CONING:
        z = np.array([math.cos(CONE_RATE * t / 2), 0.0, 0.0, math.sin(CONE_RATE * t / 2)])
        x = np.array([math.cos(CONE_ANGLE / 2), math.sin(CONE_ANGLE / 2), 0.0, 0.0])
        spin = np.array([math.cos(SPIN_RATE * t / 2), 0.0, 0.0, math.sin(SPIN_RATE * t / 2)])
        return product(product(z, x), spin)
    if kind == TOP:  # Landau, Lifshitz, Mechanics, section 37, for M^2 > 2 E I2
        i1, i2, i3 = INERTIA
        energy2, momentum_squared = 1.0, 2.6  # 2E and M^2
        rate = math.sqrt((i3 - i2) * (momentum_squared - energy2 * i1) / (i1 * i2 * i3))
        modulus = (i2 - i1) * (energy2 * i3 - momentum_squared) / ((i3 - i2) * (momentum_squared - energy2 * i1))
        sn, cn, dn, _ = ellipj(rate * t, modulus)
        return np.array([
            math.sqrt((energy2 * i3 - momentum_squared) / (i1 * (i3 - i1))) * cn,
            math.sqrt((energy2 * i3 - momentum_squared) / (i2 * (i3 - i2))) * sn,
            math.sqrt((momentum_squared - energy2 * i1) / (i3 * (i3 - i1))) * dn,
        ])  # fmt: skip
    if kind == BLOW_UP:
        return np.array([1.0 / (1.0 - t)])
    if kind == BREAKDOWN:
        return np.array([t])
    if kind == SWITCHED:
        return np.array([min(max(t - SWITCH_ON, 0.0), SWITCH_OFF - SWITCH_ON)])
    if kind == POWER:  # y = t sin(t) / 2
        return np.array([
            t * math.sin(t) / 2, (math.sin(t) + t * math.cos(t)) / 2,
            -math.cos(2 * t) / 8 + 1 / 8 + t * t / 8 + t * math.sin(2 * t) / 8 + (math.cos(2 * t) - 1) / 16,
        ])  # fmt: skip
    raise ValueError(kind)
