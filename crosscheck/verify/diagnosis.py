"""The causes of all differences in a file: those of single channels, then those that concern the whole file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

from crosscheck.library.case_error import CaseError
from crosscheck.verify.causes import offset_totals, possible_causes
from crosscheck.verify.clock import UNITS, find_shift
from crosscheck.verify.columns import Columns, TimesError, VerifyError, read_columns
from crosscheck.verify.evidence import Evidence
from crosscheck.verify.points import MOMENTUM, about_mass_centre
from crosscheck.verify.target import Target
from flexmb.typing import Real


def diagnose(differing: Mapping[str, Evidence], target: Target) -> dict[str, tuple[str, ...]]:
    """For each channel that differs its possible causes, none if nothing known makes it agree."""
    causes = {channel: possible_causes(seen) for channel, seen in differing.items()}
    causes |= {channel: (cause,) for channel, cause in offset_totals(differing, causes).items()}

    def reference_at(times: Real) -> dict[str, Real]:
        return {name: signal.values for name, signal in target.signals(times).items()}

    with suppress(CaseError, VerifyError):  # no engine of the reference runs here: causes that need one stay unknown
        causes |= _by_runs(differing, causes, target, reference_at)
    return causes


def _by_runs(
    differing: Mapping[str, Evidence],
    found: Mapping[str, tuple[str, ...]],
    target: Target,
    reference_at: Callable[[Real], Mapping[str, Real]],
) -> dict[str, tuple[str, ...]]:
    """Causes that show only where the reference is taken at other times: a mass centre's path, and shifted times."""
    more: dict[str, tuple[str, ...]] = {}
    if MOMENTUM in differing and (cause := about_mass_centre(differing[MOMENTUM], target.mass, reference_at)):
        more[MOMENTUM] = (*found[MOMENTUM], cause)
    unexplained = {name: seen for name, seen in differing.items() if not found[name] and name not in more}
    shift = find_shift(unexplained, reference_at, float(target.times[-1]))
    return more if shift is None else more | dict.fromkeys(shift.channels, (shift.cause,))


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
        except TimesError:
            continue
        if count:
            said = f"the times are in {unit}: in seconds {count} of {moving} channels that move agree"
            return f"{said}; write them in s"
    return ""
