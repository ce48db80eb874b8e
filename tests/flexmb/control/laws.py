"""Laws of a user's own, compiled and plain, that the tests name by module and function."""

from __future__ import annotations

from typing import Any

import numpy as np

import flexmb as fm


class Broken(RuntimeError):
    """What a plain law raises."""


@fm.user_function
def proportional(t: Any, inputs: Any, state: Any, parameters: Any, outputs: Any, change: Any) -> None:
    """outputs = - parameters . inputs."""
    total = 0.0
    for i in range(inputs.shape[0]):
        total += parameters[i] * inputs[i]
    outputs[0] = -total


def plainly_proportional(t: float, inputs: Any, state: Any, parameters: Any, outputs: Any, change: Any) -> None:
    """The same in Python."""
    outputs[0] = -float(np.dot(parameters, inputs))


@fm.user_function
def lagging(t: Any, inputs: Any, state: Any, parameters: Any, outputs: Any, change: Any) -> None:
    """A lag of time constant parameters[0] and gain parameters[1]."""
    change[0] = (inputs[0] - state[0]) / parameters[0]
    outputs[0] = parameters[1] * state[0]


def plainly_lagging(t: float, inputs: Any, state: Any, parameters: Any, outputs: Any, change: Any) -> None:
    """The same in Python."""
    change[0] = (inputs[0] - state[0]) / parameters[0]
    outputs[0] = parameters[1] * state[0]


@fm.user_function
def counting(t: Any, inputs: Any, state: Any, parameters: Any, outputs: Any, change: Any) -> None:
    """How often it was called."""
    change[0] = state[0] + 1.0
    outputs[0] = state[0]


@fm.user_function
def nonsense(t: Any, inputs: Any, state: Any, parameters: Any, outputs: Any, change: Any) -> None:
    """No number, from the second time on."""
    outputs[0] = 0.0 if t == 0.0 else np.nan


def late_failure(t: float, inputs: Any, state: Any, parameters: Any, outputs: Any, change: Any) -> None:
    """Raises after parameters[0] seconds."""
    outputs[0] = 0.0
    if t > parameters[0]:
        raise Broken(f"at {t:.3f} s")


def of_two(t: float, inputs: Any) -> None:
    """No law: it takes other arguments."""


@fm.user_function
def uncompilable(t: Any, inputs: Any, state: Any, parameters: Any, outputs: Any, change: Any) -> None:
    """Uses what numba does not know."""
    outputs[0] = len({}.fromkeys("nothing"))


@fm.user_function
def swinging(t: Any, inputs: Any, state: Any, parameters: Any, outputs: Any, change: Any) -> None:
    """A gain that swings with time, cubic in the input; its state follows the time."""
    outputs[0] = -parameters[0] * np.sin(2.0 * t) * inputs[0] ** 3 + state[0]
    change[0] = t * t - state[0]


def kinked(t: float, inputs: Any, state: Any, parameters: Any, outputs: Any, change: Any) -> None:
    """Another gain beyond 0.3."""
    outputs[0] = -inputs[0] if inputs[0] < parameters[0] else -5.0 * inputs[0] + 4.0 * parameters[0]
