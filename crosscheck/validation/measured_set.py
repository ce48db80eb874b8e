"""A measured set: published readings, what they were read from, and the program that predicts them.

A folder holds `measured.toml` (source, inputs and series), `points.csv` (the readings) and `model.py` with

    predict(points, inputs, effort) -> one number for each point, in the unit of its series

`points` is a tuple of `Reading`, `inputs` a dict of the values of all inputs by name, and `effort` 0 or 1: the
numerical error at 1 is to be several times smaller, by more modes or polynomials or by a tighter integration. It may
also have exact derivatives of its predictions, by all inputs or by some:

    derivatives(points, inputs, effort) -> a dict of one number for each point, by the names of inputs
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, sqrt
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, TypeVar

import msgspec

from crosscheck.library.case_error import CaseError
from crosscheck.library.find import shipped_folder
from crosscheck.library.read_file import struct_of, text_of
from flexmb.scene.problems import closest

FILE, POINTS, MODEL = "measured.toml", "points.csv", "model.py"
SERIES, MEASURED = "series", "measured"  # columns of points.csv; all others are conditions
MOST_POINTS = 100_000

Width = Literal["standard", "limits"]
Standing = Literal["validated", "model error"]


class Input(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A number that the prediction takes from the source, and how well it is known.

    `width` is a standard deviation, or half the distance of limits between which all values are equally likely.
    `stated` says whether the source has it; otherwise it is declared here, and `why` has the reason.
    """

    name: str
    value: float
    width: float
    kind: Width = "standard"
    unit: str = ""
    stated: bool
    why: str

    @property
    def deviation(self) -> float:
        """Standard deviation, in the unit of the input."""
        return self.width if self.kind == "standard" else self.width / sqrt(3.0)


