"""What is asked of every code in one panel of the chart, and what one run of a code under one setting came to."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from time import process_time
from typing import Any, NamedTuple

import numpy as np

Paths = np.ndarray  # positions (M,T,3) of M markers at T times, in m; of problems at rest T is 1

REPEATS = 3
SHORT_S = 0.3  # a run that takes longer is not repeated
LONG_S = 2.0  # and after one that takes longer than this, the same parts are not run with smaller steps
NONE = 0.1  # an error of this part of the length and more is no solution
WORTH = 0.9  # an error that is less than this part of another is worth a longer run
GAIN = 0.7  # smaller steps that leave more of the error than this part have shown what the parts can do


class Ladder(NamedTuple):
    """So many parts by one method: `rungs` solve the problem with ever smaller steps or tolerances.

    `read` makes paths of what they return, which takes no part in their time. Paths of another shape than the truth's,
    or not finite, are those of a failed run.
    """

    label: str
    rungs: Iterable[Callable[[], Any]]
    read: Callable[[Any], Paths]


class Point(NamedTuple):
    """What one run came to: its setting, seconds, and error as a part of the problem's length."""

    label: str
    seconds: float
    error: float


@dataclass(frozen=True)
class Problem:
    """`truth` gives the paths that all are compared with, and `source` says where it comes from."""

    name: str
    title: str
    length_m: float
    truth: Callable[[], Paths]
    source: str
    families: Mapping[str, Callable[[], Iterator[Ladder]]]

    @cached_property
    def true_paths(self) -> Paths:
        return self.truth()

    def error(self, found: Paths) -> float:
        """Largest distance of a marker over time from where it should be, over the length."""
        if found.shape != self.true_paths.shape or not np.all(np.isfinite(found)):
            return np.inf
        return float(np.linalg.norm(found - self.true_paths, axis=2).max() / self.length_m)

    def points(self, family: str) -> Iterator[Point]:
        """All runs of a family that came to their end."""
        for label, rungs, read in self.families[family]():
            best = np.inf
            for run in rungs:
                found, seconds = timed(run)
                error = self.error(read(found))
                if seconds < SHORT_S:
                    seconds = min(seconds, *(timed(run)[1] for _ in range(REPEATS)))
                if np.isfinite(error):
                    yield Point(label, seconds, error)
                if seconds > LONG_S or error > GAIN * best:
                    break
                best = error


def timed(run: Callable[[], Any]) -> tuple[Any, float]:
    """What a run returned, and its seconds: of the processor, as other work on the machine does not count."""
    start = process_time()
    found = run()
    return found, process_time() - start


def front(points: Iterable[Point]) -> list[Point]:
    """Those that no other point beats in both time and error, from the fastest to the most accurate; without those that
    are hardly more accurate than a faster one, and without those that are no solution."""
    kept: list[Point] = []
    for point in sorted(points, key=lambda each: (each.seconds, each.error)):
        if point.error < (WORTH * kept[-1].error if kept else NONE):
            kept.append(point)
    return kept
