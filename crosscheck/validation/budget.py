"""The budget of a measured set: for each point the error E of the prediction, and what it may come from.

After ASME V&V 20-2009: with the prediction S and the reading D, E = S - D, and the validation uncertainty

    u_val^2 = u_num^2 + u_input^2 + u_D^2

of standard deviations. u_num is the change of S by the last refinement. u_input is of first order in the inputs, which
are taken to be independent: its derivatives are exact where the model has them, and held against a difference; all
others are central differences over the input's own deviation and over half of it, combined to fourth order. How far
both are apart is `curved`, and where that is not small, samples (`--samples`) say what first order leaves out. A point
is within its uncertainty if |E| <= 2 u_val. Otherwise the model is wrong there, by E give or take 2 u_val: nothing that
was declared explains it.

Where a file names inputs to `fit`, they are identified by a part of the readings (`identification`), and u_input of the
others is that of the posterior covariance of all inputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.sealed.seal import stamped
from crosscheck.validation.identification import Identified, identified
from crosscheck.validation.measured_set import Input, MeasuredSet, Series, Standing
from crosscheck.validation.model import Listener, MeasuredModel
from flexmb.typing import Real

COVERAGE = 2.0  # two standard deviations: 95 of 100 where errors are normal
SHARE = 0.95  # of the points of a validated series that are within
FAR = 3.0  # deviations beyond which a reading is by chance once in 370: the horizon ends there
NOTICED = 2.0  # a bound so many times beyond the largest error would notice nothing


@dataclass(frozen=True)
class Budget:
    """Of N points and I inputs, in the units of the series; all arrays are in the order of `points`.

    `by_input` (N,I) is the change of the prediction by one deviation of each input, `curved` (N,I) how far the two
    ways to find it are apart, `exact` for each input whether it is by a derivative of the model's own, and `sampled`
    (N,) the deviation of the prediction over samples of all inputs, if any.
    """

    of: MeasuredSet
    predicted: Real
    measured: Real
    u_num: Real
    u_D: Real
    by_input: Real
    curved: Real
    exact: tuple[bool, ...]
    sampled: Real | None = None
    samples: int = 0
    identified: Identified | None = None

    @property
    def error(self) -> Real:
        """(N,) E = S - D."""
        return self.predicted - self.measured

    @property
    def u_input(self) -> Real:
        """(N,) standard deviation of the prediction by the inputs."""
        return np.sqrt(np.maximum(np.sum(self.parts, axis=1), 0.0))

    @property
    def parts(self) -> Real:
        """(N,I) what each input adds to u_input^2; inputs that were identified together may take away, too."""
        found = self.identified
        return self.by_input * (self.by_input if found is None else self.by_input @ found.correlation)

    @property
    def u_val(self) -> Real:
        """(N,) validation uncertainty."""
        return np.sqrt(self.u_num**2 + self.u_input**2 + self.u_D**2)

    @property
    def within(self) -> NDArray[np.bool_]:
        """(N,) whether E is within the expanded uncertainty; False where either is no number."""
        return np.abs(self.error) <= COVERAGE * self.u_val

    def most_by(self, i: int) -> str:
        """The input that contributes most to u_input of a point; "" if none does."""
        row = self.parts[i]
        return self.of.content.inputs[int(np.argmax(row))].name if np.any(row > 0.0) else ""

    def shares(self, series: str) -> Real:
        """(I,) part of each input in the sum of u_input^2 over a series; zeros where no input matters."""
        mine = np.array([point.series == series for point in self.of.points])
        parts = np.sum(self.parts[mine], axis=0)
        return parts / np.sum(parts) if np.sum(parts) > 0.0 else parts

    def verdicts(self) -> tuple[SeriesVerdict, ...]:
        """One for each series."""
        return tuple(self._verdict(series) for series in self.of.content.series)

    def _verdict(self, series: Series) -> SeriesVerdict:
        mine = np.array([point.series == series.name for point in self.of.points])
        error, within = self.error[mine], self.within[mine]
        size = series.size or float(np.max(np.abs(self.measured[mine])))
        largest, u_val = float(np.max(np.abs(error))) / size, float(np.sqrt(np.mean(self.u_val[mine] ** 2))) / size
        standing: Standing = "validated" if np.mean(within) >= SHARE else "model error"
        horizon = self._horizon(mine)
        fault = self._fault(series, standing, largest, u_val, size) or _horizon_fault(series, horizon)
        rms = float(np.sqrt(np.mean(error**2))) / size
        return SeriesVerdict(series, standing, int(np.sum(within)), len(within), rms, largest, u_val, fault, horizon)

    def _horizon(self, mine: NDArray[np.bool_]) -> float | None:
        """The largest value of the horizon's condition before the first reading that is far outside; None without."""
        split = self.of.content.split
        if split is None or not split.horizon:
            return None
        at = np.array([point.conditions[split.horizon] for point, own in zip(self.of.points, mine, strict=True) if own])
        far = ~(np.abs(self.error[mine]) <= FAR * self.u_val[mine])
        inside = at[at < np.min(at[far])] if np.any(far) else at
        return float(np.max(inside)) if len(inside) else float(np.min(at)) if split.to is None else split.to

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


def _horizon_fault(series: Series, horizon: float | None) -> str:
    """What is not as the file says of a horizon; "" if nothing."""
    if series.horizon is None or horizon is None:
        return ""
    low, high = series.horizon
    if not low <= horizon <= high:
        return f"it leaves its band after {horizon:.3g}, and {low:g} to {high:g} was expected"
    return f"its horizon from {low:g} would notice nothing: it is {horizon:.3g}" if horizon > NOTICED * low else ""


