"""The causes of all differences in a file: those of single channels, then those that concern the whole file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from crosscheck.verify.causes import offset_totals, possible_causes
from crosscheck.verify.clock import UNITS, find_shift
from crosscheck.verify.columns import Columns, TimesError, read_columns
from crosscheck.verify.evidence import Evidence
from crosscheck.verify.target import Target
from flexmb.typing import Real


def diagnose(differing: Mapping[str, Evidence], target: Target) -> dict[str, tuple[str, ...]]:
    """For each channel that differs its possible causes, none if nothing known makes it agree."""
    found = {channel: possible_causes(seen) for channel, seen in differing.items()}
    found |= {channel: (cause,) for channel, cause in offset_totals(differing, found).items()}
    open_ones = {channel: seen for channel, seen in differing.items() if not found[channel]}

    def reference_at(times: Real) -> dict[str, Real]:
        return {name: signal.values for name, signal in target.signals(times).items()}

    try:
        shift = find_shift(open_ones, reference_at, float(target.times[-1]))
    except ValueError:  # no route of the reference runs here
        shift = None
    if shift is not None:
        found |= dict.fromkeys(shift.channels, (shift.cause,))
    return found


def other_clock(file: Path, target: Target, agreeing: Callable[[Columns], tuple[int, int]]) -> str:
    """The unit of the file's times, in words, if with them in s channels that move agree; else "".

    `agreeing` counts these among all that move.
    """
    for unit, seconds in UNITS.items():
        try:
            columns = read_columns(file, target.times, seconds)
            if columns.times[-1] > 2.0 * target.times[-1]:
                continue
            count, moving = agreeing(columns)
        except (TimesError, LookupError):
            continue
        if count:
            said = f"the times are in {unit}: in seconds {count} of {moving} channels that move agree"
            return f"{said}; write them in s"
    return ""
