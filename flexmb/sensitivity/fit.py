"""Identification: the numbers of a scene with which its run is nearest to measurements, by least squares.

    minimise  sum over times and channels of ((model - measured) / sigma)^2

by Gauss-Newton steps in a trust region (SciPy) with the exact derivatives of `sensitivities`. With J the derivatives of
the weighted residuals at the minimum, the covariance of the parameters is (J'J)^-1 (Seber & Wild, Nonlinear Regression,
1989, ch. 2). Where no sigma is given, it is estimated for each channel from its residuals, and the fit repeated with
these weights until they agree.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np

from flexmb.integrate.settings import Settings
from flexmb.kept import kept
from flexmb.parameters.numbers import numbers
from flexmb.run.driver import Leg
from flexmb.run.simulate import RunSettings, refuse_unknown, run_with_course
from flexmb.run.times import refuse_large_run
from flexmb.run.trajectory import Trajectory
from flexmb.scene.check import check_and_warn
from flexmb.scene.problems import SceneError, SceneWarning, closest
from flexmb.scene.schema import Scene
from flexmb.sensitivity.channels import Chosen, chosen, refuse_undetermined, refuse_unknown_outputs
from flexmb.sensitivity.gate import Admitted, admitted_to, again, prepared
from flexmb.sensitivity.measurements import Measurements, measurements
from flexmb.sensitivity.sensitivities import of_run
from flexmb.system.system import System
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real

# Singular values of J, per relative change of the parameters, below this share of the largest one: derivatives are
# exact to some 1e-9, so that such a combination of parameters has no effect that could be told from none.
UNSEEN = 1e-7
INVOLVED = 0.1  # components of such a combination that name a parameter
AGREE = 0.01  # relative change of estimated sigmas at which the weights count as settled
REWEIGHTED = 8  # times at most
# Relative change of the sum of squares at which the search ends. The parameters are then within sqrt(FLAT n) of their
# sigmas for n measurements, a hundredth for ten thousand, and smaller changes are lost in the error of the runs.
FLAT = 1e-8


@dataclass(frozen=True)
class Fit:
    """Parameters (P,) identified from measurements, by `fit`.

    values (P,) and their standard deviations sigma (P,), covariance (P,P) and correlation (P,P). unidentifiable: those
    of which only combinations affect the measurements, or nothing at all; their sigma is infinite. t (T,) and channels
    (K,) of the measurements, residuals (T,K) = model - measured, NaN where nothing was measured, noise (K,): the sigmas
    by which they were weighted. chi_square: the weighted sum of squares, to be compared with `freedom`, the number of
    measurements less that of parameters; it says nothing where the noise was estimated. scene: with the values found;
    trajectory: its run. evaluations: number of runs; message: how the search ended.
    """

    parameters: tuple[str, ...]
    values: Real
    sigma: Real
    covariance: Real
    correlation: Real
    unidentifiable: tuple[str, ...]
    t: Real
    channels: tuple[str, ...]
    residuals: Real
    noise: Real
    estimated: bool
    chi_square: float
    freedom: int
    scene: Scene
    trajectory: Trajectory
    evaluations: int
    message: str

    __repr__ = brief

    def __str__(self) -> str:
        """Values with standard deviations and strongest correlation, and what the residuals are, as a table."""
        rows = [("parameter", "value", "sigma", "relative", "correlates most with")]
        for k, name in enumerate(self.parameters):
            relative = self.sigma[k] / abs(self.values[k]) if self.values[k] else np.inf
            rows.append(
                (name, f"{self.values[k]:.6g}", f"{self.sigma[k]:.2g}", f"{100.0 * relative:.2g} %", self._partner(k))
            )
        lines = aligned(rows)
        for k, channel in enumerate(self.channels):
            own = self.residuals[np.isfinite(self.residuals[:, k]), k]
            kind = "estimated" if self.estimated else "given"
            lines.append(
                f"{channel}: {len(own)} values, rms of residuals {_rms(own):.3g}, sigma {self.noise[k]:.3g} ({kind})"
            )
        if not self.estimated:
            lines.append(f"chi-square {self.chi_square:.4g} with {self.freedom} degrees of freedom")
        if self.unidentifiable:
            lines.append(f"not identifiable from these channels: {', '.join(self.unidentifiable)}")
        return "\n".join(lines)

    def _partner(self, k: int) -> str:
        others = np.abs(np.where(np.arange(len(self.parameters)) == k, 0.0, self.correlation[k]))
        if not np.isfinite(others).all() or not np.any(others):
            return ""
        j = int(np.argmax(others))
        return f"{self.parameters[j]} ({self.correlation[k, j]:+.2f})"


@dataclass(frozen=True)
class _Run:
    """A run of the system of a scene, its parts between events, and the channels that were measured."""

    scene: Scene
    system: System
    trajectory: Trajectory
    course: list[Leg]
    channels: tuple[str, ...]

    @kept
    def outputs(self) -> Chosen:
        """Residuals and derivatives ask for these channels."""
        return chosen(self.trajectory, self.channels)


class _Problem:
    """scene, names (P,) and their scales; what was measured; whether a value was (T,K); settings of the runs.

    The search asks for the derivatives where it has just asked for the residuals, so that the last run is kept.
    """

    def __init__(
        self, scene: Scene, names: tuple[str, ...], scales: Real, data: Measurements, settings: RunSettings
    ) -> None:
        self.scene, self.names, self.scales, self.data = scene, names, scales, data
        self.known: Any = np.isfinite(data.values)
        self.times = data.t if data.t[0] == 0.0 else np.r_[0.0, data.t]
        """Output times of a run, which starts at 0."""
        self.settings = Settings("dop853", **settings).checked(float(self.times[-1]))
        self.runs = 0
        self._last: tuple[bytes, _Run] | None = None
        self._admitted: Admitted | None = None

    def run(self, x: Real) -> _Run:
        """The run with these scaled parameters; what is doubtful in trial values is not said."""
        key = x.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = None  # so that two runs are never held at once
            self.runs += 1
            scene = self.scene.with_values(dict(zip(self.names, (x * self.scales).tolist(), strict=True)))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", SceneWarning)
                check_and_warn(scene, float(self.times[-1]))
                refuse_large_run(scene, len(self.times), self.settings, "articulated")
                system = prepared(scene)
                trajectory, course = run_with_course(system, self.times, self.settings)
                self._last = key, _Run(scene, system, trajectory, course, self.data.channels)
        return self._last[1]

    def derivatives(self, x: Real) -> Real:
        """(T,K,P) of the channels, at the times of the measurements, by the scaled parameters."""
        run = self.run(x)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)
            last = self._admitted
            self._admitted = admitted_to(run.system, self.names) if last is None else again(last, run.system)
            found = of_run(self._admitted, self.settings, run.trajectory, run.course, run.outputs)
        return found.derivatives[-len(self.data.t) :] * self.scales

    def seen(self, run: _Run) -> Real:
        """The channels (T,K) of a run at the times of the measurements."""
        return run.outputs.values[-len(self.data.t) :]


def fit(
    scene: Scene,
    data: str | os.PathLike[str] | Mapping[str, Any],
    parameters: Sequence[str],
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    sigma: float | Mapping[str, float] | None = None,
    max_runs: int = 100,
    **settings: Unpack[RunSettings],
) -> Fit:
    """Identify numbers of a scene from measurements of its run, which starts at t = 0 in the state of the scene.

    data: a CSV file whose header names the columns, "t" and channels of `Trajectory.columns`, as `Trajectory.to_csv`
    writes it (units in brackets are ignored, empty cells are missing); or arrays by these names. parameters: paths as
    for `sensitivities`; the search starts from the values of the scene. bounds: (lower, upper) by parameter. sigma: the
    standard deviation of the noise, of all channels or by channel; None: estimated from the residuals. settings: of
    the runs, see `simulate`; their tolerances should lie well below the noise.

    Raises ValueError or TypeError for data, bounds, sigmas or `max_runs` that do not fit, DynamicsError for channels
    that redundant closures leave undetermined, and what `sensitivities` raises.
    """
    max_runs = arguments.count("max_runs", max_runs)
    found, given = numbers(scene, parameters), measurements(data)
    names = tuple(number.name for number in found)
    refuse_unknown("fit", settings)
    problem = _Problem(scene, names, np.array([number.scale for number in found]), given, settings)
    start = np.array([number.value for number in found]) / problem.scales
    limits = _limits(bounds or {}, names, start, problem.scales)
    if int(np.sum(problem.known)) < len(names):
        raise ValueError(
            f"there are {int(np.sum(problem.known))} measured values for {len(names)} parameters: give more"
        )
    first = problem.run(start)
    _refuse_unknown_channels(first.trajectory, given.channels)
    _refuse_unfinished(first.trajectory)
    refuse_unknown_outputs(first.system, given.channels)
    refuse_undetermined(first.trajectory, given.channels)
    noise = _given_noise(sigma, given.channels)
    return _searched(problem, start, limits, noise, max_runs)


def _searched(problem: _Problem, start: Real, limits: tuple[Real, Real], noise: Real | None, max_runs: int) -> Fit:
    """The fit, with these sigmas (K,), or with estimated ones."""
    from scipy.optimize import least_squares  # imported here because it is slow to import

    data, known = problem.data, problem.known
    weights = np.std(np.where(known, data.values, np.nan), axis=0, where=known) if noise is None else noise
    weights = np.where(weights > 0.0, weights, 1.0)

    def residuals(x: Real) -> Real:
        try:
            run = problem.run(x)
        except (SceneError, DynamicsError):
            run = None
        if run is None or not run.trajectory.finished or len(run.trajectory.t) < len(problem.times):
            return np.full(int(np.sum(known)), np.nan)  # the search takes a shorter step
        residuals: Real = ((problem.seen(run) - data.values) / weights)[known]
        return residuals

    def jacobian(x: Real) -> Real:
        scaled = problem.derivatives(x) / weights[:, None]
        J: Real = scaled[known]
        return J

    x = start
    for _ in range(1 if noise is not None else REWEIGHTED):
        with np.errstate(invalid="ignore", divide="ignore"):  # of directions on which nothing depends, named below
            solution = least_squares(
                residuals,
                x,
                jacobian,
                limits,
                method="trf",
                x_scale="jac",
                max_nfev=max_runs,
                ftol=FLAT,
                xtol=FLAT,
                gtol=None,
            )
        x, before = solution.x, weights
        if noise is not None:
            break
        off = _by_time(known, solution.fun) * weights
        share = 1.0 - len(x) / np.sum(known)  # parameters take so much of the residuals away
        weights = np.sqrt(np.nanmean(off**2, axis=0) / share)
        weights = np.where(weights > 0.0, weights, before)
        if len(weights) == 1 or np.all(np.abs(weights - before) <= AGREE * weights):
            break
    J = solution.jac * (before / weights)[np.nonzero(problem.known)[1], None]  # the weights may have changed since
    return _found(problem, x, solution, J, weights, noise is None)


def _found(problem: _Problem, x: Real, solution: Any, J: Real, weights: Real, estimated: bool) -> Fit:
    made = problem.run(x)
    off = np.where(problem.known, problem.seen(made) - problem.data.values, np.nan)
    covariance, unseen = _covariance(J, x)
    sigma = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore"):
        correlation = covariance / np.outer(sigma, sigma)
    hidden = tuple(name for name, is_hidden in zip(problem.names, unseen, strict=True) if is_hidden)
    return Fit(
        problem.names, x * problem.scales, sigma * problem.scales,
        covariance * np.outer(problem.scales, problem.scales), correlation, hidden, problem.data.t,
        problem.data.channels, off, weights, estimated,
        float(np.nansum((off / weights) ** 2)), int(np.sum(problem.known)) - len(x), made.scene,
        made.trajectory, problem.runs,
        str(solution.message),
    )  # fmt: skip


def _covariance(J: Real, x: Real) -> tuple[Real, Any]:
    """(J'J)^-1 (P,P), and which parameters (P,) are not identifiable; their variances are infinite."""
    size = np.where(np.abs(x) > 0.0, np.abs(x), 1.0)
    _, values, vectors = np.linalg.svd(J * size, full_matrices=True)
    values = np.r_[values, np.zeros(len(x) - len(values))]
    seen = values > UNSEEN * max(float(values[0]), np.finfo(float).tiny)
    unseen = np.max(np.abs(vectors[~seen]), axis=0, initial=0.0) > INVOLVED
    kept = vectors[seen] / values[seen, None]
    covariance = (kept.T @ kept) * np.outer(size, size)
    covariance[unseen] = covariance[:, unseen] = np.nan
    covariance[unseen, unseen] = np.inf
    return covariance, unseen


def _by_time(known: Any, row: Real) -> Real:
    slopes = np.full(known.shape, np.nan)
    slopes[known] = row
    return slopes


def _rms(values: Real) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _limits(
    bounds: Mapping[str, tuple[float, float]], names: Sequence[str], start: Real, scales: Real
) -> tuple[Real, Real]:
    """Lower and upper limits (P,) of the scaled parameters; ValueError for others than make sense."""
    lower, upper = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    for name, pair in bounds.items():
        if name not in names:
            raise ValueError(f'bounds: "{name}" is not fitted: {closest(name, names)}')
        k = names.index(name)
        low, high = (arguments.vector(f'bounds["{name}"]', pair, 2) / scales[k]).tolist()
        if not low < high:
            raise ValueError(f'bounds["{name}"] are {pair}: give the lower one, then the upper one')
        if not low <= start[k] <= high:
            raise ValueError(
                f'bounds["{name}"] are {pair}, but the search starts at {start[k] * scales[k]:g}, the value of the '
                "scene: change either"
            )
        lower[k], upper[k] = low, high
    return lower, upper


def _given_noise(sigma: float | Mapping[str, float] | None, channels: Sequence[str]) -> Real | None:
    """Sigmas (K,) of all channels; ValueError for one that is missing or not positive."""
    if sigma is None:
        return None
    if not isinstance(sigma, Mapping):
        sigma = dict.fromkeys(channels, sigma)
    for name in sigma:
        if name not in channels:
            raise ValueError(f'sigma: there is no channel "{name}" in the data: {closest(name, channels)}')
    missing = [name for name in channels if name not in sigma]
    if missing:
        raise ValueError(f'sigma: none is given for "{missing[0]}": give one for each channel')
    sizes = np.array([arguments.number(f'sigma["{name}"]', sigma[name]) for name in channels])
    if not np.all(sizes > 0.0):
        raise ValueError("sigma: every standard deviation must be positive")
    return sizes


def _refuse_unknown_channels(trajectory: Trajectory, channels: Sequence[str]) -> None:
    known = [name for name, _, _ in trajectory.columns()]
    for name in channels:
        if name not in known:
            raise ValueError(f'data: a run has no channel "{name}": {closest(name, known)}')


def _refuse_unfinished(trajectory: Trajectory) -> None:
    if not trajectory.finished:
        raise DynamicsError(f"the run with the values of the scene does not finish: {trajectory.message}")


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """One line for each row; the first column is aligned to the left, all others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))]).rstrip()
        for row in rows
    ]
