"""Peaks: the table of the largest loads on a case's page, and `envelope.csv` with the extremes of all channels."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from crosscheck.engines.extremes import components
from crosscheck.judging.peaks import PeakOfChannel, has_envelopes, peaks
from crosscheck.judging.results import CaseResults, Session
from flexmb.output.files import take_away, write_csv
from flexmb.run.channels import family, unit

FILE = "envelope.csv"
HEADER = (
    "case", "variant", "engine", "channel", "component", "unit", "least", "at [s]", "greatest", "at [s]", "error",
    "over",
)  # fmt: skip
LOADS = "load", "total_load", "wheel_load", "connector", "hinge_force", "drive"
MOST = 5  # of each kind of load that the table has, for a variant and an engine


class PeakRow(NamedTuple):
    """A row of the table; `error` is empty where nothing is known of it."""

    variant: str
    channel: str
    engine: str
    size: str
    t: str
    error: str
    over: str


def largest_loads(case: CaseResults) -> list[PeakRow]:
    """The largest loads of each kind, by variant and channel, engines below each other."""
    chosen: dict[tuple[str, str], None] = {}
    peak_loads = list(peaks(case, LOADS))
    kinds: dict[tuple[str, str, str], list[PeakOfChannel]] = {}
    for peak in peak_loads:
        kinds.setdefault((*peak.whose, family(peak.channel)), []).append(peak)
    for alike in kinds.values():
        for peak in sorted(alike, key=lambda peak_of_run: -peak_of_run.size)[:MOST]:
            if peak.size > 0.0:
                chosen[peak.variant, peak.channel] = None
    return [_row(peak) for key in chosen for peak in peak_loads if (peak.variant, peak.channel) == key]


def _row(peak: PeakOfChannel) -> PeakRow:
    error = f"{peak.error:.1e}" if peak.is_whole else ""
    size = f"{peak.size:.6g} {unit(peak.channel)}"
    return PeakRow(peak.variant, peak.channel, peak.engine, size, f"{peak.t:.6g} s", error, peak.over)


def write_envelope(session: Session, out: Path) -> None:
    """Write the extremes of all channels of sessions with envelopes; otherwise remove an earlier session's file."""
    cases = [case for case in session.cases if has_envelopes(case)]
    if not cases:
        take_away(out / FILE)
        return
    write_csv(out / FILE, HEADER, (row for case in cases for row in _rows(case)))


def _rows(case: CaseResults) -> Iterator[list[str | float]]:
    for peak in peaks(case):
        columns = peak.extremes.shape[1]
        for i, component in enumerate(components(peak.channel, columns)):
            numbers = [float(extreme) for extreme in peak.extremes[:, i]]
            names = [case.case.case, *peak.whose, peak.channel, component, unit(peak.channel)]
            yield [*names, *(numbers if peak.is_whole else [*numbers[:-1], ""]), peak.over]
