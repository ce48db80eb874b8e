"""Columns of a CSV as channels: named as `crosscheck verify` requires, or as in a `trajectory.csv`."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from crosscheck.judging.against_reference import CLOCK, shared_times
from crosscheck.library.case import CaseError
from crosscheck.library.channels import KINDS, LINEAR_KINDS, kind_named, part_of
from crosscheck.library.reference import channels_by_column
from flexmb.output.files import NUMBER, from_text
from flexmb.scene.reading import MIB, Unreadable, read_text
from flexmb.typing import Real

MARKER_GROUPS = {part.name: part.letters for part in kind_named("marker").parts}
LOAD_GROUPS = {part.name: part.letters for part in kind_named("load").parts}
# The channels of Trajectory.to_csv that are compared: kind and part by the names of the columns.
OWN_GROUPS = {part.own: (kind, part) for kind in ("marker", "load") for part in kind_named(kind).parts}
OWN_HEADER = re.compile(r"(.+) \[([^\]]*)\]")
STORED = ("marker:", "load:", "total_load:", "wheel_load:", "drive:")  # prefixes of items' channels in a reference.csv
DRIVE = "drive"
LIMIT = 128 * MIB
FEWEST = 8  # fewest samples at times of its own: fewer say too little about a motion
DECIMAL_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+([eE][-+]?[0-9]+)?")
SEPARATORS = {";": "semicolons", "\t": "tabs"}


class VerifyError(ValueError):
    """A CSV or a request that cannot be compared; the message says what to change."""


class TimesError(VerifyError):
    """The times of a CSV do not fit; the numbers can be read all the same."""


@dataclass(frozen=True)
class Columns:
    """Channels (T, k) of a CSV at its `times` (T,) s.

    `own`: it is a complete trajectory.csv of flexmb or a reference.csv, and `left_out` are its other columns.
    """

    channels: dict[str, Real]
    own: bool = False
    left_out: tuple[str, ...] = ()
    times: Real = field(default_factory=lambda: np.zeros(0))

    def at(self, places: np.ndarray) -> Columns:
        """Those of its samples."""
        return replace(
            self, channels={name: rows[places] for name, rows in self.channels.items()}, times=self.times[places]
        )


def read_columns(file: Path, times: Real, clock: float = 1.0) -> Columns:
    """Channels of a CSV at its own times; groups such as tip.px, tip.py, tip.pz must be whole.

    They must rise, and contain the case's `times` (T,) s or cover them. `clock` is the unit of its times, in s.
    VerifyError names file, line, column and remedy.
    """
    try:
        header, numbers, rows = _rows(read_text(file, LIMIT))
    except OSError as error:
        raise VerifyError(f"{file} cannot be read: {error.strerror}") from None
    except Unreadable as error:
        raise VerifyError(f"{file} cannot be read: {error}") from None
    except VerifyError as error:
        raise VerifyError(f"{file} cannot be read as a CSV of numbers with one header line: {error}") from None
    try:
        return _columns(header, numbers, rows, times, clock)
    except VerifyError as error:
        raise type(error)(f"{file}: {error}") from None


def short_names(channel: str, width: int) -> list[str]:
    """The names of a channel's columns: "tip.px", "elbow.tz", "elbow.drive", "momentum.linear.x"."""
    kind, _, named = channel.partition(":")
    if kind == "drive":
        return [f"{named}.{DRIVE}"] if width == 1 else [f"{named}.{DRIVE}.{i}" for i in range(width)]
    part = part_of(channel)
    if named and part is not None:
        return [f"{named.rpartition('.')[0]}.{letter}" for letter in part.letters]
    return [channel] if width == 1 else [f"{channel}.{letter}" for letter in "xyz"]


