"""The lists of all laws along coordinates but springs, and between frames. A law's number is its place in its list."""

from __future__ import annotations

from collections.abc import Sequence

from flexmb.connectors import bushings, friction, line
from flexmb.connectors.law import CoordinateLaw, FrameLaw
from flexmb.jit.numbered import numbered
from flexmb.scene.connectors import AlongHinge, BetweenNodes
from flexmb.tables.features import FRAME_LAW, LAW

LAWS: tuple[CoordinateLaw, ...] = (friction.LAW,)
FRAME_LAWS: tuple[FrameLaw, ...] = (line.LAW, bushings.LAW)

load = numbered("load", LAW, [law.load for law in LAWS])
load_between_frames = numbered("load_between_frames", FRAME_LAW, [law.load for law in FRAME_LAWS])


def law_of(connector: AlongHinge) -> tuple[int, tuple[float, ...]]:
    """The number of the law that a connector along a coordinate has, and its parameters."""
    return _taking(connector, [law.parameters(connector) for law in LAWS])


def frame_law_of(connector: BetweenNodes) -> tuple[int, tuple[float, ...]]:
    """The number of the law that a connector between frames has, and its parameters."""
    return _taking(connector, [law.parameters(connector) for law in FRAME_LAWS])


def _taking(
    connector: AlongHinge | BetweenNodes, offered: Sequence[tuple[float, ...] | None]
) -> tuple[int, tuple[float, ...]]:
    """The first law that offers parameters for the connector."""
    for number, parameters in enumerate(offered):
        if parameters is not None:
            return number, parameters
    raise TypeError(f"no law of flexmb.connectors takes a {type(connector).__name__}: {connector.name}")
