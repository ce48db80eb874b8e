"""Loads across hinges in axes other than World's, and about points other than the hinge points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

from flexmb.scene.schema import Scene
from flexmb.scene.tree import joined_bodies
from flexmb.system.frames import MotionTables, hinge_frames, node_pose
from flexmb.system.scene_arrays import SceneArrays
from flexmb.tables import arguments
from flexmb.typing import Real

Axes = Literal["world", "inboard", "outboard"]
Redundant = Literal["open", "least_norm"]
"""What is given for loads that the motion does not determine: NaN, or those of the least loads of closures."""


def held_by(scene: Scene, joints: Sequence[str], on: str) -> dict[str, float]:
    """The signs with which the loads of some hinges and closures act on a body, by name; ValueError for others."""
    if isinstance(joints, str) or len(set(joints)) < max(1, len(joints)):
        raise ValueError(f"joints is {joints!r}: give the names of hinges and closures, each once")
    sides = joined_bodies(scene)
    carriers = {}
    for name in joints:
        if name not in sides:
            raise ValueError(f"there is no hinge or closure {name!r}; there are {', '.join(sorted(sides))}")
        if on not in sides[name] or sides[name][0] == sides[name][1]:
            raise ValueError(f'"{name}" joins "{sides[name][0]}" and "{sides[name][1]}": its load on {on!r} is none')
        carriers[name] = 1.0 if on == sides[name][1] else -1.0
    return carriers


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
