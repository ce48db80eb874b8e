"""Possible causes why a signal differs: a correction is a cause only if the corrected signal agrees.

The corrections tried: a factor (millimetres, degrees, revolutions, a sign), components exchanged, another order or
sense of quaternions, the axes of a body instead of the World's, another origin, another zero of an energy, moments
about another point (`points`), rows shifted by whole samples. Times in another unit and times shifted by any interval
concern the whole file: `clock`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from itertools import permutations
from pathlib import Path

import numpy as np

from crosscheck.library.case_error import CaseError
from crosscheck.verify.clock import UNITS, find_shift
from crosscheck.verify.columns import Columns, TimesError, VerifyError, read_columns
from crosscheck.verify.evidence import VISIBLE, Evidence, turned
from crosscheck.verify.points import MOMENTUM, about_mass_centre, about_other_points
from crosscheck.verify.target import Target
from flexmb.run.channels import distance, signal_range
from flexmb.typing import Real

FACTORS = {
    "1000 times too large: thousandths of the unit (mm, say)": 1e-3,
    "1000 times too small: thousands of the unit (km, kN, say)": 1e3,
    "180/pi times too large: degrees instead of radians": np.pi / 180.0,
    "pi/180 times too small: multiplied by pi/180 once too often": 180.0 / np.pi,
    "of the wrong sign": -1.0,
}
OF_TURNING = {
    "30/pi times too large: revolutions per minute instead of rad/s": np.pi / 30.0,
    "2 pi times too small: revolutions per second instead of rad/s": 2.0 * np.pi,
}
AXES = "xyz"
SHIFTS = (1, -1, 2, -2, 3, -3)  # samples
POTENTIALS = ("energy.gravity", "energy.spring", "energy.strain")


def possible_causes(seen: Evidence) -> tuple[str, ...]:
    """The possible faults of the values, in words, each of which makes them agree once it is put right."""
    causes = [*_by_corrections(seen), *about_other_points(seen)]
    return tuple(dict.fromkeys(causes)) or tuple(_shifts(seen))


def offset_totals(differing: Mapping[str, Evidence], found: Mapping[str, tuple[str, ...]]) -> dict[str, str]:
    """A cause for a constant energy, such as the total: it is off by the same constant as a potential energy is.

    By itself a constant that is off by a constant says nothing.
    """
    named: dict[str, str] = {}
    for channel, seen in differing.items():
        for kind in POTENTIALS:
            if channel.startswith("energy.") and not found.get(channel) and any(found.get(kind, ())):
                offset = _energy_offset(differing[kind])
                if differing[kind].agrees(differing[kind].values - offset) and seen.agrees(seen.values - offset):
                    named[channel] = f"the energy is off by the same {offset:.6g} J as {kind} is"
    return named


def _by_corrections(seen: Evidence) -> Iterator[str]:
    if not seen.is_visible:
        return
    if seen.channel.endswith(".orientation"):
        yield from (words for words, corrected in _turnings(seen.values) if seen.agrees(corrected))
        return
    whole = [words for words, corrected in _scalings(seen) if seen.agrees(corrected)]
    yield from whole
    for words, corrected in _corrections(seen, components=not whole):
        if seen.agrees(corrected):
            yield words


def _turnings(values: Real) -> Iterator[tuple[str, Real]]:
    conjugate = np.array([1.0, -1.0, -1.0, -1.0])
    scalar_first = np.roll(values, 1, axis=1)
    yield "the quaternions are conjugate: they have to map body components to World components", values * conjugate
    yield "the quaternions are scalar-last: the order is w, x, y, z", scalar_first
    yield "the quaternions are scalar-last and conjugate", scalar_first * conjugate


def _factors(seen: Evidence) -> dict[str, float]:
    return FACTORS | OF_TURNING if seen.channel.endswith(".angular_velocity") else FACTORS


def _scalings(seen: Evidence) -> Iterator[tuple[str, Real]]:
    for words, factor in _factors(seen).items():
        side = ": the load on the inboard body instead of that on the outboard body?"
        yield f"the values are {words}{side if seen.is_load and factor < 0.0 else ''}", factor * seen.values


def _corrections(seen: Evidence, components: bool) -> Iterator[tuple[str, Real]]:
    """Corrections other than a factor; those of single `components` say nothing more where one of the whole agrees."""
    if seen.channel.startswith("energy.") and seen.varies:
        offset = _energy_offset(seen)
        yield f"the energy is off by a constant, {offset:.6g} J: its zero is elsewhere?", seen.values - offset
    if seen.values.shape[1] != len(AXES):
        return
    if components:
        for words, factor in _factors(seen).items():
            for i, axis in enumerate(AXES):
                yield f"component {axis} is {words}", seen.values * np.where(np.arange(3) == i, factor, 1.0)
    for order in permutations(range(3)):
        if order != (0, 1, 2):
            given = ", ".join(AXES[order.index(i)] for i in range(3))
            yield f"the components are in the order {given}", seen.values[:, order]
    if seen.channel.endswith(".position"):
        offset = seen.values[0] - seen.reference[0]
        off = ", ".join(f"{x:.6g}" for x in offset)
        yield f"the origin is another one, off by ({off}) m", seen.values - offset
        return
    for marker, orientation in seen.markers("orientation").items():
        if seen.is_load or marker == seen.item:
            yield f'the components are in the axes of "{marker}", not in World axes', turned(orientation, seen.values)


def _energy_offset(seen: Evidence) -> float:
    """The middle of the differences (J), which is the constant that leaves the least."""
    apart = seen.values - seen.reference
    return float(0.5 * (np.max(apart) + np.min(apart)))


def _shifts(seen: Evidence) -> Iterator[str]:
    """Rows shifted by some samples, compared where both have samples."""
    for shift in SHIFTS:
        if abs(shift) + 2 > len(seen.values):
            continue
        late, early = (seen.values, seen.reference) if shift > 0 else (seen.reference, seen.values)
        early = early[: -abs(shift)]
        apart = distance(seen.channel, late[abs(shift) :], early)
        moving = signal_range(seen.channel, early) > VISIBLE * seen.allowed
        if seen.is_visible and moving and np.all(apart <= seen.allowed):
            samples = "sample" if abs(shift) == 1 else f"{abs(shift)} samples"
            yield f"the values are {'a ' if abs(shift) == 1 else ''}{samples} too {'late' if shift > 0 else 'early'}"
            return


# The causes of all differences in a file: those of single channels, then those that concern the whole file.


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
