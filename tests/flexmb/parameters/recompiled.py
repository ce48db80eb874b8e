"""Derivatives of whole systems that are compiled anew for other numbers, by extrapolated differences."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import numpy as np

import flexmb
from flexmb.scene.values import with_values

LEVELS = 6


def floats(node: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, float]]:
    """(path, value) of every real number in a part of a scene."""
    if isinstance(node, msgspec.Struct):
        for name in node.__struct_fields__:
            yield from floats(getattr(node, name), (*path, name))
    elif isinstance(node, tuple):
        for i, each in enumerate(node):
            yield from floats(each, (*path, str(i)))
    elif isinstance(node, float):
        yield ".".join(path), node


def extrapolated(f: Callable[[float], np.ndarray], h: float) -> tuple[np.ndarray, float]:
    """Richardson's table of (f(h) - f(-h)) / 2h: the entry that changes least from its neighbour, and this change with
    the rounding of f, which third differences at tiny steps show, over the smallest step."""
    table = [[(f(h / 2**i) - f(-h / 2**i)) / (2.0 * h / 2**i)] for i in range(LEVELS)]
    best, doubt = table[0][0], np.inf
    for i in range(1, LEVELS):
        for k in range(1, i + 1):
            table[i].append(table[i][k - 1] + (table[i][k - 1] - table[i - 1][k - 1]) / (4.0**k - 1.0))
            change = float(np.max(np.abs(table[i][k] - table[i][k - 1])))
            if change < doubt:
                best, doubt = table[i][k], change
    tiny = 2.0**-30 * h
    rounding = f(3.0 * tiny) - 3.0 * f(2.0 * tiny) + 3.0 * f(tiny) - f(0.0)
    return best, doubt + float(np.max(np.abs(rounding))) * 2**LEVELS / h


def accelerations(scene: flexmb.Scene, state: flexmb.State, name: str, size: float) -> tuple[np.ndarray, float]:
    """d udot/dp of recompiled trees, and the doubt of it; size: of the number."""
    value = float(dict(floats(scene))[name])

    def at(change: float) -> np.ndarray:
        return flexmb.System(with_values(scene, {name: value + change})).accelerations(state)

    return extrapolated(at, 2.0**-5 * size)
