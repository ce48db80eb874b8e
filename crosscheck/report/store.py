"""Series of numbers for the report: thinned, float32, base64, each stored once."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.judging.results import Result
from flexmb.typing import Real

SAMPLES = 201


class Store:
    """Series by number. `series[i]` is {"k": columns, "data": base64 of float32, row by row}."""

    def __init__(self) -> None:
        self.series: list[dict[str, Any]] = []
        self._signals: dict[tuple[int, str], int] = {}
        self._times: dict[bytes, int] = {}

    def times(self, times: Real) -> int:
        """Number of the thinned sample times."""
        key = times.tobytes()
        if key not in self._times:
            self._times[key] = self._add(times[_chosen(len(times))])
        return self._times[key]

    def signal(self, result: Result, channel: str) -> int:
        """Number of a thinned channel (T, k) of a result's last run."""
        key = (id(result), channel)
        if key not in self._signals:
            values = result.values(channel)
            self._signals[key] = self._add(values[_chosen(len(values))])
        return self._signals[key]

    def peaks(self, values: Real) -> int:
        """Number of a non-negative curve (T,), each thinned sample the largest since the one before."""
        chosen = _chosen(len(values))
        starts = np.concatenate([[0], chosen[:-1] + 1])
        return self._add(np.maximum.reduceat(values, starts))

    def _add(self, values: Real) -> int:
        table = values.reshape(len(values), -1)
        data = base64.b64encode(np.ascontiguousarray(table, dtype="<f4").tobytes()).decode()
        self.series.append({"k": table.shape[1], "data": data})
        return len(self.series) - 1


def _chosen(count: int) -> NDArray[np.intp]:
    """Indices of at most SAMPLES samples, first and last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, SAMPLES)).round().astype(np.intp))
