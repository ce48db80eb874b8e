"""Loads as functions of time, which Exudyn evaluates in every iteration of every step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from crosscheck.engines.functions_of_time import Profile


def along_axis(f: Callable[[float], Profile], axis: Sequence[float]) -> Callable[[Any, float, Any], list[float]]:
    """The user function of a load f(t) along an axis (3,). Exudyn takes a list in half the time of an array."""
    x, y, z = map(float, axis)

    def load(mbs: Any, t: float, unit: Any) -> list[float]:
        value = f(t).value
        return [value * x, value * y, value * z]

    return load
