"""States at which accelerations exist, but no derivatives: where the law of a connector has a corner."""

from __future__ import annotations

import numpy as np

from flexmb.building.connector_arrays import along_hinges, between_nodes
from flexmb.system.scene_arrays import SceneArrays
from flexmb.tables.arrays import BOTH, Constants, Workspace
from flexmb.tables.state import DynamicsError
from flexmb.tables.status import Status

ROUNDINGS = 8.0 * 2.0**-52
"""Relative distance from a corner within which rounding decides on which side of it a state is."""


class NotDifferentiableError(DynamicsError):
    """The accelerations exist at this state, but their derivatives do not; the message names the connector."""

    status = Status.OK


def has_corners(c: Constants) -> bool:
    """Whether a law of a scene has corners: a stop, or a connector that becomes slack."""
    return bool(np.any(c.hinge_spring["stop_stiffness"] > 0.0) or np.any(c.connector["acts"] != BOTH))


def refuse_kinks(arrays: SceneArrays, w: Workspace) -> None:
    """NotDifferentiableError where a coordinate just meets a stop, or a one-sided connector is just slack.

    w: a workspace in which connectors were evaluated at the state. Where functions of time have corners, derivatives
    by time are those on the side that the function itself belongs to.
    """
    c = arrays.constants
    for spring, row in zip(along_hinges(arrays.scene)[0], c.hinge_spring, strict=True):
        q = float(w.q[c.speed["coordinate"][row["speed"]]])
        for limit in (float(row["lower"]), float(row["upper"])):
            if row["stop_stiffness"] > 0.0 and meets(q, limit, abs(limit)):
                raise _at_corner(spring.name, "its coordinate is exactly at a stop, where the load has a corner")
    for i, connector in enumerate(between_nodes(arrays.scene)):
        row = c.connector[i]
        if row["acts"] != BOTH:
            length = float(np.hypot(np.linalg.norm(w.connector["arm"][i]), row["smoothing"]))
            slack = float(row["free_length"] + c.law[row["start"] + 1, 0])  # the second of its two pieces begins there
            if meets(length, slack, abs(row["free_length"]) + length):
                raise _at_corner(connector.name, "it has exactly the length at which it becomes slack")


def meets(x: float, corner: float, size: float) -> bool:
    """Whether x is at a corner of a law, as far as rounding of numbers of this size lets one say."""
    return abs(x - corner) <= ROUNDINGS * size


def _at_corner(name: str, why: str) -> NotDifferentiableError:
    return NotDifferentiableError(
        f'connector "{name}" has no derivative at this state: {why}. Derivatives exist on either side: move the state '
        "by a small amount"
    )
