"""The ends of closures and of connectors between nodes: frame A and frame B."""

from __future__ import annotations

from typing import NamedTuple

from flexmb.scene.bodies import IDENTITY, Quaternion, Vector
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.hinges import Closure


class EndFrame(NamedTuple):
    """A frame with fixed offsets from a node of a body, in node axes, or from World where `body` is the ground."""

    body: str
    node: str
    position_m: Vector
    quaternion: Quaternion


def ends(item: Closure | BetweenNodes) -> tuple[EndFrame, EndFrame]:
    """Frames A and B; where the item joins points only, the frames have the axes of their nodes."""
    return _end(item, "a"), _end(item, "b")


def _end(item: Closure | BetweenNodes, side: str) -> EndFrame:
    return EndFrame(
        getattr(item, f"body_{side}"),
        getattr(item, f"node_{side}"),
        getattr(item, f"position_{side}_m"),
        getattr(item, f"quaternion_{side}", IDENTITY),
    )
