"""When sampled controllers act: their instants in one order, as a table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexmb.control.tables import APPLY, INSTANT, SAMPLE
from flexmb.scene.control import Controller
from flexmb.typing import Real, Record

MOST = 10_000_000
"""Instants of a run, at most: their table takes 0.4 GB."""
TOGETHER = 1e-12  # of the run's time: instants this close are one, for they differ by the rounding of k * period


def slack(t_start: float, t_end: float) -> float:
    """Instants this close (s) are one."""
    return TOGETHER * max(abs(t_start), abs(t_end))


def instants(controllers: Sequence[Controller], t_start: float, t_end: float, fixed: Sequence[float]) -> Record:
    """INSTANT records up to t_end (s), in time; where one comes together with a `fixed` time (s) it is that.

    They are counted from t = 0, those before t_start (s) included, so that a run can be taken up. Of one time, what was
    waiting is applied first, then controllers act in the order of the scene. Samples have rows from 0 in the order in
    which they are taken, so that a run that goes on farther finds the same ones. ValueError for more than MOST.
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
    """Rows of samples as they come, in place of those counted for each controller; outputs have their samples'."""
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
            f'controller "{controller.name}" would act {number} times in {t_end:g} s, and {MOST} are allowed: run the '
            "time in pieces, or make it continuous"
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
    """Times of which those that differ by a gap are the same: a fixed one where there is one, else the first."""
    every = np.concatenate([fixed, times])
    order = np.argsort(every, kind="stable")
    ascending, is_fixed = every[order], order < len(fixed)
    group = np.cumsum(np.diff(ascending, prepend=ascending[0]) > gap)
    chosen = ascending[np.searchsorted(group, np.arange(group[-1] + 1))]
    chosen[group[is_fixed]] = ascending[is_fixed]
    result = np.empty(len(every))
    result[order] = chosen[group]
    return result[len(fixed) :]
