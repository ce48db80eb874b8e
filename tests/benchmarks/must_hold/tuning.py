"""The tuner: of a stated grid of settings of a code, the one that takes least time among those that err little enough.

Rows that compare codes at equal error use it for native and for the rival alike, so that nobody runs at settings that
its maintainers would not choose. The page shows the grid and the settings that were found. Charts of crosscheck are
tuned otherwise (`crosscheck.running.tuned`): there an error of a tenth of a target meets it, for which a method of
fourth order takes 1.8 times as long as it has to.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from tests.benchmarks.must_hold.row import Measured, RivalsDiffer, duration, measured
from tests.benchmarks.rivals import turns

ROUNDS = 5
FINAL = 4  # settings that are timed again in turns, after all were timed once


@dataclass(frozen=True)
class Setting:
    """A setting of one code with its error. An infinite error is that of a run which did not reach its end."""

    run: Callable[[], Any]
    label: str
    error: float


def up_to(level: float, settings: Iterable[Setting]) -> Iterator[Setting]:
    """The settings in the order given, up to the first that errs by `level` or less."""
    for setting in settings:
        yield setting
        if setting.error <= level:
            return


def fastest(settings: Sequence[Setting], level: float) -> Setting:
    """Of those that err by `level` or less. Raises RivalsDiffer where there is none."""
    good = [setting for setting in settings if setting.error <= level]
    if not good:
        raise RivalsDiffer(f"no setting errs by {level:g} or less")
    good = sorted(good, key=lambda each: _once(each.run))[:FINAL]
    return good[int(np.argmin(np.median(turns(*(each.run for each in good), rounds=3), axis=0)))]


def equal_error(native: Sequence[Setting], rival: Sequence[Setting], level: float) -> Measured:
    """Time of the rival over that of native, in turns, each at its fastest setting that errs by `level` or less."""
    mine, other = fastest(native, level), fastest(rival, level)
    times = turns(mine.run, other.run, rounds=ROUNDS)
    own, its = np.median(times, axis=0)
    detail = f"{duration(own)} ({mine.label}) against {duration(its)} ({other.label})"
    return measured(times[:, 1] / times[:, 0], detail)


def _once(run: Callable[[], Any]) -> float:
    start = process_time()
    run()
    return process_time() - start
