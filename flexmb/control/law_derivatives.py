"""Derivatives of continuous control laws at one state: of what they drive, and of the rates of their states. Those of
sampled ones: `flexmb.control.sampled_laws`.

The laws are evaluated in dual numbers (`flexmb.control.tables.LoopVariation`), and those of users by differences whose
error is checked (`flexmb.control.foreign_laws`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import NamedTuple, assert_never

import numpy as np

from flexmb.control import loop
from flexmb.control.feedback import Feedback
from flexmb.control.foreign_laws import ATTEMPTS, ROUNDING, SHORTER, SMOOTH, STEP
from flexmb.control.laws import FILTERED, INTEGRAL
from flexmb.control.tables import ADDRESSES, Loop, LoopVariation
from flexmb.control.variation import plain_laws
from flexmb.jit.duals import RATES
from flexmb.jit.wide_arrays import as_duals
from flexmb.scene.control import Controller, GainTable, Pid, Saturation, StateSpace, UserLaw
from flexmb.system.kinks import NotDifferentiableError, meets
from flexmb.tables.state import DynamicsError
from flexmb.tables.status import OK, Status
from flexmb.typing import Index, Real, Record


class LawDerivatives(NamedTuple):
    """Values (D+X,) of the D drives, then the rates of the X states of continuous controllers, with their derivatives:
    by the signals (D+X,S) of sensors, the states (D+X,X), and time (D+X,) with both held."""

    values: Real
    by_signal: Real
    by_state: Real
    by_time: Real


def law_derivatives(feedback: Feedback, t: float, y: Real, one_sided: bool = False) -> LawDerivatives:
    """At y = [q, u, x, work] in a run that has begun; the drives have their values there afterwards.

    DynamicsError where accelerations do not exist that sensors read, `NotDifferentiableError` where a law has a corner;
    `one_sided`: not at limits and points of tables, where the derivatives are those on one side.
    """
    made = feedback.running
    raise_status(feedback, loop.look(t, y, made.signal.copy(), made))
    values = _respond(feedback, t)
    if not one_sided:
        refuse_corners(feedback, sampled=False)
    sensors, states = int(np.sum(made.sensor["width"])), np.array(feedback.continuous_states, np.int64)
    derivatives = _by_duals(feedback, t, sensors, states)
    called = any(isinstance(controller, UserLaw) for controller in feedback.controllers)
    by_time = _by_time(feedback, t, values) if called else np.zeros(len(values))
    raise_status(feedback, loop.look(t, y, made.signal.copy(), made))  # leaves drives and outputs as they are at t
    _refuse_open(feedback, np.column_stack([derivatives, by_time]))
    return LawDerivatives(values, derivatives[:, :sensors], derivatives[:, sensors:], by_time)


def _by_duals(feedback: Feedback, t: float, sensors: int, states: Index) -> Real:
    """(D+X,S+X), seven columns at a time."""
    dual = dual_loop(feedback)
    read = [(dual.signal, i) for i in range(sensors)] + [(dual.state, int(i)) for i in states]

    def respond() -> Real:
        raise_status(feedback, loop.respond(t, dual))
        return np.vstack([dual.function["data"][feedback.driven, 0, 1:], dual.change[states, 1:]])

    return along(read, respond, len(feedback.driven) + len(states))


def dual_loop(feedback: Feedback) -> LoopVariation:
    """The running loop in dual numbers, apart from the motion: for its laws alone."""
    made = feedback.running
    arrays = {
        field.name: as_duals(getattr(made, field.name))
        for field in fields(LoopVariation)
        if field.name not in ("plain", "address")
    }
    return LoopVariation(plain=plain_laws(made), address=np.zeros(ADDRESSES, np.int64), **arrays)


def along(read: Sequence[tuple[Real, int]], evaluate: Callable[[], Real], rows: int) -> Real:
    """(rows, len(read)) derivatives by entries of arrays of duals, seven at a time; `evaluate` gives them by lane."""
    columns = [np.zeros((rows, 0))]
    for first in range(0, len(read), RATES):
        block = read[first : first + RATES]
        for lane, (array, i) in enumerate(block):
            array[i, 1 + lane] = 1.0
        columns.append(evaluate()[:, : len(block)])
        for lane, (array, i) in enumerate(block):
            array[i, 1 + lane] = 0.0
    return np.hstack(columns)


def _respond(feedback: Feedback, t: float) -> Real:
    """Drive values, then the rates of x, for the present signals of sensors."""
    made = feedback.running
    raise_status(feedback, loop.respond(t, made))
    return np.r_[made.function["data"][feedback.driven, 0], made.change[feedback.continuous_states]]


def _by_time(feedback: Feedback, t: float, values: Real) -> Real:
    """By the time that laws of users are given, by differences as `flexmb.control.foreign_laws` has them."""
    step = STEP * max(1.0, abs(t))
    for _ in range(ATTEMPTS):
        (coarse, bend), (fine, less_bend) = (_around(feedback, t, h, values) for h in (step, 0.5 * step))
        limit = SMOOTH * (np.abs(fine) + np.abs(coarse)) + ROUNDING * np.abs(values) / step
        smooth = np.abs(fine - coarse) <= limit
        if np.all(smooth & (np.abs(less_bend - 0.5 * bend) <= SMOOTH * np.abs(bend) + limit)):
            return np.asarray(fine + (fine - coarse) / 3.0)
        step *= SHORTER
    return np.full(len(values), np.nan)


def _around(feedback: Feedback, t: float, h: float, values: Real) -> tuple[Real, Real]:
    """Central differences over h, and by how much those after t exceed those before it."""
    ahead, behind = _respond(feedback, t + h) - values, values - _respond(feedback, t - h)
    return (ahead + behind) / (2.0 * h), (ahead - behind) / h


def raise_status(feedback: Feedback, status: int) -> None:
    """What a law of a user raised, else DynamicsError for a status that is not OK."""
    feedback.raise_trouble()
    if status != OK:
        raise DynamicsError(Status(status).advice.format(body="at this state"))


def refuse_corners(feedback: Feedback, sampled: bool) -> None:
    """NotDifferentiableError where a limit or a point of a table is just met, by what the laws have just read."""
    made = feedback.running
    for row, controller in zip(made.controller, feedback.controllers, strict=True):
        if row["sampled"] == sampled and _at_corner(controller, row, made):
            raise no_derivative(controller.name, "what it reads is exactly at a limit, or a point of a table")


def _at_corner(controller: Controller, row: Record, made: Loop) -> bool:
    read = made.input[row["input"] : row["input"] + row["inputs"]]
    match controller:
        case Saturation(lower=lower, upper=upper):
            return any(meets(x, limit, abs(limit)) for x in read for limit in (lower, upper))
        case Pid(lower=lower, upper=upper):
            wanted = asked(controller, row, made)
            return any(meets(wanted, limit, abs(limit)) for limit in (lower, upper) if limit is not None)
        case GainTable(points=points, values=values):
            slopes = [0.0, *np.diff(values) / np.diff(points), 0.0]
            return any(
                meets(read[0], point, abs(point)) and slopes[i] != slopes[i + 1] for i, point in enumerate(points)
            )
        case StateSpace() | UserLaw():
            return False
        case _:
            assert_never(controller)


def asked(pid: Pid, row: Record, made: Loop) -> float:
    """The output of a PID controller before it is limited: of a continuous one, or of one whose error rests."""
    read, state = made.input[row["input"] :], made.state[row["state"] :]
    error = (read[1] if row["inputs"] == 2 else pid.setpoint) - read[0]
    slope = (error - state[FILTERED]) / pid.filter_s if pid.filter_s > 0.0 else 0.0
    return float(pid.kp * error + state[INTEGRAL] + pid.kd * slope)


def _refuse_open(feedback: Feedback, found: Real) -> None:
    """NotDifferentiableError for a law whose differences do not converge, and are NaN."""
    made, drives = feedback.running, len(feedback.driven)
    for row, controller in zip(made.controller, feedback.controllers, strict=True):
        mine = (made.drive["signal"] >= row["signal"]) & (made.drive["signal"] < row["signal"] + row["outputs"])
        states = np.arange(row["states"]) + drives + row["x"]
        if not row["sampled"] and not np.isfinite(found[np.r_[np.flatnonzero(mine), states]]).all():
            raise no_derivative(controller.name, "it, or one that it reads, is no smooth function of what it reads")


def no_derivative(name: str, why: str) -> NotDifferentiableError:
    """That a controller has a corner at the state that was looked at."""
    return NotDifferentiableError(
        f'controller "{name}" has no derivative at this state: {why}. Derivatives exist on either side: move the state '
        "by a small amount"
    )
