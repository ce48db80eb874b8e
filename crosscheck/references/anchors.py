"""Comparison of a reference with published numbers, within the uncertainties of both."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.interpolate import CubicSpline

from crosscheck.library.case import CaseError, PublishedNumber
from crosscheck.references.agreement import Agreed
from flexmb.run.channels import unit
from flexmb.typing import Real

COMPONENTS = {1: ("",), 3: ("x", "y", "z"), 4: ("w", "x", "y", "z")}


def meet(agreed: Agreed, anchors: Iterable[PublishedNumber]) -> None:
    """CaseError names every published number that the reference does not meet.

    Between samples the reference is interpolated by a cubic spline, whose error is estimated by leaving out every
    second sample.
    """
    problems = [text for place, anchor in enumerate(anchors) if (text := _fault(agreed, anchor, place))]
    if problems:
        raise CaseError("\n".join(problems))


def _fault(agreed: Agreed, anchor: PublishedNumber, place: int) -> str:
    """Why the number is not met; "" if it is."""
    where = f"provenance.toml, anchor {place + 1} ({anchor.channel}, {anchor.source})"
    if anchor.channel not in agreed.channels:
        return f"{where}: the reference has no such channel: correct its name, or add it to [reference] channels"
    rows = agreed.channels[anchor.channel]
    letters = COMPONENTS.get(rows.shape[1], tuple(map(str, range(rows.shape[1]))))
    if anchor.component not in letters:
        return f'{where}: there is no component "{anchor.component}": it is one of {", ".join(letters)}'
    if not agreed.times[0] <= anchor.t_s <= agreed.times[-1]:
        return f"{where}: {anchor.t_s:g} s is not within the reference, which ends at {agreed.times[-1]:g} s"
    value, doubt = _at(agreed.times, rows[:, letters.index(anchor.component)], anchor.t_s)
    known = anchor.uncertainty + agreed.known[anchor.channel].uncertainty + doubt
    if abs(value - anchor.value) <= known:
        return ""
    return (
        f"{where}: the number is {anchor.value:.10g} {unit(anchor.channel)} at {anchor.t_s:g} s and the reference has "
        f"{value:.10g}, {abs(value - anchor.value):.2g} away, where both together are known to {known:.2g}: find out "
        "which of the two is wrong"
    )


def _at(times: Real, values: Real, when: float) -> tuple[float, float]:
    """The value at a time, and the error of interpolation."""
    nearest = int(np.argmin(np.abs(times - when)))
    if abs(times[nearest] - when) <= 1e-9 * times[-1]:
        return float(values[nearest]), 0.0
    if len(times) < 8:
        return float(np.interp(when, times, values)), float(np.max(np.abs(np.diff(values))))
    value = float(CubicSpline(times, values)(when))
    every_second = [float(CubicSpline(times[first::2], values[first::2])(when)) for first in (0, 1)]
    return value, max(abs(sample - value) for sample in every_second)
