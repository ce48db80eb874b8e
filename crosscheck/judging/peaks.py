"""Extremes of all channels of the runs of a case: over all steps where the session has them, else of the samples."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from crosscheck.engines.extremes import ERROR, GREATEST, LEAST, T_GREATEST, T_LEAST, has_extremes, of_samples
from crosscheck.judging.results import CaseResults, Result
from crosscheck.records.kinds import ENVELOPE
from crosscheck.records.packing import unpack
from flexmb.typing import Real


@dataclass(frozen=True)
class PeakOfChannel:
    """Extremes (ROWS, k) of one channel of one engine on one variant; `over` what, in words.

    `is_whole`: over all steps and both sides of events, and not of the samples.
    """

    variant: str
    engine: str
    channel: str
    extremes: Real
    over: str
    is_whole: bool

    @property
    def whose(self) -> tuple[str, str]:
        """Variant and engine."""
        return self.variant, self.engine

    @property
    def _greatest(self) -> tuple[int, int]:
        """Row and column of the largest absolute value."""
        sizes = np.abs(self.extremes[[LEAST, GREATEST]])
        row, column = np.unravel_index(int(np.argmax(sizes)), sizes.shape)
        return (LEAST, GREATEST)[row], int(column)

    @property
    def size(self) -> float:
        """The largest magnitude, or absolute value of a channel without one (SI)."""
        return float(abs(self.extremes[self._greatest]))

    @property
    def t(self) -> float:
        """The time (s) of the largest magnitude."""
        row, column = self._greatest
        return float(self.extremes[T_LEAST if row == LEAST else T_GREATEST, column])

    @property
    def error(self) -> float:
        """By how much the largest magnitude may be exceeded; NaN where it is that of samples."""
        return float(self.extremes[ERROR, self._greatest[1]])


def has_envelopes(case: CaseResults) -> bool:
    """Whether envelopes of its runs were asked for."""
    return any(role == ENVELOPE for _, _, role in case.results)


def peaks(case: CaseResults, kinds: Collection[str] | None = None) -> Iterator[PeakOfChannel]:
    """Those of the finished main runs, by variant and engine in the order of the case; of all kinds of channels or of
    some. Channels with components that the motion does not determine have none, as no magnitude is known."""
    for variant in case.case.run.variants:
        for engine in variant.engines:
            result = case.get(variant.name, engine)
            if result.status == "finished":
                yield from _of(case, result, kinds)


def _of(case: CaseResults, result: Result, kinds: Collection[str] | None) -> Iterator[PeakOfChannel]:
    whose = result.variant, result.engine
    followed = case.results.get((*whose, ENVELOPE))
    same = followed is not None and followed.status == "finished" and followed.finest.scene == result.finest.scene
    whole = followed.finest.envelope if followed is not None and same else {}
    lost = "" if followed is None or same else f", as its envelope {followed.status}: {followed.message}"
    open_ = case.undetermined(result.variant)
    for channel in result.channels:
        wanted = kinds is None or channel.partition(":")[0] in kinds
        if not wanted or not has_extremes(channel) or channel in open_:
            continue
        if channel in whole:
            yield PeakOfChannel(*whose, channel, unpack(whole[channel]), "all steps", is_whole=True)
            continue
        found = of_samples(channel, result.times, result.values(channel))
        yield PeakOfChannel(*whose, channel, found, f"{len(result.times)} samples{lost}", is_whole=False)
