"""The schedule of sampled controllers, a table of their instants in order of time; and the memory of controllers at the
end of a run, so that the run can be resumed there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexmb.control.tables import APPLY, INSTANT, SAMPLE
from flexmb.scene.control import Controller
from flexmb.typing import Real, Record


class LoopMemory(NamedTuple):
    """signal (S,) and state of all controllers, laid out as in `flexmb.control.tables.Loop`; held (rows,m): outputs of
    sampled controllers since t = 0; instants (1,): number of executed instants."""

    signal: Real
    state: Real
    held: Real
    instants: Real


MOST = 10_000_000
"""Largest number of instants in a run: their table takes 0.4 GB."""
TOGETHER = 1e-12  # relative to the run's time: closer instants are merged, since k * period is rounded


def slack(t_start: float, t_end: float) -> float:
    """Largest difference (s) of instants that are merged."""
    return TOGETHER * max(abs(t_start), abs(t_end))


def instants(controllers: Sequence[Controller], t_start: float, t_end: float, fixed: Sequence[float]) -> Record:
    """INSTANT records up to t_end (s), in order of time; one that coincides with a `fixed` time (s) takes that value.

    They are counted from t = 0, those before t_start (s) included, so that a run can be resumed. At equal times, held
    outputs are applied first, then controllers act in the order of the scene. Samples have rows from 0 in the order in
    which they are taken, so that a longer run has the same rows. ValueError for more than MOST.
    """
    parts = [_of_one(i, controller, t_end) for i, controller in enumerate(controllers) if controller.period_s]
    if not parts:
        return np.zeros(0, INSTANT)
    table = np.concatenate(parts)
    table["time"] = _together(table["time"], np.array([t_start, *fixed, t_end]), slack(t_start, t_end))
    table = table[table["time"] <= t_end]
    table = table[np.lexsort((table["controller"], table["kind"] == SAMPLE, table["time"]))]
    _number(table)
    return table


def _number(table: Record) -> None:
    """Number the samples of all controllers in order of time; an output takes the row of its sample."""
    sampled = table["kind"] == SAMPLE
    rows = np.cumsum(sampled) - 1
    for controller in np.unique(table["controller"]):
        own = table["controller"] == controller
        table["row"][own] = rows[own & sampled][table["row"][own]]


def _of_one(i: int, controller: Controller, t_end: float) -> Record:
    period = controller.period_s or np.inf
    number = max(0, int(np.floor((t_end - controller.offset_s) / period * (1.0 + TOGETHER))) + 1)
    if number > MOST:
        raise ValueError(
            f'controller "{controller.name}" would act {number} times in {t_end:g} s, and {MOST} are allowed: divide '
            "the run, give a longer period, or make the controller continuous"
        )
    table = np.zeros(number, INSTANT)
    table["time"], table["controller"] = controller.offset_s + period * np.arange(number), i
    table["kind"], table["row"], table["immediate"] = SAMPLE, np.arange(number), controller.delay_s == 0.0
    if controller.delay_s == 0.0:
        return table
    later = table.copy()
    later["time"] += controller.delay_s
    later["kind"] = APPLY
    return np.concatenate([table, later])


def _together(times: Real, fixed: Real, gap: float) -> Real:
    """Times in which those closer than a gap are merged: into a fixed time if there is one, else into the first."""
    every = np.concatenate([fixed, times])
    order = np.argsort(every, kind="stable")
    ascending, is_fixed = every[order], order < len(fixed)
    group = np.cumsum(np.diff(ascending, prepend=ascending[0]) > gap)
    chosen = ascending[np.searchsorted(group, np.arange(group[-1] + 1))]
    chosen[group[is_fixed]] = ascending[is_fixed]
    result = np.empty(len(every))
    result[order] = chosen[group]
    return result[len(fixed) :]


def with_instants(ends: Real, times: Real, t_end: float) -> Real:
    """Ends of segments for `Clock`, merged with the sampling instants up to t_end (s)."""
    equal_steps, inner = not np.isfinite(ends[-1]), times[times < t_end]
    is_end = len(inner) < len(times) or np.sum(ends == t_end) > (0 if equal_steps else 1)
    before = np.union1d(ends[ends < t_end], inner)
    last = [t_end] * bool(is_end) + [np.inf] if equal_steps else [t_end] + [t_end] * bool(is_end)
    return np.array([*before, *last])
