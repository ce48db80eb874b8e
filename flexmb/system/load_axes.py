"""Loads across hinges in axes other than World's, and about points other than the hinge points."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from flexmb.system.frames import MotionTables, hinge_frames, node_pose
from flexmb.system.scene_arrays import SceneArrays
from flexmb.tables import arguments
from flexmb.typing import Real

Axes = Literal["world", "inboard", "outboard"]


def referred(
    arrays: SceneArrays, w: MotionTables, loads: dict[str, Real], axes: Axes, about: tuple[str, str] | None
) -> dict[str, Real]:
    """Loads (6,) of hinges and closures, World axes about their own points, in other axes about a node.

    `w` is at the state of the loads. ValueError for unknown axes or an unknown node.
    """
    arguments.one_of("axes", axes, get_args(Axes))
    if axes == "world" and about is None:
        return loads
    frames = hinge_frames(arrays, w)
    point = None if about is None else _node(arrays, w, about)
    found = {}
    for name, load in loads.items():
        torque, force = load[:3], load[3:]
        if point is not None:
            torque = torque + np.cross(frames[name].point - point, force)
        if axes != "world":
            back = getattr(frames[name], axes).T
            torque, force = back @ torque, back @ force
        found[name] = np.concatenate([torque, force])
    return found


def _node(arrays: SceneArrays, w: MotionTables, about: tuple[str, str]) -> Real:
    if isinstance(about, str) or len(about) != 2:
        raise ValueError(f"about is {about!r}: give body and node, such as ('panel', 'tip')")
    return node_pose(arrays, w, *about).position
