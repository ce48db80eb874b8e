"""Ladders of efforts with more efforts than an engine or a case gives them, and the targets of charts."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Literal

TARGETS = tuple(float(f"1e-{digits}") for digits in range(1, 10))  # errors for which charts have an effort
WITHIN = 10.0  # factor between a target and the smallest error that meets it
TIGHTEST = 1e-13  # relative tolerance: one more decade is below 100 eps, where methods take rounding for an error


def is_met(error: float, target: float) -> bool:
    """Whether a run with this error is as accurate as the target, and at most ten times more so."""
    return target / WITHIN < error <= target


def on_front(runs: Sequence[tuple[float, float]], floor: float) -> list[bool]:
    """Of runs by seconds and error whether no faster one is as accurate; errors below the `floor` count as equal, and
    an infinite error is none."""
    best, smallest = [False] * len(runs), inf
    for run in sorted(range(len(runs)), key=lambda run: runs[run]):
        error = max(runs[run][1], floor)
        if error < smallest:
            best[run], smallest = True, error
    return best


def with_extra(values: Sequence[float], extra: Sequence[float]) -> tuple[float, ...]:
    """The values of a ladder with others in their places, from coarse to fine."""
    return tuple(sorted({*values, *extra}, reverse=True)) if extra else tuple(values)


def continued(kind: Literal["tolerance", "step"], values: Sequence[float], count: int) -> tuple[float, ...]:
    """The next `count` values of a ladder in the ratio of its last two; fewer where tolerances end at `TIGHTEST`.

    A ladder of one value is continued by halves, or tenths of a tolerance.
    """
    if not values:
        return ()
    usual = 0.1 if kind == "tolerance" else 0.5
    ratio = values[-1] / values[-2] if len(values) > 1 and 0.0 < values[-1] < values[-2] else usual
    least = min(TIGHTEST, values[-1]) if kind == "tolerance" else 0.0
    next_ones = (float(f"{max(values[-1] * ratio**n, least):.6g}") for n in range(1, count + 1))
    return tuple(dict.fromkeys(value for value in next_ones if value < values[-1]))
