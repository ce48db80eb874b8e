"""Efforts that meet target errors: the ladder of a chart of speed against accuracy, tuned for one engine on one scene.

The efforts that are judged are chosen so that errors can be estimated, and are more accurate than most people need. A
chart also shows what a coarse answer costs. A target is met by an effort whose error lies between a tenth of it and the
target. Efforts are sought by interpolation between those tried, as error ~ value^p, from the coarsest target to the
finest, until a budget of processor time is spent. Where even the coarsest effort is more than ten times as accurate as
a target, the engine takes *at most* that effort's time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, log, sqrt
from typing import Literal, NamedTuple

from crosscheck.library.efforts import TIGHTEST, WITHIN, is_met
from flexmb.typing import Real

BUDGET_S = 1.0  # seconds of a processor that one engine spends on one variant for its charts
LOOSEST = 1e-2  # relative tolerance: some codes take no looser one
TRIES = 6  # efforts that are tried for one target
APART = 1.1  # ratio of values below which there is nothing between two efforts
ORDERS = {"tolerance": (0.3, 1.0, 2.0), "step": (0.5, 2.0, 8.0)}  # least, usual and largest p of error ~ value^p
FURTHEST = {"tolerance": 100.0, "step": 8.0}  # ratio of values in one extrapolation
DEARER = {"tolerance": 0.25, "step": 1.0}  # p of time ~ value^-p


class TriedEffort(NamedTuple):
    """An effort's value, the error of its run (infinite if it failed) and what it took of a processor (s)."""

    value: float
    error: float
    cpu_s: float


@dataclass(frozen=True)
class Asked:
    """A chart's observable, with what errors refer to: `values` (n, k) at the samples `places` (n,), their `scale`, and
    the part of it, `doubt`, to which they are certain. `known` are the runs that are judged, by kind and method."""

    observable: str
    places: Real
    values: Real
    scale: float
    doubt: float
    known: tuple[tuple[Literal["tolerance", "step"], str, tuple[TriedEffort, ...]], ...]


@dataclass(frozen=True)
class Charted:
    """What a job tunes efforts for; `done` is the key of the charts' runs that are recorded already, if any."""

    asked: tuple[Asked, ...]
    done: str = ""


@dataclass
class ProcessorBudget:
    """Seconds that are left for further runs."""

    left_s: float = BUDGET_S

    def spend(self, seconds: float) -> None:
        self.left_s -= seconds


def tune(
    solve: Callable[[float], float],
    tried: list[TriedEffort],
    kind: Literal["tolerance", "step"],
    coarsest: float,
    targets: Sequence[float],
    budget: ProcessorBudget,
    repeats: Callable[[float], int] = lambda seconds: 1,
) -> str:
    """Try efforts of one method until the targets are met, and add them to `tried`; returns why some are not.

    `solve(value)` runs an effort, appends it to `tried` and returns the seconds that this took; `coarsest` is the
    largest value that makes sense. `repeats` says how often a run of some seconds is made.
    """
    why = ""
    for target in sorted(targets, reverse=True):
        for _ in range(TRIES):
            if any(is_met(each.error, target) for each in tried):
                break
            value = _next(tried, target, kind, coarsest)
            if isinstance(value, str):
                why = f"{target:g}: {value}"
                break
            expected = _expected_s(tried, value, kind)
            if expected * repeats(expected) > budget.left_s:
                left_s = max(budget.left_s, 0.0)
                return f"{target:g}: the next run would take {expected:.2g} s, and {left_s:.2g} s are left"
            budget.spend(solve(value))
    return why


def _next(
    tried: Sequence[TriedEffort], target: float, kind: Literal["tolerance", "step"], coarsest: float
) -> float | str:
    """The value to try next for a target, or why there is none."""
    aim = target / sqrt(WITHIN)
    fine = max((each for each in tried if each.error <= target), default=None)
    least = 0.0 if fine is None else fine.value
    coarse = min((each for each in tried if each.error > target and each.value > least), default=None)
    if fine is not None and coarse is not None:
        return _between(fine, coarse, aim)
    if fine is not None:
        if fine.value >= coarsest / APART:
            return "the coarsest effort is more accurate"
        return _short(min(fine.value * _factor(tried, kind, aim / fine.error if fine.error > 0.0 else inf), coarsest))
    return _finer(tried, kind, aim)


def _between(fine: TriedEffort, coarse: TriedEffort, aim: float) -> float | str:
    """By error ~ value^p between two efforts, and not too near to either of them."""
    if coarse.value <= APART * fine.value:
        return "there is no effort between one that errs by less and one that errs by more"
    part = 0.5
    if 0.0 < fine.error < coarse.error < inf:
        part = min(max(log(aim / fine.error) / log(coarse.error / fine.error), 0.15), 0.85)
    return _short(fine.value * (coarse.value / fine.value) ** part)


def _finer(tried: Sequence[TriedEffort], kind: Literal["tolerance", "step"], aim: float) -> float | str:
    """Beyond the finest effort, unless its error is no longer that of its method."""
    finest, *others = sorted(tried)
    if others and finest.error * 1.5 > others[0].error and others[0].value > 1.5 * finest.value:
        return "finer efforts err no less"
    if kind == "tolerance" and finest.value <= TIGHTEST * APART:
        return "there is no finer tolerance"
    factor = _factor(tried, kind, finest.error / aim if finest.error < inf else inf)
    return _short(max(finest.value / factor, TIGHTEST if kind == "tolerance" else 0.0))


def _factor(tried: Sequence[TriedEffort], kind: Literal["tolerance", "step"], ratio: float) -> float:
    """The ratio of values that changes the error by `ratio`, from the two efforts whose errors are largest."""
    least, usual, largest = ORDERS[kind]
    known = sorted((each for each in tried if 0.0 < each.error < inf), reverse=True)[:2]
    order = usual
    if len(known) == 2 and known[0].value > known[1].value and known[0].error > known[1].error:
        order = log(known[0].error / known[1].error) / log(known[0].value / known[1].value)
    order = min(max(order, least), largest)
    return FURTHEST[kind] if ratio == inf else min(max(ratio ** (1.0 / order), 1.2), FURTHEST[kind])


def _expected_s(tried: Sequence[TriedEffort], value: float, kind: Literal["tolerance", "step"]) -> float:
    """The time of a run, from the effort that is nearest to it."""
    nearest = min(tried, key=lambda each: abs(log(each.value / value)))
    return nearest.cpu_s * float((nearest.value / value) ** DEARER[kind])


def _short(value: float) -> float:
    return float(f"{value:.3g}")