class Series(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Points of one kind: their unit, the standard deviation of a reading, and what is known to come out.

    The deviation of a reading is `reading` + `relative` times its size. `expect` is "validated" if at least 19 of 20
    points are within their expanded uncertainty, and `within` bounds the largest error, relative to `size` (by
    default the largest reading of the series). A chart has the condition `over` across, and a curve for each
    combination of the conditions `by`. `horizon` has the bounds between which the horizon of the split is expected.
    """

    name: str
    what: str
    unit: str
    reading: float = 0.0
    relative: float = 0.0
    stated: bool
    why: str
    expect: Standing
    within: float
    size: float | None = None
    reason: str = ""
    over: str = ""
    by: tuple[str, ...] = ()
    horizon: tuple[float, float] | None = None


class Split(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Which readings identify the inputs of `fit`: those whose `condition` is at most `to`, or is one of `among`.

    `horizon` is a condition, such as the time: a series is then predicted up to the largest value of it before the
    first reading that is far outside.
    """

    condition: str
    to: float | None = None
    among: tuple[float, ...] = ()
    horizon: str = ""


class MeasuredFile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What `measured.toml` holds. `fitted` says which numbers of the model were fitted to these very readings.

    `fit` names inputs that are identified by the readings of `split`; all others are predicted.
    """

    title: str
    physics: str
    sources: tuple[str, ...]
    read_from: str
    instrument: str
    licence: str
    digitised: str
    fitted: str
    left_out: str
    fit: tuple[str, ...] = ()
    split: Split | None = None
    inputs: tuple[Input, ...] = ()
    series: tuple[Series, ...] = ()


@dataclass(frozen=True)
class Reading:
    """A reading: its series, the conditions at which it was taken, and its value in the unit of the series."""

    series: str
    conditions: Mapping[str, float]
    measured: float


T = TypeVar("T")


@dataclass(frozen=True)
class MeasuredSet:
    """A folder that was read and checked; `name` is that of the folder."""

    name: str
    folder: Path
    content: MeasuredFile
    points: tuple[Reading, ...]

    def series(self, name: str) -> Series:
        """The series of that name."""
        return next(series for series in self.content.series if series.name == name)

    def deviation(self, point: Reading) -> float:
        """Standard deviation of a reading, in the unit of its series."""
        series = self.series(point.series)
        return series.reading + series.relative * abs(point.measured)

    def identifies(self, point: Reading) -> bool:
        """Whether a reading is one by which inputs are identified, and which is not predicted."""
        split = self.content.split
        if split is None or split.condition not in point.conditions:
            return False
        value = point.conditions[split.condition]
        return value in split.among or (split.to is not None and value <= split.to)

    @property
    def nominal(self) -> dict[str, float]:
        """The inputs as the source has them."""
        return {given.name: given.value for given in self.content.inputs}


def measured_folder() -> Path:
    """The folder of the shipped sets."""
    return shipped_folder() / "measured"


def shipped_sets() -> tuple[str, ...]:
    """Names of the shipped sets; none of their files is read."""
    return tuple(file.parent.name for file in sorted(measured_folder().glob(f"*/{FILE}")))


def find_set(word: str) -> MeasuredSet:
    """A shipped set by its name, or a folder that holds a `measured.toml`; CaseError names file, place and remedy."""
    if (Path(word) / FILE).is_file():
        return read_set(Path(word))
    known = shipped_sets()
    if word not in known:
        raise CaseError(
            f'"{word}" is no measured set and no folder with a {FILE}: {closest(word, known)}; '
            "`crosscheck validate list` shows them"
        )
    return read_set(measured_folder() / word)


def find_sets(words: Sequence[str]) -> list[MeasuredSet]:
    """The sets of some words, each once; `all` or `list` alone are all shipped ones. CaseError as `find_set`, and where
    two folders have one name, by which results and pages are known."""
    names = shipped_sets() if list(words) in (["all"], ["list"]) else dict.fromkeys(words)
    found = [find_set(name) for name in names]
    folders = dict[str, Path]()
    for each in found:
        if folders.setdefault(each.name, each.folder) != each.folder:
            raise CaseError(f"{folders[each.name]} and {each.folder} have the same name: rename one, or ask for one")
    return list({each.name: each for each in found}.values())


def read_set(folder: Path) -> MeasuredSet:
    """Read and check a folder; CaseError names file, place and remedy."""
    folder = folder.resolve()
    content = _content(folder / FILE)
    known = MeasuredSet(folder.name, folder, content, _points(folder / POINTS, content))
    _refuse_bad_split(known)
    return known


def _refuse_bad_split(known: MeasuredSet) -> None:
    """CaseError where inputs are to be identified that are none, or by no reading, or nothing is left to predict."""
    content, file = known.content, known.folder / FILE
    split, inputs = content.split, {given.name: given for given in content.inputs}
    if (split is None) != (not content.fit):
        raise CaseError(f"{file}: fit and [split] belong together: give both, or none")
    if split is None:
        for series in content.series:
            if series.horizon is not None:
                raise CaseError(f'{file}: series "{series.name}" has a horizon, and there is no [split]')
        return
    for name in content.fit:
        if name not in inputs:
            raise CaseError(f'{file}: fit: "{name}" is no input: {closest(name, inputs)}')
        if inputs[name].deviation == 0.0:
            raise CaseError(f'{file}: fit: input "{name}" has width 0: give a step by which its search begins')
    if not any(known.identifies(point) for point in known.points):
        raise CaseError(f"{file}: split: no reading has a {split.condition} that is meant: nothing is identified")
    for series in content.series:
        rest = [point for point in known.points if point.series == series.name and not known.identifies(point)]
        if not rest:
            raise CaseError(f'{file}: split: no reading of series "{series.name}" is left to predict')
        if split.horizon and any(split.horizon not in point.conditions for point in rest):
            raise CaseError(f'{file}: split: a reading of series "{series.name}" has no {split.horizon}')
        if series.horizon is not None and not split.horizon:
            raise CaseError(f'{file}: series "{series.name}" has a horizon: say in [split] along which condition')


def _content(file: Path) -> MeasuredFile:
    content = struct_of(file, MeasuredFile)
    for kind, items in (("input", content.inputs), ("series", content.series)):
        names = [item.name for item in items]
        for name in names:
            if names.count(name) > 1:
                raise CaseError(f'{file}: {kind} "{name}" is there twice: rename one')
    if not content.series:
        raise CaseError(f"{file}: there is no series: add [[series]]")
    for given in content.inputs:
        _refuse(file, f'input "{given.name}"', given, {"width": given.width}, ("value",))
    for series in content.series:
        sizes = {"reading": series.reading, "relative": series.relative}
        _refuse(file, f'series "{series.name}"', series, sizes, ())
        if series.reading == series.relative == 0.0:
            raise CaseError(f'{file}: series "{series.name}" has exact readings: give reading or relative')
        if not 0.0 < series.within < float("inf") or not (series.size is None or 0.0 < series.size < float("inf")):
            raise CaseError(f'{file}: series "{series.name}": within and size are positive numbers')
        if series.expect == "model error" and not series.reason:
            raise CaseError(f'{file}: series "{series.name}" expects a model error: say why in reason')
    return content


def _refuse(file: Path, where: str, item: Any, sizes: Mapping[str, float], finite: tuple[str, ...]) -> None:
    for key, value in sizes.items():
        if not 0.0 <= value < float("inf"):
            raise CaseError(f"{file}: {where}: {key} is {value:g}: give a number from 0")
    for key in finite:
        if not isfinite(getattr(item, key)):
            raise CaseError(f"{file}: {where}: {key} is {getattr(item, key):g}: give a finite number")


def _rows(file: Path) -> Iterator[list[str]]:
    """Line by line; CaseError where the csv module gives up, as it does at a cell of more than 131 072 letters."""
    try:
        yield from csv.reader(io.StringIO(text_of(file)))
    except csv.Error as error:
        raise CaseError(f"{file}: {error}: correct it, or write the file anew") from None


def _points(file: Path, content: MeasuredFile) -> tuple[Reading, ...]:
    rows = _rows(file)
    head = next(rows, [])
    if len(set(head)) < len(head) or not {SERIES, MEASURED} <= set(head):
        raise CaseError(f"{file}: line 1: the columns {SERIES} and {MEASURED} are needed, each column once")
    known = [series.name for series in content.series]
    points = list[Reading]()
    for line, row in enumerate(rows, 2):
        if len(row) != len(head):
            raise CaseError(f"{file}: line {line} has {len(row)} columns, and line 1 has {len(head)}")
        if len(points) == MOST_POINTS:
            raise CaseError(f"{file}: line {line}: there are more than {MOST_POINTS} points: leave some out")
        cells = dict(zip(head, row, strict=True))
        if cells[SERIES] not in known:
            raise CaseError(
                f'{file}: line {line}: series "{cells[SERIES]}" is not in {FILE}: {closest(cells[SERIES], known)}'
            )
        numbers = {key: _number(file, line, key, text) for key, text in cells.items() if key != SERIES and text.strip()}
        if MEASURED not in numbers:
            raise CaseError(f"{file}: line {line}: there is no reading: leave the line out")
        measured = numbers.pop(MEASURED)
        points.append(Reading(cells[SERIES], MappingProxyType(numbers), measured))
    for series in content.series:
        _refuse_unknown_conditions(file, series, set(head) - {SERIES, MEASURED})
        if series.over and any(point.series == series.name and series.over not in point.conditions for point in points):
            raise CaseError(f'{file}: a reading of series "{series.name}" has no {series.over}, over which it is drawn')
        readings = [point.measured for point in points if point.series == series.name]
        if not readings:
            raise CaseError(f'{file}: series "{series.name}" has no point: leave it out of {FILE}')
        if series.size is None and not any(readings):
            raise CaseError(f'{file}: all readings of series "{series.name}" are 0: give its size in {FILE}')
    return tuple(points)


def _refuse_unknown_conditions(file: Path, series: Series, known: set[str]) -> None:
    for name in (*([series.over] if series.over else []), *series.by):
        if name not in known:
            near = closest(name, known)
            where = f'{file.with_name(FILE)}: series "{series.name}" is drawn by'
            raise CaseError(f"{where} {name}, which is no column of {file}: {near}")


def _number(file: Path, line: int, key: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = float("nan")
    if not isfinite(number):
        raise CaseError(f'{file}: line {line}: {key} is "{text}": give a finite number')
    return number
