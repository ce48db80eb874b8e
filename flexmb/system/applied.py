"""Forces and torques that act on nodes of bodies from outside: the `loads` of a scene, in World axes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flexmb.scene.schema import Load
from flexmb.system.frames import MotionTables, link_pose
from flexmb.system.scene_arrays import SceneArrays
from flexmb.tables.arrays import NODE_AXES, TORQUE
from flexmb.typing import Real


class Applied(NamedTuple):
    """A load of the scene at one state: torque (3,) N m and force (3,) N about the point (3,) m of its node."""

    load: Load
    torque: Real
    force: Real
    point: Real


def applied_to(arrays: SceneArrays, w: MotionTables, k: int) -> Iterator[Applied]:
    """The loads on body k, of the motion and the functions of time that the workspace has; they may be complex."""
    constants, carrier, none = arrays.constants, link_pose(w, k), np.zeros(3)
    name = arrays.body_names[k]
    rows = range(int(constants.body[k]["load_start"]), int(constants.body[k]["load_stop"]))
    for load, row in zip((load for load in arrays.scene.loads if load.body == name), rows, strict=True):
        table = constants.load[row]
        port, value = table["port"], w.function[table["function"], 0] * table["direction"]
        if table["frame"] == NODE_AXES:
            value = carrier.rotation @ w.port["R"][port].reshape(3, 3) @ value
        torque, force = (value, none) if table["type"] == TORQUE else (none, value)
        yield Applied(load, torque, force, carrier.position + carrier.rotation @ w.port["r"][port])


def applied_loads(arrays: SceneArrays, w: MotionTables) -> dict[str, Real]:
    """All loads of the scene by name (6,) [torque; force] about their nodes, World axes."""
    return {
        applied.load.name: np.concatenate([applied.torque, applied.force])
        for k in range(len(arrays.links))
        for applied in applied_to(arrays, w, k)
    }
