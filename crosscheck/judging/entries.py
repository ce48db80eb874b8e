"""Which number of a matrix of derivatives, or of a list of frequencies, two results are farthest apart in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from crosscheck.engines.linear.parts import FREQUENCIES
from crosscheck.judging.verdict import Finding
from crosscheck.records.kinds import VariantInfo
from flexmb.typing import Real

SYMBOL = {
    "derivatives.by_displacement": "xi",
    "derivatives.by_speed": "u",
    "derivatives.by_force": "tau",
}
"""By what a channel differentiates the accelerations."""


def coordinates_of(info: VariantInfo | None) -> tuple[str, ...]:
    """Names of a variant's coordinates; none where it asks for no derivatives."""
    return info.coordinates if info is not None and isinstance(info.coordinates, tuple) else ()


def with_worst_entry(finding: Finding, channel: str, a: Real, b: Real, times: Real, names: Sequence[str]) -> Finding:
    """The finding on two signals (T, k), whose reason names the entry in which they are farthest apart."""
    if finding.E is None or not finding.E > 0.0 or not (channel in SYMBOL or channel == FREQUENCIES):
        return finding
    apart = np.abs(a - b)
    sample, number = np.unravel_index(int(np.argmax(apart)), apart.shape)
    what, most = entry(channel, int(number), a.shape[1], names), float(apart[sample, number])
    where = f"{what} = {float(a[sample, number]):.6g} at t = {times[sample]:g} s"
    return replace(finding, reason=f"{finding.reason}; farthest apart, by {most:.2g}, is {where}")


def entry(channel: str, number: int, count: int, names: Sequence[str]) -> str:
    """The name of a column of such a channel of `count` columns, such as "d udot[elbow.rotation]/d u[slide.x]"."""
    if channel == FREQUENCIES:
        return f"frequency {number + 1} of {count}"
    n = int(np.sqrt(count))
    row, column = divmod(number, n)
    labels = names if len(names) == n else [str(k + 1) for k in range(n)]
    return f"d udot[{labels[row]}]/d {SYMBOL[channel]}[{labels[column]}]"