@dataclass(frozen=True)
class SeriesVerdict:
    """Of one series: its standing, how many points are within, errors relative to its size, what is unexpected, and how
    far it is predicted, in the unit of the horizon's condition, if the file names one."""

    series: Series
    standing: Standing
    within: int
    points: int
    rms: float
    largest: float
    u_val: float
    fault: str
    horizon: float | None = None

    @property
    def ok(self) -> bool:
        """Whether it came out as its file says."""
        return not self.fault


def budget(of: MeasuredSet, samples: int = 0, seed: int = 0, listener: Listener = lambda done, of: None) -> Budget:
    """Predict all points at both efforts and at the inputs beside the nominal ones, and at `samples` draws of them.

    Inputs of `fit` are identified first: then the points are those that are left to predict, and the inputs as found.
    CaseError where the model raises, gives what is not one finite number for each point, or has a wrong derivative, and
    where readings do not determine what is to be fitted.
    """
    found = identified(of, listener) if of.content.fit else None
    of = of if found is None else found.of
    points, nominal, inputs = of.points, of.nominal, of.content.inputs
    model = MeasuredModel(of, listener, 2 + 4 * len(inputs) + samples)
    coarse, fine = model.predictions(points, nominal, 0), model.predictions(points, nominal, 1)
    changes, sampled = model.changes(points, inputs), None
    if samples:
        drawn = np.random.default_rng(seed)
        draws = [model.predictions(points, _draw(drawn, inputs, found), 1) for _ in range(samples)]
        sampled = np.std(draws, axis=0, ddof=1) if samples > 1 else np.full(len(points), np.nan)
    measured, u_D = np.array([point.measured for point in points]), np.array([of.deviation(point) for point in points])
    return Budget(of, fine, measured, np.abs(fine - coarse), u_D, *changes, sampled, samples, found)


def _draw(drawn: np.random.Generator, inputs: Sequence[Input], found: Identified | None) -> dict[str, float]:
    """Inputs from normal distributions, or from even ones of the same deviation; correlated as they were identified."""
    if found is None:
        units = [
            drawn.normal() if each.kind == "standard" else drawn.uniform(-(3.0**0.5), 3.0**0.5) for each in inputs
        ]
    else:
        units = drawn.multivariate_normal(np.zeros(len(inputs)), found.correlation).tolist()
    return {each.name: each.value + each.deviation * unit for each, unit in zip(inputs, units, strict=True)}


# A budget as plain data, for JSON and for pages.


def document(budget: Budget) -> dict[str, Any]:
    """Series with their verdicts, inputs, and each point with all parts of its budget, in the units of the series; with
    a stamp, by which it is evidence for a label."""
    content, sampled, verdicts = budget.of.content, budget.sampled, budget.verdicts()
    told = ("title", "physics", "read_from", "instrument", "licence", "digitised", "fitted", "left_out")
    found = {key: getattr(content, key) for key in told} | {
        "sources": list(content.sources),
        "ok": all(verdict.ok for verdict in verdicts),
        "within": int(np.sum(budget.within)),
        "samples": budget.samples,
        "series": [_series(budget, verdict) for verdict in verdicts],
        "inputs": [
            {
                "name": each.name, "value": each.value, "deviation": each.deviation, "unit": each.unit,
                "stated": each.stated, "why": each.why, "derivative": "exact" if exact else "differences",
            }
            for each, exact in zip(content.inputs, budget.exact, strict=True)
        ],
        "identified": _identified(budget),
        "points": [
            {
                "series": point.series, "conditions": dict(point.conditions), "measured": point.measured,
                "predicted": float(budget.predicted[i]), "E": float(budget.error[i]), "u_num": float(budget.u_num[i]),
                "u_input": float(budget.u_input[i]), "u_D": float(budget.u_D[i]), "u_val": float(budget.u_val[i]),
                "within": bool(budget.within[i]), "most_by": budget.most_by(i),
                "by_input": {each.name: float(budget.by_input[i, k]) for k, each in enumerate(content.inputs)},
            }
            | ({} if sampled is None else {"sampled": float(sampled[i])})
            for i, point in enumerate(budget.of.points)
        ],
    }  # fmt: skip
    return stamped(found, budget.of.folder)


def _identified(budget: Budget) -> dict[str, Any] | None:
    """By how many readings which inputs were identified, and what is left there; None where nothing was."""
    found, content = budget.identified, budget.of.content
    if found is None:
        return None
    return {
        "inputs": list(content.fit), "readings": found.readings, "misfit": found.misfit,
        "correlation": found.correlation.tolist(), "horizon": content.split.horizon if content.split else "",
    }  # fmt: skip


def _series(budget: Budget, verdict: SeriesVerdict) -> dict[str, Any]:
    """What a series is, what came out, and the share of each input in its u_input squared."""
    series = verdict.series
    return {
        "name": series.name, "what": series.what, "unit": series.unit, "over": series.over, "by": list(series.by),
        "reading": series.reading, "relative": series.relative, "stated": series.stated, "read_why": series.why,
        "standing": verdict.standing, "reason": series.reason, "ok": verdict.ok, "fault": verdict.fault,
        "points": verdict.points, "within": verdict.within, "rms": verdict.rms, "largest": verdict.largest,
        "u_val": verdict.u_val, "horizon": verdict.horizon, "shares": budget.shares(series.name).tolist(),
    }  # fmt: skip
