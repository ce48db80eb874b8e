"""Bounds of an expectation: of the size of a difference, the time of a divergence, the reason of a failure or refusal.

Without them an expectation would still be met if the difference grew a hundredfold or the run ended at once.
"""

from __future__ import annotations

from crosscheck.judging.verdict import Finding
from crosscheck.library.case import Band, Comparison, Conservation
from crosscheck.library.patterns import most_specific


def outside(item: Comparison | Conservation, channel: str, finding: Finding) -> str:
    """How a finding with the expected status is outside the bounds of `item`; "" if it is within them."""
    match item.expect:
        case "differ":
            return _beyond("E", finding.E, _band(item, channel))
        case "unresolved":
            return _beyond("U", finding.U, _band(item, channel))
        case "diverged":
            times = [ending.reached_s for ending in finding.endings if ending.status == "diverged"]
            found = [_beyond("the time reached (s)", time, item.diverged_s) for time in times or [None]]
            return next(filter(None, found), "")
        case "failed" | "refused":
            return _unlike(item.because, [each.reason for each in finding.endings] or [finding.reason])
    return ""


def _band(item: Comparison | Conservation, channel: str) -> Band | None:
    if isinstance(item, Conservation):
        return item.band
    pattern = most_specific(item.band, channel)
    return item.band[pattern] if pattern is not None else None


def _beyond(what: str, figure: float | None, band: Band | None) -> str:
    if band is None:
        return f"the case sets no bounds to {what}"
    low, high = band
    if figure is None:
        return f"there is no figure for {what}, expected is {low:.3g} to {high:.3g}"
    return "" if low <= figure <= high else f"{what} = {figure:.3g} is outside the expected {low:.3g} to {high:.3g}"


def _unlike(because: str, reasons: list[str]) -> str:
    if not because:
        return "the case sets no bounds to the reason"
    return "" if all(because in reason for reason in reasons) else f'the expected reason is "{because}"'
