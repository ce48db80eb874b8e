"""What a sweep leaves behind: the table of its samples, and their statistics with standard errors.

The table has a line for each sample in each engine, appended as they come, sorted at the end. Statistics are moments,
quantiles and the failures.
"""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

import msgspec
import numpy as np

from crosscheck.sampling.file import SweepFile
from crosscheck.sampling.sample import Sampled, SampleRecord
from flexmb.output.files import as_text, whole_file, writing
from flexmb.typing import Real

QUANTILES = (0.05, 0.5, 0.95)


@contextmanager
def samples_table(file: Path, sweep: SweepFile) -> Iterator[Callable[[SampleRecord], None]]:
    """A function that adds a line to a CSV file: sample, engine, status, parameters, quantities or nothing, message.

    Until the context ends without an error the lines are in `<name>.unfinished.csv`, in the order in which they came.
    """
    growing = file.with_suffix(f".unfinished{file.suffix}")
    parameters = [parameter.title for parameter in sweep.parameters]
    quantities = [quantity.name for quantity in sweep.quantities]
    header: list[object] = ["sample", "engine", "status", *parameters, *quantities, "message"]
    lines: dict[tuple[int, str], list[object]] = {}
    with writing(growing):
        stream = growing.open("w", encoding="utf-8", newline="")

    def append(line: Sequence[object]) -> None:
        with writing(growing):
            _write(stream, line)

    def add(record: SampleRecord) -> None:
        given = [record.parameters[name] for name in parameters]
        numbers = [record.quantities.get(name, "") for name in quantities]
        line: list[object] = [record.sample, record.engine, record.status, *given, *numbers, record.message]
        lines[record.sample, record.engine] = line
        append(line)

    try:
        append(header)
        yield add
    finally:
        with writing(growing):
            stream.close()
    with whole_file(file) as beside, beside.open("w", encoding="utf-8", newline="") as complete:
        for line in (header, *(lines[key] for key in sorted(lines))):
            _write(complete, line)
    growing.unlink()


def _write(stream: TextIO, line: Sequence[object]) -> None:
    """One line: texts are quoted and no formulas, numbers have all their digits."""
    csv.writer(stream, quoting=csv.QUOTE_NONNUMERIC, lineterminator="\n").writerow(
        [as_text(cell) if isinstance(cell, str) else cell for cell in line]
    )
    stream.flush()


class Estimated(msgspec.Struct, frozen=True, kw_only=True):
    """A number and its standard error, None if unknown."""

    value: float
    standard_error: float | None


class Distribution(msgspec.Struct, frozen=True, kw_only=True):
    """A quantity in one engine over the `count` samples that gave a result.

    A grid has no `mean`, `sd` and `quantiles` (by probability), since its samples are not random. `lowest_at` and
    `highest_at` are the samples of the extremes.
    """

    quantity: str
    engine: str
    count: int
    lowest: float
    lowest_at: int
    highest: float
    highest_at: int
    mean: Estimated | None = None
    sd: Estimated | None = None
    quantiles: dict[str, Estimated] = {}


class Failure(msgspec.Struct, frozen=True, kw_only=True):
    """A sample without a result."""

    sample: int
    engine: str
    status: str
    message: str
    parameters: dict[str, float]


class SweepSummary(msgspec.Struct, frozen=True, kw_only=True):
    """The statistics of a sweep, over the samples with a result, and the failures."""

    title: str
    sampling: str
    seed: int
    samples: int
    statuses: dict[str, int]
    distributions: list[Distribution]
    failures: list[Failure]

    @property
    def ok(self) -> bool:
        """Whether every sample gave its quantities."""
        return not self.failures and bool(self.distributions)


def summarise(done: Sampled) -> SweepSummary:
    """Statistics of all quantities in all engines, and all failures."""
    sweep = done.sweep
    distributions = []
    for quantity in sweep.quantities:
        for engine in sweep.engines:
            finished = [record for record in done.records if record.engine == engine and record.status == "finished"]
            if finished:
                values = np.array([record.quantities[quantity.name] for record in finished])
                numbers = np.array([record.sample for record in finished])
                distributions.append(_distribution(quantity.name, engine, values, numbers, sweep.sampling != "grid"))
    failures = [
        Failure(
            sample=record.sample,
            engine=record.engine,
            status=record.status,
            message=record.message,
            parameters=record.parameters,
        )
        for record in done.records
        if record.status != "finished"
    ]
    return SweepSummary(
        title=sweep.title, sampling=sweep.sampling, seed=sweep.seed, samples=len(done.records) // len(sweep.engines),
        statuses=dict(Counter(record.status for record in done.records)), distributions=distributions,
        failures=failures,
    )  # fmt: skip


def _distribution(quantity: str, engine: str, values: Real, numbers: Real, drawn: bool) -> Distribution:
    low, high = int(np.argmin(values)), int(np.argmax(values))
    extremes = Distribution(
        quantity=quantity, engine=engine, count=len(values), lowest=float(values[low]), lowest_at=int(numbers[low]),
        highest=float(values[high]), highest_at=int(numbers[high]),
    )  # fmt: skip
    if not drawn:
        return extremes
    return msgspec.structs.replace(
        extremes,
        mean=_mean(values),
        sd=_standard_deviation(values),
        quantiles={f"{p:g}": _quantile(values, p) for p in QUANTILES},
    )


def _mean(values: Real) -> Estimated:
    error = np.std(values, ddof=1) / math.sqrt(len(values)) if len(values) > 1 else math.nan
    return _estimated(float(np.mean(values)), float(error))


def _standard_deviation(values: Real) -> Estimated | None:
    """The population's, with its error: var(s^2) = (m4 - s^4 (n - 3)/(n - 1))/n, m4 the fourth central moment, and ds =
    d(s^2)/2s."""
    n = len(values)
    if n < 2:
        return None
    s = float(np.std(values, ddof=1))
    m4 = float(np.mean((values - np.mean(values)) ** 4))
    variance = max(m4 - s**4 * (n - 3) / (n - 1), 0.0) / n
    return _estimated(s, math.sqrt(variance) / (2 * s) if s > 0.0 else 0.0)


def _quantile(values: Real, p: float) -> Estimated:
    """A quantile, with the standard error by Maritz and Jarrett."""
    from scipy.stats import mstats  # takes 0.3 s to import, and most commands do not need it

    error = float(mstats.mjci(values, [p])[0]) if len(values) > 2 else math.nan
    return _estimated(float(np.quantile(values, p)), error)


def _estimated(value: float, error: float) -> Estimated:
    return Estimated(value=value, standard_error=error if math.isfinite(error) else None)
