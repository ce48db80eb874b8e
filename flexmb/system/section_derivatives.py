"""Derivatives of section loads along directions.

The balance of a beam's parts is an analytic function of the motion of the bodies and of all loads. Their derivatives
are carried through it as imaginary parts that are negligible beside the real ones (complex step), exact to rounding.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexmb.system.observables import Observation
from flexmb.system.pushforward import Pushforward
from flexmb.system.section_loads import SectionBalance
from flexmb.typing import Real

SMALL = 2.0**-100
"""Of the imaginary parts: their squares vanish beside any real part, and products of a few do not underflow."""
_READ = {"body": ("pose_rotation", "pose_position", "velocity", "accel"), "port": ("r", "R")}


class _InLane:
    """A workspace of duals as complex numbers, whose imaginary parts are the derivatives in one lane."""

    def __init__(self, w: Any, lane: int) -> None:
        for table, names in _READ.items():
            setattr(self, table, {name: _complex(getattr(w, table)[name], lane) for name in names})
        for name in ("eta", "etad", "etadd", "function"):
            setattr(self, name, _complex(getattr(w, name), lane))


def _complex(duals: Any, lane: int) -> Any:
    return duals[..., 0] + 1j * SMALL * duals[..., lane]


def section_row(balance: SectionBalance, push: Pushforward, observation: Observation, lanes: slice) -> Real:
    """(6 X,lanes) derivatives of the section loads (X,6), for `Pushforward.derivatives`."""
    value, change = push.row(slice(0, 1))[:, 0], push.row(lanes)
    found = []
    for i, lane in enumerate(range(lanes.start, lanes.stop)):
        exerted: Any = observation.evaluation(value + 1j * SMALL * change[:, i])
        found.append(balance.transmitted(exerted, _InLane(push.w, lane)).imag.ravel() / SMALL)  # type: ignore[arg-type]
    return np.array(found).T
