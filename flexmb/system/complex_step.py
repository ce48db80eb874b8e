"""Derivatives along directions of what follows from the motion by analytic functions in NumPy.

Section loads are the balance of a beam's parts, and loads in other axes are loads turned and shifted: analytic
functions of the motion of the bodies and of all loads. Their derivatives are carried through as imaginary parts that
are negligible beside the real ones (complex step), exact to rounding.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from flexmb.system.load_axes import Axes, referred
from flexmb.system.observables import Observation
from flexmb.system.pushforward import Pushforward
from flexmb.system.scene_arrays import SceneArrays
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
    rows = [balance.transmitted(exerted, w).ravel() for exerted, w in _each(push, observation, lanes)]
    return np.array(rows).imag.T / SMALL


def load_row(
    arrays: SceneArrays, push: Pushforward, observation: Observation, seen: tuple[Axes, tuple[str, str] | None],
    lanes: slice,
) -> Real:  # fmt: skip
    """(6 n,lanes) derivatives of the loads of n hinges and closures in axes, about a node: those that are `seen`."""
    rows = [
        np.concatenate([*referred(arrays, w, exerted.loads, *seen).values()])
        for exerted, w in _each(push, observation, lanes)
    ]
    return np.array(rows).imag.T / SMALL


def _each(push: Pushforward, observation: Observation, lanes: slice) -> Iterator[tuple[Any, Any]]:
    """By lane, an evaluation and the motion of the bodies, in complex numbers."""
    value, change = push.row(slice(0, 1))[:, 0], push.row(lanes)
    for i, lane in enumerate(range(lanes.start, lanes.stop)):
        yield observation.evaluation(value + 1j * SMALL * change[:, i]), _InLane(push.w, lane)
