"""The budget of a measured set: for each point the error E of the prediction, and what it may come from.

After ASME V&V 20-2009: with the prediction S and the reading D, E = S - D, and the validation uncertainty

    u_val^2 = u_num^2 + u_input^2 + u_D^2

of standard deviations. u_num is the change of S by the last refinement. u_input is of first order in the inputs, which
are taken to be independent: each derivative is a central difference over the input's own deviation and over half of it,
combined to fourth order; how much both differ is `curved`, and where that is not small, samples (`--samples`) say what
first order leaves out. A point is within its uncertainty if |E| <= 2 u_val. Otherwise the model is wrong there, by E
give or take 2 u_val: nothing that was declared explains it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.library.case_error import CaseError
from crosscheck.validation.measured_set import MODEL, MeasuredSet, Predict, Reading, Series, Standing
from flexmb.typing import Real

COVERAGE = 2.0  # two standard deviations: 95 of 100 where errors are normal
SHARE = 0.95  # of the points of a validated series that are within
NOTICED = 2.0  # a bound so many times beyond the largest error would notice nothing

Listener = Callable[[int, int], None]


@dataclass(frozen=True)
class Budget:
    """Of N points and I inputs, in the units of the series; all arrays are in the order of `points`.

    `by_input` (N,I) is the change of the prediction by one deviation of each input, `curved` (N,I) how far its two
    differences are apart, and `sampled` (N,) the deviation of the prediction over samples of all inputs, if any.
    """

    of: MeasuredSet
    predicted: Real
    measured: Real
    u_num: Real
    u_D: Real
    by_input: Real
    curved: Real
    sampled: Real | None = None
    samples: int = 0

    @property
    def error(self) -> Real:
        """(N,) E = S - D."""
        return self.predicted - self.measured

    @property
    def u_input(self) -> Real:
        """(N,) standard deviation of the prediction by the inputs."""
        return np.sqrt(np.sum(self.by_input**2, axis=1))

    @property
    def u_val(self) -> Real:
        """(N,) validation uncertainty."""
        return np.sqrt(self.u_num**2 + self.u_input**2 + self.u_D**2)

    @property
    def within(self) -> NDArray[np.bool_]:
        """(N,) whether E is within the expanded uncertainty; False where either is no number."""
        return np.abs(self.error) <= COVERAGE * self.u_val

    def verdicts(self) -> tuple[SeriesVerdict, ...]:
        """One for each series."""
        return tuple(self._verdict(series) for series in self.of.content.series)

    def _verdict(self, series: Series) -> SeriesVerdict:
        mine = np.array([point.series == series.name for point in self.of.points])
        error, within = self.error[mine], self.within[mine]
        size = series.size or float(np.max(np.abs(self.measured[mine])))
        largest, u_val = float(np.max(np.abs(error))) / size, float(np.sqrt(np.mean(self.u_val[mine] ** 2))) / size
        standing: Standing = "validated" if np.mean(within) >= SHARE else "model error"
        return SeriesVerdict(
            series, standing, int(np.sum(within)), len(within), float(np.sqrt(np.mean(error**2))) / size, largest,
            u_val, self._fault(series, standing, largest, u_val, size),
        )  # fmt: skip

    def _fault(self, series: Series, standing: Standing, largest: float, u_val: float, size: float) -> str:
        """What is not as the file says; "" if nothing."""
        if not np.isfinite(largest):
            return "its error is no finite number"
        if not COVERAGE * u_val < 1.0:  # an infinite one, too
            return f"its uncertainty is {u_val:.2g} of its size: nothing could be outside; give narrower inputs"
        if standing != series.expect:
            return f'"{series.expect}" was expected'
        if largest > series.within:
            most = f"at most {series.within:g} was expected"
            return f"the largest error is {largest:.2g} of {size:.3g} {series.unit}, and {most}"
        if NOTICED * largest < series.within:
            return f"its bound of {series.within:g} is more than {NOTICED:g} times the largest error, {largest:.2g}"
        return ""


@dataclass(frozen=True)
class SeriesVerdict:
    """Of one series: its standing, how many points are within, errors relative to its size, and what is unexpected."""

    series: Series
    standing: Standing
    within: int
    points: int
    rms: float
    largest: float
    u_val: float
    fault: str

    @property
    def ok(self) -> bool:
        """Whether it came out as its file says."""
        return not self.fault


def budget(of: MeasuredSet, samples: int = 0, seed: int = 0, listener: Listener = lambda done, of: None) -> Budget:
    """Predict all points at both efforts and at the inputs beside the nominal ones, and at `samples` draws of them.

    CaseError where the model raises, or gives what is not one finite number for each point.
    """
    points, nominal, inputs = of.points, of.nominal, of.content.inputs
    predict, total, done = of.predict(), 2 + 4 * len(inputs) + samples, 0

    def at(changes: Mapping[str, float], effort: int) -> Real:
        nonlocal done
        values = _predicted(of, predict, points, nominal | dict(changes), effort)
        listener(done := done + 1, total)
        return values

    coarse, fine = at({}, 0), at({}, 1)
    by_input, curved = np.zeros((len(points), len(inputs))), np.zeros((len(points), len(inputs)))
    for i, given in enumerate(inputs):
        h = given.deviation
        wide, near = (
            (at({given.name: given.value + step}, 1) - at({given.name: given.value - step}, 1)) * (h / (2.0 * step))
            if h > 0.0 else np.zeros(len(points))
            for step in (h, 0.5 * h)
        )  # fmt: skip
        by_input[:, i], curved[:, i] = (4.0 * near - wide) / 3.0, np.abs(near - wide)
    sampled = None
    if samples:
        drawn = np.random.default_rng(seed)
        draws = [
            at({each.name: _draw(drawn, each.value, each.deviation, each.kind) for each in inputs}, 1)
            for _ in range(samples)
        ]
        sampled = np.std(draws, axis=0, ddof=1) if samples > 1 else np.full(len(points), np.nan)
    measured, u_D = np.array([point.measured for point in points]), np.array([of.deviation(point) for point in points])
    return Budget(of, fine, measured, np.abs(fine - coarse), u_D, by_input, curved, sampled, samples)


def _draw(drawn: np.random.Generator, value: float, deviation: float, kind: str) -> float:
    """From a normal distribution, or from an even one of the same deviation."""
    return value + deviation * float(drawn.normal() if kind == "standard" else drawn.uniform(-(3.0**0.5), 3.0**0.5))


def _predicted(
    of: MeasuredSet, predict: Predict, points: Sequence[Reading], inputs: Mapping[str, float], effort: int
) -> Real:
    where = f"{of.folder / MODEL}: predict at effort {effort}"
    try:
        answer = np.asarray(predict(points, dict(inputs), effort), dtype=np.float64)
    except Exception as error:  # the file is anybody's
        raise CaseError(f"{where}: {type(error).__name__}: {error}") from error
    if answer.shape != (len(points),):
        raise CaseError(f"{where}: it gave an array {answer.shape} for {len(points)} points")
    if not np.all(np.isfinite(answer)):
        first = points[int(np.argmin(np.isfinite(answer)))]
        raise CaseError(f"{where}: what it gave for {first.series}, {dict(first.conditions)}, is no finite number")
    return answer
