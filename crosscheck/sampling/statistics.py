"""Statistics of a sweep: moments and quantiles with their standard errors, and failures."""

from __future__ import annotations

import math
from collections import Counter

import msgspec
import numpy as np

from crosscheck.sampling.run import Sampled
from flexmb.typing import Real

QUANTILES = (0.05, 0.5, 0.95)


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
            found = [(each.quantities[quantity.name], each.sample) for each in done.records
                     if each.engine == engine and each.status == "finished"]  # fmt: skip
            if found:
                values, numbers = map(np.array, zip(*found, strict=True))
                distributions.append(_distribution(quantity.name, engine, values, numbers, sweep.sampling != "grid"))
    failures = [
        Failure(
            sample=each.sample, engine=each.engine, status=each.status, message=each.message, parameters=each.parameters
        )
        for each in done.records
        if each.status != "finished"
    ]
    return SweepSummary(
        title=sweep.title, sampling=sweep.sampling, seed=sweep.seed, samples=len(done.records) // len(sweep.engines),
        statuses=dict(Counter(each.status for each in done.records)), distributions=distributions, failures=failures,
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