def _rows(text: str) -> tuple[list[str], list[int], Real]:
    """Names of the columns, line numbers of the rows, and the numbers (rows, columns); an empty cell is NaN."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    numbers: list[int] = []
    rows: list[Real] = []
    try:
        header = next((row for row in reader if any(row)), None)
        if header is None:
            raise VerifyError("it is empty: begin with a line of column names")
        names = [from_text(name.strip()) for name in header]
        if len(names) == 1:
            for separator, word in SEPARATORS.items():
                if separator in names[0]:
                    advice = "write commas between columns and points in numbers (no decimal comma)"
                    raise VerifyError(f"line {reader.line_num}: columns are separated by {word}: {advice}")
        for row in reader:
            if any(cell.strip() for cell in row):
                numbers.append(reader.line_num)
                rows.append(_numbers(row, names, reader.line_num))
    except csv.Error as error:
        raise VerifyError(f"line {reader.line_num}: {error}: correct the quotes and the length of that line") from None
    return names, numbers, np.array(rows).reshape(len(rows), len(names))


def _numbers(row: list[str], names: Sequence[str], line: int) -> Real:
    if len(row) != len(names):
        hint = " (is it a decimal comma? write a point)" if len(row) > len(names) else ""
        what = f"line {line} has {len(row)} cells, the header has {len(names)}"
        raise VerifyError(f"{what}: give each column one cell{hint}")
    return np.array([_number(cell.strip(), name, line) for cell, name in zip(row, names, strict=True)])


def _number(cell: str, name: str, line: int) -> float:
    if NUMBER.fullmatch(cell) and math.isfinite(value := float(cell)):
        return value
    if not cell:
        return math.nan
    where, shown = f"line {line}, column {name!r:.60}", f"{cell!r:.40}"
    if DECIMAL_COMMA.fullmatch(cell):
        raise VerifyError(f"{where}: {shown} has a decimal comma: write a point")
    if cell.lower().lstrip("+-") in ("nan", "inf", "infinity") or NUMBER.fullmatch(cell):
        raise VerifyError(f"{where}: {shown} is not finite: give numbers that can be compared, or leave the column out")
    raise VerifyError(f"{where}: {shown} is not a number: write it like -1.25e-3")


def _columns(header: list[str], numbers: list[int], rows: Real, times: Real, clock: float) -> Columns:
    places: dict[str, int] = {}
    for number, name in enumerate(header, start=1):
        if name and name in places:
            raise VerifyError(f'columns {places[name]} and {number} are both called "{name}": keep one of them')
        places[name] = number
    own, stored = OWN_HEADER.fullmatch(header[0]) is not None, any(name.startswith(STORED) for name in header)
    if header[0] not in ("t", "t [s]"):
        raise VerifyError(f'the first column must be "t"; it is "{header[0]}"')
    given = clock * rows[:, 0]
    _check_times(numbers, given, times)
    filled = {}
    for name, values in zip(header[1:], rows.T[1:], strict=True):
        empty = np.isnan(values)
        if np.all(empty):
            continue
        if np.any(empty):
            line = numbers[int(np.argmax(empty))]
            raise VerifyError(f'line {line}: the cell of column "{name}" is empty: fill the whole column or none of it')
        if not name:
            raise VerifyError(f"column {header.index('') + 1} has no name: name it in the first line or leave it out")
        filled[name] = values
    columns = _stored_channels(filled) if stored else _own_channels(filled) if own else Columns(_channels(filled))
    return replace(columns, times=given)


def _check_times(numbers: list[int], given: Real, times: Real) -> None:
    """The times must rise, and contain the case's or cover them, up to one step of their own at either end."""
    asked = (
        f"the case has {len(times)} samples, every {times[1] - times[0]:.10g} s from 0 to {times[-1]:g} s; --template "
        "writes a file with them"
    )
    empty = np.isnan(given)
    if np.any(empty):
        raise VerifyError(f"in line {numbers[int(np.argmax(empty))]} the time is empty ({asked})")
    falling = np.diff(given) <= 0.0
    if np.any(falling):
        i = int(np.argmax(falling)) + 1
        where = f"in line {numbers[i]} the time is {given[i]:.17g} s, after {given[i - 1]:.10g} s"
        raise VerifyError(f"{where}: times must rise ({asked})")
    if shared_times(times, given) is not None:
        return
    slack = CLOCK * abs(times[-1])
    inside = given[(given > times[0] - slack) & (given < times[-1] + slack)]
    if len(inside) < FEWEST:
        within = "" if len(inside) == len(given) else f" from {times[0]:g} to {times[-1]:g} s"
        raise TimesError(f"there are only {len(inside)} rows{within}, and not at the case's times ({asked})")
    step = float(np.max(np.diff(given))) + slack
    if given[0] > times[0] + step or given[-1] < times[-1] - step:
        raise TimesError(f"its times, {given[0]:g} to {given[-1]:g} s, do not cover the case's ({asked})")


