"""Sampled control laws at one state of the motion: outputs and next states, and their derivatives by inputs and states.

The outputs are those that the laws give at that state again and again, with their own states held. The laws are
evaluated in dual numbers, and those of users by differences whose error is checked, as continuous ones are
(`flexmb.control.law_derivatives`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, assert_never

import numpy as np

from flexmb.control import loop
from flexmb.control.feedback import Feedback
from flexmb.control.law_derivatives import along, asked, dual_loop, no_derivative, raise_status, refuse_corners
from flexmb.control.laws import BEGUN, FILTERED
from flexmb.control.sampling import sample
from flexmb.control.tables import Loop
from flexmb.scene.control import Controller, GainTable, Pid, Saturation, StateSpace, UserLaw
from flexmb.system.kinks import NotDifferentiableError
from flexmb.typing import Index, Real, Record

ATTEMPTS = 64
SETTLED = 1e-12
"""Largest relative change of outputs that counts as none: of laws that read loads which they exert themselves."""


class SampledLaw(NamedTuple):
    """One law at the state: at a sample the outputs change by C ds + D du, and the next states by A ds + B du, with the
    states s and the inputs u, which are the signals `reads`; its outputs are the signals `signals`."""

    name: str
    reads: Index
    signals: Index
    outputs: Real
    A: Real
    B: Real
    C: Real
    D: Real
    saturated: bool


class LawsAtState(NamedTuple):
    """laws: the sampled ones in the order of the scene; signals (S,): values of all signals; by_sensor, by_state,
    by_held: derivatives of the continuous controllers' outputs by the sensors' signals, the states of continuous
    controllers, and the outputs of sampled ones, in rows of all signals (S,...)."""

    laws: tuple[SampledLaw, ...]
    signals: Real
    by_sensor: Real
    by_state: Real
    by_held: Real


def sampled_laws(feedback: Feedback, t: float, y: Real, states: Mapping[str, Real]) -> LawsAtState:
    """At y = [q, u, x, work] (n,) of a run that has begun. states: those of sampled controllers by name; one that is
    not there has its initial states, after one sample: it has no difference of errors.

    `NotDifferentiableError` where a law has a corner or no value, NotImplementedError where outputs do not settle.
    """
    _settle(feedback, t, y, states)
    refuse_corners(feedback, sampled=True)
    made = feedback.running
    dual, places = dual_loop(feedback), np.array(feedback.continuous_states, np.int64)
    sensors = int(np.sum(made.sensor["width"]))
    held = [int(i) for row in made.controller if row["sampled"] for i in _signals(row)]
    read = [(dual.signal, i) for i in range(sensors)] + [(dual.state, int(i)) for i in places]
    read += [(dual.signal, i) for i in held]

    def respond() -> Real:
        raise_status(feedback, loop.respond(t, dual))
        return dual.signal[:, 1:].copy()

    found = along(read, respond, len(made.signal))
    laws = []
    for i, (row, controller) in enumerate(zip(made.controller, feedback.controllers, strict=True)):
        mine = found[_signals(row)]
        if not row["sampled"] and not np.isfinite(mine).all():
            raise no_derivative(controller.name, _ROUGH)
        found[_signals(row)] = 0.0 if row["sampled"] else mine  # of sampled ones `by_held` is set by who reads it
        if row["sampled"]:
            laws.append(_of_one(feedback, t, i, row, controller))
    by_sensor, by_state, by_held = np.split(found, [sensors, sensors + len(places)], axis=1)
    by_sensor[:sensors] = 0.0
    return LawsAtState(tuple(laws), made.signal.copy(), by_sensor, by_state, by_held)


_ROUGH = "it, or one that it reads, is no smooth function of what it reads"


def _of_one(feedback: Feedback, t: float, i: int, row: Record, controller: Controller) -> SampledLaw:
    made, dual = feedback.running, dual_loop(feedback)
    outputs, own = _places(row, "output"), _places(row, "state")
    reads = np.unique(made.wire[row["input"] : row["input"] + row["inputs"]])

    def respond() -> Real:
        raise_status(feedback, sample(t, i, dual))
        return np.vstack([dual.change[own, 1:], dual.output[outputs, 1:]])

    n, read = len(own), [(dual.state, int(j)) for j in own]
    both = along([*read, *((dual.signal, int(j)) for j in reads)], respond, n + len(outputs))
    if not np.isfinite(both).all():
        raise no_derivative(controller.name, _ROUGH)
    return SampledLaw(
        controller.name, reads, _signals(row), made.signal[_signals(row)].copy(), both[:n, :n], both[:n, n:],
        both[n:, :n], both[n:, n:], _is_saturated(controller, row, made),
    )  # fmt: skip


def _signals(row: Record) -> Index:
    """Places of a controller's outputs among all signals."""
    return int(row["signal"]) + np.arange(int(row["outputs"]), dtype=np.int64)


def _places(row: Record, of: str) -> Index:
    """Places of a controller's outputs or states among those of all."""
    return int(row[of]) + np.arange(int(row[f"{of}s"]), dtype=np.int64)


def _settle(feedback: Feedback, t: float, y: Real, states: Mapping[str, Real]) -> None:
    """Let the sampled controllers act until their outputs stay: at once, but for those that read loads."""
    made = feedback.running
    sampled = [
        (i, row, controller)
        for i, (row, controller) in enumerate(zip(made.controller, feedback.controllers, strict=True))
        if row["sampled"]
    ]
    for _, row, controller in sampled:
        if controller.name in states:
            made.state[row["state"] : row["state"] + row["states"]] = states[controller.name]
    outputs = np.concatenate([np.zeros(0, np.int64), *(_signals(row) for _, row, _ in sampled)])
    for _ in range(ATTEMPTS):
        before = made.signal[outputs]
        raise_status(feedback, loop.look(t, y, made.signal.copy(), made))
        for i, row, controller in sampled:
            if isinstance(controller, Pid):
                made.state[row["state"] + BEGUN] = 0.0  # so that the previous error is the present one
            raise_status(feedback, sample(t, i, made))
            if isinstance(controller, Pid):
                made.state[row["state"] + FILTERED] = _error(controller, row, made)
                made.state[row["state"] + BEGUN] = 1.0
            given = made.output[row["output"] : row["output"] + row["outputs"]]
            if not np.isfinite(given).all():
                raise NotDifferentiableError(
                    f'controller "{controller.name}" puts out no number at this state: it may read a load that the '
                    "motion does not determine, because closures are redundant: let it read another one"
                )
            made.signal[_signals(row)] = given
        now = made.signal[outputs]
        if np.all(np.abs(now - before) <= SETTLED * (np.abs(now) + np.abs(before))):
            return
    raise NotImplementedError(
        "sampled controllers read accelerations or loads that they change themselves, and their outputs do not settle "
        "while the motion is held: filter what they read"
    )


def _error(pid: Pid, row: Record, made: Loop) -> float:
    read = made.input[row["input"] :]
    return float((read[1] if row["inputs"] == 2 else pid.setpoint) - read[0])


def _is_saturated(controller: Controller, row: Record, made: Loop) -> bool:
    """Whether an output is at a limit, so that nothing small changes it."""
    match controller:
        case Saturation(lower=lower, upper=upper):
            read = made.input[row["input"] : row["input"] + row["inputs"]]
            return bool(np.any((read < lower) | (read > upper)))
        case Pid(lower=lower, upper=upper):
            wanted = asked(controller, row, made)
            return (lower is not None and wanted < lower) or (upper is not None and wanted > upper)
        case StateSpace() | GainTable() | UserLaw():
            return False
        case _:
            assert_never(controller)
