"""Checks of a restart that do not depend on its scene: types, shapes, finite numbers, and ranges of values.

A restart may come from a damaged file or may have been altered, and kernels do not check what they are given.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexmb.control.memory import LoopMemory
from flexmb.integrate import memory as places
from flexmb.integrate.catalogue import integrator
from flexmb.integrate.memory import DONE, NUMBERS, STRETCH, TIME, Memory
from flexmb.tables import arguments
from flexmb.typing import Real

SWITCHES = ("TAKEN_UP", "RETRIED", "RENEW", "FRESH")
SIZES = ("STEP", "ERROR_BEFORE", "DONE", "FACTORED", "STEP_BEFORE")
MOST_STEPS = 2**53  # the largest count that a float represents exactly


def memory(method: Any, t: Any, given: Memory) -> tuple[float, Memory]:
    """Time (s) and memory of a method, copied; ValueError or TypeError for values that no run by it can have left."""
    chosen, t = integrator(method), arguments.number("t", t)
    y = _row("y", given.y)
    rows = len(y) + 3 if chosen.keeps_jacobian else 0
    found = Memory(
        _finite("numbers", given.numbers, (NUMBERS,)), _finite("y", y, y.shape),
        _finite("rows", given.rows, (rows, len(y))),
    )  # fmt: skip
    _refuse_other_numbers(found.numbers, t)
    return t, found


def controllers(given: LoopMemory) -> LoopMemory:
    """The memory of controllers, copied. Signals may be NaN, because sensors that no controller reads may give NaN."""
    state, held = _row("state", given.state), arguments.array("held", given.held)
    if held.ndim != 2:
        raise ValueError(f"held has the shape {held.shape}, but must have two dimensions, with one row per sample")
    happened = float(_finite("instants", given.instants, (1,))[0])
    if not 0.0 <= happened < MOST_STEPS or happened != int(happened):
        raise ValueError(f"instants is {happened:g}, but must be the number of times at which controllers have acted")
    return LoopMemory(
        _row("signal", given.signal).copy(), _finite("state", state, state.shape), _finite("held", held, held.shape),
        np.array([happened]),
    )  # fmt: skip


def _refuse_other_numbers(numbers: Real, t: float) -> None:
    """ValueError for values that no integrator leaves at the end t (s) of a run."""
    by_name = {name: numbers[getattr(places, name)] for name in (*SWITCHES, *SIZES)}
    for name, value in by_name.items():
        if name in SWITCHES and value not in (0.0, 1.0):
            raise ValueError(f"numbers[{name}] is {value:g}, but must be 0 or 1")
        if value < 0.0:
            raise ValueError(f"numbers[{name}] is {value:g}, but must not be negative")
    done = numbers[DONE]
    if done != np.floor(done) or done >= MOST_STEPS:
        raise ValueError(f"numbers[DONE] is {done:g}, but must be a number of steps")
    if not numbers[STRETCH] <= numbers[TIME] <= t:
        raise ValueError(
            f"numbers[STRETCH] is {numbers[STRETCH]:.17g} s, numbers[TIME] {numbers[TIME]:.17g} s and t "
            f"{t:.17g} s: these times must be in ascending order"
        )


def _row(name: str, values: Any) -> Real:
    found = arguments.array(name, values)
    if found.ndim != 1:
        raise ValueError(f"{name} has the shape {found.shape}, but must be a row of numbers")
    return found


def _finite(name: str, values: Any, shape: tuple[int, ...]) -> Real:
    """A copy of finite values of this shape; ValueError or TypeError for others."""
    return arguments.finite(name, arguments.shaped(name, values, shape)).copy()
