"""Verdicts on two results in a channel, given their numerical uncertainties.

E = max |a - b| over the run and U = U_a + U_b. **agree**: E <= U and U within the goal. **differ**: E > U.
**unresolved**: E <= U but U above the goal, so that inaccurate runs cannot agree; or U, goal or scale are invalid.
If there is nothing to compare, the status is that of the graver of the two runs. **refused**: an engine cannot
represent the scene or does not offer the channel. **diverged**: by the engine's statement, which says when. **failed**:
the adapter raised, broke the contract, or gave values that are not finite. **did not finish**: it exceeded its limit of
time or memory. **crashed**: its process died. **did not run**: an engine or a result that was asked for is missing. The
last three are never as expected.
E, U and the goal are relative to the channel's range (or to the scale that the case states). If that range is below U,
the signal is zero within its uncertainty, and the range of its family (say, all hinge torques) is used.

Every input has a verdict, and a number that is not finite, or not positive where it must be, never leads to agreement.
Conditions therefore test whether a requirement holds, never whether it fails: every comparison with NaN is false.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Literal, get_args

import msgspec
import numpy as np

from crosscheck.engines.openness import Openness
from crosscheck.judging.sizes import size_of
from crosscheck.judging.uncertainty import Uncertainty
from crosscheck.library.accepted import Figure
from flexmb.run.channels import distance, family, signal_range
from flexmb.typing import Real

Status = Literal[
    "agree",
    "differ",
    "unresolved",
    "refused",
    "diverged",
    "failed",
    "did not finish",
    "crashed",
    "did not run",
]
VerdictKind = Literal["comparison", "control", "conservation"]
STATUSES: tuple[Status, ...] = get_args(Status)
# From the gravest: the first stands for several.
SEVERITY: tuple[Status, ...] = (
    "did not run", "crashed", "did not finish", "failed", "diverged", "refused", "differ", "unresolved", "agree",
)  # fmt: skip
NEVER_EXPECTED = ("did not finish", "crashed", "did not run")
NOT_DETERMINED = "not determined: closures are redundant, and infinitely many loads go with the same motion"
WORSE = "worse than recorded"
STALE = "stale figure ({}; accept anew by crosscheck run {} --accept)"
WHOLE_RANGE = 1.0  # the largest goal


class Verdict(msgspec.Struct, frozen=True, kw_only=True):
    """One judged channel of one comparison; the records of verdicts.json. `scale` is in the channel's SI unit.

    `outside` says how a result with the expected status is outside the bounds of the case. `accepted` are the accepted
    figures, `worse` says how E or U has grown since, `stale` what has changed since, and `basis` identifies how E and U
    were found (`crosscheck.judging.basis`). `case_goal` is the goal of the case where an engine claims another one, for
    the reason `goal_reason`; `own_failure` is the place where the user expects this failure, "" if it is the case that
    says what is expected (`crosscheck.library.claims`). `advice` is what to do about a U that is too large.
    """

    case: str
    comparison: str
    kind: VerdictKind
    channel: str
    variant_a: str
    engine_a: str
    variant_b: str
    engine_b: str
    level: str
    status: Status
    expected: Status
    E: float | None
    U: float | None
    goal: float
    scale: float | None
    reason: str
    expected_reason: str = ""
    outside: str = ""
    accepted: Figure | None = None
    worse: str = ""
    stale: str = ""
    basis: str = ""
    case_goal: float | None = None
    goal_reason: str = ""
    own_failure: str = ""
    advice: str = ""

    @property
    def loosened(self) -> bool:
        """Whether it was judged by a goal that is looser than that of the case."""
        return self.case_goal is not None and not self.goal <= self.case_goal

    @property
    def grown(self) -> str:
        """How E or U has grown beyond the accepted figure, and whether that figure is stale; "" if it has not."""
        if not self.worse:
            return ""
        return f"{STALE.format(self.stale, self.case)}: {self.worse}" if self.stale else f"{WORSE}: {self.worse}"

    @property
    def sides(self) -> tuple[tuple[str, str], tuple[str, str]]:
        """Variant and engine of each side."""
        return (self.variant_a, self.engine_a), (self.variant_b, self.engine_b)

    @property
    def pair(self) -> str:
        if self.variant_a == self.variant_b:
            return f"{self.engine_a} – {self.engine_b}"
        return f"{self.engine_a} ({self.variant_a}) – {self.engine_b} ({self.variant_b})"

    @property
    def ok(self) -> bool:
        """Whether it is as the case expects, within its bounds; a crash or a missing run never is."""
        return self.status == self.expected and not self.outside and self.status not in NEVER_EXPECTED


@dataclass(frozen=True)
class Ending:
    """How an unfinished run ended, and the last sample time (s) that it reached, if any."""

    status: Status
    reason: str
    reached_s: float | None = None


@dataclass(frozen=True)
class Finding:
    """A status with its relative figures and the reason in words; `endings` are those of unfinished runs."""

    status: Status
    reason: str
    E: float | None = None
    U: float | None = None
    scale: float | None = None
    endings: tuple[Ending, ...] = ()


@dataclass(frozen=True)
class Signal:
    """One channel of one result: values (T, k), U, and the sizes (SI) of `crosscheck.judging.sizes.Sizes.of`."""

    values: Real
    uncertainty: Uncertainty
    sizes: tuple[float, ...]


def compare(channel: str, a: Signal, b: Signal, goal: float, scale: float | None = None) -> Finding:
    """Judge two finished signals on the same times; `scale` replaces the larger of their ranges. Never raises."""
    nothing = _incomparable(a.values, b.values) or _unmeasurable(a, b, goal, scale)
    if nothing is not None:
        return nothing
    error = float(np.max(distance(channel, a.values, b.values)))
    total = a.uncertainty.value + b.uncertainty.value
    if not np.isfinite(error):
        return Finding("failed", "the results are so large that their distance is not finite")
    if error == total == 0.0:
        return Finding("agree", "the results are equal to the last digit", 0.0, 0.0, scale)
    size = scale if scale is not None else _size(channel, a, b, total)
    if not 0.0 < size < np.inf:
        return Finding("unresolved", f"the signal's size is {size:g}: the case must state a scale for this channel")
    with np.errstate(over="ignore"):
        apart, doubt = (float(np.float64(number) / size) for number in (error, total))
    if not np.isfinite(apart):
        return Finding("unresolved", f"the distance {error:.2g} is beyond measure in units of the scale {size:.2g}")
    if error > total:
        beyond = f"{error / total:.3g} x their uncertainty" if total > 0.0 else "with no uncertainty to excuse it"
        return Finding("differ", f"the results are {apart:.2g} of the range apart, {beyond}", apart, doubt, size)
    if not doubt <= goal:
        cause = max((a, b), key=lambda signal: signal.uncertainty.value).uncertainty.how
        text = f"uncertainty {doubt:.2g} exceeds the goal {goal:.2g}; largest part: {cause}"
        return Finding("unresolved", text, apart, doubt, size)
    return Finding("agree", f"{apart:.2g} of the range apart, within the uncertainty {doubt:.2g}", apart, doubt, size)


def not_determined() -> Finding:
    """The finding on a channel that the motion of the scene does not determine; it is not compared."""
    return Finding("refused", NOT_DETERMINED)


def determined(channel: str, signal: Signal, is_open: Openness) -> Signal:
    """A signal projected on the components that are not open: the others are 0, as `Result.values` has them."""
    return replace(signal, values=is_open.filled(channel, signal.values, 0.0)) if channel in is_open else signal


def with_open(finding: Finding, channel: str, is_open: Openness) -> Finding:
    """The finding on the determined components of a channel, whose reason names the others."""
    if channel not in is_open or finding.E is None:
        return finding
    return replace(finding, reason=f"{finding.reason}; {is_open.components(channel)} not determined and not compared")


def conserve(drift: Real, scale: float, limit: float) -> Finding:
    """Judge a conserved quantity: drift (T,) in SI relative to `scale` against `limit`, at its worst. Never raises."""
    if drift.size == 0 or not np.all(np.isfinite(drift)):
        return Finding("failed", "the quantity holds values that are not numbers, or none at all")
    if not 0.0 < limit <= WHOLE_RANGE:
        return Finding("unresolved", f"a limit of {limit:g} is no limit: it must lie between 0 and 1")
    if not 0.0 < scale < np.inf:
        text = f"the quantity's size is {scale:g}: the case must state a scale to measure drift by"
        return Finding("unresolved", text)
    with np.errstate(over="ignore"):
        worst = float(np.max(np.abs(drift)) / scale)
    if not np.isfinite(worst):
        return Finding("unresolved", f"the drift is beyond measure in units of the scale {scale:.2g}")
    if worst > limit:
        return Finding("differ", f"drifts by {worst:.2g}, more than the limit {limit:.2g}", worst, scale=scale)
    return Finding("agree", f"drifts by {worst:.2g}, within the limit {limit:.2g}", worst, scale=scale)


def _incomparable(a: Real, b: Real) -> Finding | None:
    """The finding if the values cannot be subtracted; else None."""
    if a.ndim != 2 or a.shape != b.shape:
        return Finding("failed", f"the results are of different shapes, {a.shape} and {b.shape}: samples by components")
    if a.size == 0:
        return Finding("failed", "the results hold no values at all")
    if not (np.all(np.isfinite(a)) and np.all(np.isfinite(b))):
        return Finding("failed", "a result holds values that are not numbers")
    return None


def _unmeasurable(a: Signal, b: Signal, goal: float, scale: float | None) -> Finding | None:
    """The finding if U, goal, scale or sizes are invalid; else None."""
    for uncertainty in (a.uncertainty, b.uncertainty):
        if not uncertainty.value >= 0.0:
            return Finding("unresolved", f"an uncertainty of {uncertainty.value:g} is none: {uncertainty.how}")
    if not 0.0 < goal <= WHOLE_RANGE:
        return Finding("unresolved", f"a goal of {goal:g} is none: it must lie between 0 and 1")
    if scale is not None and not 0.0 < scale < np.inf:
        return Finding("unresolved", f"a scale of {scale:g} is none: it must be positive and finite")
    if not all(0.0 <= size < np.inf for size in (*a.sizes, *b.sizes)):
        return Finding("unresolved", f"the sizes of the signals, {(*a.sizes, *b.sizes)}, are not all finite")
    return None


def _size(channel: str, a: Signal, b: Signal, total: float) -> float:
    """Range (SI) of the two signals, or another of their sizes if the range is below `total`, the sum of their U.

    Kinds of energy are converted into each other: their size is always that of the largest kind.
    """
    own = max(signal_range(channel, a.values), signal_range(channel, b.values))
    further = [max(pair) for pair in zip_longest(a.sizes, b.sizes, fillvalue=0.0)]
    return size_of(0.0 if family(channel) == "energy" else own, further, total)
