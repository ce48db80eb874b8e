"""Compiled kernels in extended precision: their own source, interpreted with numpy's long doubles.

Where these have 64 bits of mantissa, eleven more than doubles, an evaluation is right to three digits more.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexmb import System
from flexmb.entry import articulated
from flexmb.jit.counting import Interpreter, _counting
from flexmb.tables.state import State, pack

BITS = np.finfo(np.longdouble).nmant


def accelerations(system: System, state: State) -> NDArray[np.longdouble]:
    """udot (nu,) by the recursion, from the same constants and state."""
    c, w = system.constants, system.workspace()
    arguments = [_counting(each, np.longdouble) for each in (state.t, pack(state), c, w)]
    with np.errstate(all="ignore"):
        status = Interpreter(_Functions)(articulated.accelerations)(*arguments)
    if status != 0:
        raise ArithmeticError(f"status {status}")
    return np.array([speed.acceleration for speed in arguments[3].speed])


class _Functions:
    """Of long doubles, by those of `math`."""

    square_root = staticmethod(np.sqrt)

    @staticmethod
    def elementary(function: Callable[..., float]) -> Callable[..., Any]:
        names = {math.atan2: "arctan2", math.acos: "arccos", math.asin: "arcsin", math.atan: "arctan"}
        return getattr(np, names.get(function, function.__name__))