def _channels(filled: dict[str, Real]) -> dict[str, Real]:
    """Complete groups of filled columns as channels; VerifyError for a column of no complete group."""
    channels: dict[str, Real] = {}
    left = dict(filled)
    for channel in _whole(left):
        names = short_names(channel, _width(channel, left))
        if all(name in left for name in names):
            channels[channel] = np.column_stack([left.pop(name) for name in names])
    for item in dict.fromkeys(name.rpartition(".")[0] for name in filled):
        for prefix, groups in (("marker", MARKER_GROUPS), ("load", LOAD_GROUPS)):
            for part, letters in groups.items():
                names = [f"{item}.{letter}" for letter in letters]
                if all(name in left for name in names):
                    channels[f"{prefix}:{item}.{part}"] = np.column_stack([left.pop(name) for name in names])
    if left:
        raise VerifyError(f"no whole group contains {_listed(list(left))}; the groups are {_groups_text()}")
    if not channels:
        raise VerifyError("there is nothing in it but times")
    return channels


def _whole(columns: Iterable[str]) -> list[str]:
    """Possible channels that are no vectors of items: energies, momentum, work, and drives."""
    drives = dict.fromkeys(name.partition(f".{DRIVE}")[0] for name in columns if f".{DRIVE}" in name)
    known = [kind for kind in KINDS if not kind.of_items and kind.name not in LINEAR_KINDS]
    named = [f"{kind.name}.{part.name}" if part.name else kind.name for kind in known for part in kind.parts]
    return [*named, *(f"drive:{item}" for item in drives)]


def _width(channel: str, columns: Mapping[str, Real]) -> int:
    """The number of columns of such a channel."""
    part = part_of(channel)
    if part is not None and part.width is not None:
        return part.width
    several = [name for name in columns if name.startswith(f"{channel.partition(':')[2]}.{DRIVE}.")]
    return len(several) or 1


def _stored_channels(filled: dict[str, Real]) -> Columns:
    """Channels of a file with the columns of a reference.csv."""
    try:
        places = channels_by_column(list(filled))
    except CaseError as error:
        raise VerifyError(str(error)) from None
    rows = list(filled.values())
    return Columns({name: np.column_stack([rows[i] for i in found]) for name, found in places.items()}, own=True)


def _own_channels(filled: dict[str, Real]) -> Columns:
    """Channels of a trajectory.csv: whole vectors, energies, momentum and work; what else there is, is left out."""
    units, left = {}, {}
    for header, values in filled.items():
        match = OWN_HEADER.fullmatch(header)
        if match is None:
            raise VerifyError(f'column "{header}" has no unit, unlike the first: write it "name [unit]"')
        units[match[1]], left[match[1]] = match[2], values
    columns: dict[str, Real] = {}
    for item, _, part in [name.rpartition(".")[0].rpartition(".") for name in left]:
        if part in OWN_GROUPS:
            kind, signal = OWN_GROUPS[part]
            names = [f"{item}.{part}.{letter}" for letter in ("wxyz" if signal.width == 4 else "xyz")]
            if all(name in left for name in names):
                _require_unit(names, units, signal.unit)
                columns[f"{kind}:{item}.{signal.name}"] = np.column_stack([left.pop(name) for name in names])
    for signal in kind_named("momentum").parts:
        names = [f"momentum.{signal.name}.{letter}" for letter in "xyz"]
        if all(name in left for name in names):
            _require_unit(names, units, signal.unit)
            columns[f"momentum.{signal.name}"] = np.column_stack([left.pop(name) for name in names])
    for name in [name for name in left if name == "work" or name.startswith("energy.")]:
        _require_unit([name], units, "J")
        columns[name] = left.pop(name)[:, None]
    if not columns:
        raise VerifyError("no column of it can be compared: write it with Trajectory.to_csv or `flexmb simulate`")
    return Columns(columns, own=True, left_out=tuple(left))


def _require_unit(names: Sequence[str], units: dict[str, str], expected: str) -> None:
    for name in names:
        if units[name] != expected:
            raise VerifyError(f'column "{name}" is in "{units[name]}": give it in {expected}, as "{name} [{expected}]"')


def _listed(names: list[str]) -> str:
    return ", ".join(name[:60] for name in names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


def _groups_text() -> str:
    groups = (*MARKER_GROUPS.values(), *LOAD_GROUPS.values())
    whole = f"NAME.{DRIVE}, momentum.angular.x/y/z, momentum.linear.x/y/z, energy.KIND"
    return ", ".join(["NAME." + "/".join(group) for group in groups] + [whole])
