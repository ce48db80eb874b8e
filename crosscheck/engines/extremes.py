"""Extremes of the channels of a run: over all of its steps, where the engine gives them, or of its samples.

The extremes of a channel of k columns are an array (ROWS, k): the least values, their times (s), the greatest values,
their times, and by how much they may be exceeded, which samples do not say (NaN). Vectors have one column more, their
magnitude.
"""

from __future__ import annotations

import numpy as np

from flexmb.run.channels import is_vector, norms
from flexmb.typing import Real

LEAST, T_LEAST, GREATEST, T_GREATEST, ERROR = range(5)
ROWS = 5


def has_extremes(channel: str) -> bool:
    """Whether extremes of a channel mean something: quaternions and derivatives have none."""
    return not channel.endswith(".orientation") and channel.partition(".")[0] not in ("derivatives", "known_to")


def width(channel: str, columns: int) -> int:
    """Number of columns of the extremes of a channel with so many columns."""
    return columns + int(is_vector(channel))


def components(channel: str, columns: int) -> list[str]:
    """Names of the columns of the extremes of a channel, of which it has so many."""
    if is_vector(channel):
        return ["x", "y", "z", "magnitude"]
    if columns == 3:
        return ["x", "y", "z"]
    return [""] if columns == 1 else [str(i) for i in range(columns)]


def of_samples(channel: str, times: Real, values: Real) -> Real:
    """Extremes (ROWS, k) of the samples (T, k) of a channel."""
    every = np.hstack([values, norms(values)[:, None]]) if is_vector(channel) else values
    low, high, each = np.argmin(every, axis=0), np.argmax(every, axis=0), np.arange(every.shape[1])
    unknown = np.full(len(each), np.nan)
    return np.array([every[low, each], times[low], every[high, each], times[high], unknown])


def fault(channel: str, found: Real, times: Real, values: Real) -> str:
    """What is wrong with the extremes of a channel whose samples (T, k) at times (T,) they must contain; "" if
    nothing."""
    wanted = (ROWS, width(channel, values.shape[1]))
    if found.shape != wanted:
        return f"has shape {found.shape}; {wanted} was expected"
    if not np.all(np.isfinite(found)) or np.any(found[ERROR] < 0.0):
        return "is not finite, or has a negative error"
    at = found[[T_LEAST, T_GREATEST]]
    if np.any(at < times[0]) or np.any(at > times[-1]):
        return "has a time outside the run"
    own = found[:, : values.shape[1]]
    if np.any(own[LEAST] > values.min(axis=0)) or np.any(own[GREATEST] < values.max(axis=0)):
        return "does not contain the run's own samples"
    return ""
