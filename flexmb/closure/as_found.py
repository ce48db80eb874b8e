"""A closure that closes as it is found: its frame B is moved on its body, so that no body has to move."""

from __future__ import annotations

from math import atan2

import numpy as np
from msgspec.structs import replace

from flexmb.building.links import closure_sides
from flexmb.closure.constants import SUPPRESSED
from flexmb.scene.quaternions import quaternion_of, rotation_by, rotation_matrix
from flexmb.scene.schema import Closure
from flexmb.typing import Real


def as_found(closure: Closure, R: Real, p: Real) -> Closure:
    """The closure with its frame B at the nearest place to which it lets B move from A.

    R (3,3) = R_AB and p (3,) m of B from A are the pose in which it is found, in axes in which the closure's axis is z.
    What it does not suppress stays: B keeps its place along a slide and its angle about a pin.
    """
    turns, shifts = SUPPRESSED[closure.type]
    turn = closure_sides(closure)[1].turn
    on_body = rotation_matrix(closure.quaternion_b) @ turn @ R.T  # from axes of A to those of the node
    shift = on_body @ np.where([axis in shifts for axis in "xyz"], -p, 0.0)
    place = (np.array(closure.position_b_m) + shift).tolist()
    quaternion = quaternion_of(on_body @ _allowed(turns, R) @ turn.T).tolist()
    return replace(closure, position_b_m=tuple(place), quaternion_b=tuple(quaternion))


def _allowed(turns: str, R: Real) -> Real:
    """The rotation nearest to R that a closure allows which suppresses these turns."""
    match turns:
        case "":
            return R
        case "xyz":
            return np.eye(3)
        case "xy":
            return rotation_by((0.0, 0.0, atan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])))
        case "z":  # y of B is across x of A
            y = R[:, 1]
            across = y * (0.0, 1.0, 1.0) / np.linalg.norm(y[1:])
            axis = np.cross(y, across)
            sine = float(np.linalg.norm(axis))
            return rotation_by(axis / sine * atan2(sine, float(y @ across))) @ R if sine > 0.0 else R
        case _:
            raise AssertionError(f"no closure suppresses the turns {turns!r} alone")
