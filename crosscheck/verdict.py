"""Verdicts: what can be said about two results on a channel, given their numerical uncertainties.

E = max |a - b| over the run and U = U_a + U_b. **agree**: E <= U and U within the goal. **differ**: E > U.
**unresolved**: E <= U but U above the goal, so that sloppiness cannot pass as agreement. **refused**: an engine cannot
represent the scene or does not offer the channel. **failed**: a run diverged or crashed. **did not run**: an engine or
a result that was asked for is missing. The last is never what was expected.
E, U and the goal are relative to the channel's range (or to the scale that the case states). Where that range lies
below U, the signal is zero as far as can be told, and the range of its family (say, all hinge torques) is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from crosscheck.uncertainty import Uncertainty
from flexmb.channels import distance, family, signal_range

Array = NDArray[np.float64]
Status = Literal["agree", "differ", "unresolved", "refused", "failed", "crashed", "did not finish", "did not run"]


class Verdict(msgspec.Struct, frozen=True, kw_only=True):
    """One judged channel of one comparison; the records of verdicts.json. `scale` is in the channel's SI unit."""

    case: str
    comparison: str
    kind: Literal["comparison", "control", "conservation"]
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

    @property
    def ok(self) -> bool:
        """Whether it came out as the case expects; what did not run never does."""
        return self.status == self.expected and self.status != "did not run"


@dataclass(frozen=True)
class Finding:
    """A status with its numbers (relative) and a reason a reader understands."""

    status: Status
    reason: str
    E: float | None = None
    U: float | None = None
    scale: float | None = None


@dataclass(frozen=True)
class Signal:
    """One channel of one result: values (T, k), U, and further sizes (SI) for a signal that is zero within U.

    `sizes`: the largest range in the channel's family (say, all hinge torques); for torques then the largest force
    times the extent of the scene, since a torque that vanishes is the balance of forces at such distances.
    """

    values: Array
    uncertainty: Uncertainty
    sizes: tuple[float, ...]


def compare(channel: str, a: Signal, b: Signal, goal: float, scale: float | None = None) -> Finding:
    """Judge two finished signals on the same times; `scale` replaces the larger of their ranges."""
    error = float(np.max(distance(channel, a.values, b.values)))
    total = a.uncertainty.value + b.uncertainty.value
    if not np.isfinite(error):
        return Finding("failed", "a result holds values that are not numbers")
    if error == total == 0.0:
        return Finding("agree", "the results are equal to the last digit", 0.0, 0.0, scale)
    size = scale if scale is not None else _size(channel, a, b, total)
    if size <= 0.0:
        return Finding("unresolved", "the signal is zero throughout: the case must state a scale for this channel")
    apart, doubt = error / size, total / size
    if apart > doubt:
        beyond = f"{apart / doubt:.3g} x their uncertainty" if doubt > 0.0 else "with no uncertainty to excuse it"
        return Finding("differ", f"the results are {apart:.2g} of the range apart, {beyond}", apart, doubt, size)
    if doubt > goal:
        cause = max((a, b), key=lambda signal: signal.uncertainty.value).uncertainty.how
        text = f"uncertainty {doubt:.2g} exceeds the goal {goal:.2g}; largest part: {cause}"
        return Finding("unresolved", text, apart, doubt, size)
    return Finding("agree", f"{apart:.2g} of the range apart, within the uncertainty {doubt:.2g}", apart, doubt, size)


def conserve(drift: Array, scale: float, limit: float) -> Finding:
    """Judge a conserved quantity: drift (T,) in SI relative to `scale` against `limit`."""
    if not np.all(np.isfinite(drift)):
        return Finding("failed", "the quantity holds values that are not numbers")
    if scale <= 0.0:
        return Finding("unresolved", "the quantity is zero throughout: the case must state a scale to measure drift by")
    worst = float(np.max(np.abs(drift))) / scale
    if worst > limit:
        return Finding("differ", f"drifts by {worst:.2g}, more than the limit {limit:.2g}", worst, limit, scale)
    return Finding("agree", f"drifts by {worst:.2g}, within the limit {limit:.2g}", worst, limit, scale)


def _size(channel: str, a: Signal, b: Signal, total: float) -> float:
    """Range of the two signals, or the first of their further sizes above `total`, their uncertainty (SI).

    Kinds of energy turn into each other: their size is always that of the largest of them.
    """
    own = max(signal_range(channel, a.values), signal_range(channel, b.values))
    further = [max(pair) for pair in zip(a.sizes, b.sizes, strict=True)]
    candidates = further if family(channel) == "energy" else [own, *further]
    return next((size for size in candidates if size > total), max(candidates))
