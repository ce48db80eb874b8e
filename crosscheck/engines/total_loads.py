"""Total loads of engines that know single loads only: their sums about a node, from the motion of the joints' points.

A scene names the sums that it wants (`total_loads`). Codes that share loads of redundant joints in ways of their own
agree on what the motion determines of the sums. The points at which loads are given, and the nodes about which they are
summed, get markers that no channel shows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from msgspec import structs

from crosscheck.engines.contract import Snapshot, Trajectory
from flexmb.scene.bodies import ZERO, Vector
from flexmb.scene.schema import Marker, Scene, TotalLoad
from flexmb.scene.tree import GROUND, joined_bodies
from flexmb.typing import Real

Answer = TypeVar("Answer", Snapshot, Trajectory)
Point = tuple[str, str, Vector]
"""Body, node, and offset (m) from it in its axes."""


@dataclass(frozen=True)
class SceneWithPoints:
    """A scene as an engine without total loads gets it, and the names of the markers at points that sums need."""

    scene: Scene
    given: Scene
    markers: Mapping[Point, str]

    @classmethod
    def of(cls, scene: Scene) -> SceneWithPoints:
        """The scene without its total loads, with markers at the points that have none."""
        markers = {(marker.body, marker.node, marker.offset_m): marker.name for marker in reversed(scene.markers)}
        taken, more = {marker.name for marker in scene.markers}, []
        joints = _joint_points(scene)
        wanted = [joints[name] for total in scene.total_loads for name in total.joints]
        for point in (*wanted, *map(_node_point, scene.total_loads)):
            if point[0] != GROUND and point not in markers:
                name = next(name for i in range(len(taken) + 1) if (name := f"point {i}") not in taken)
                taken.add(name)
                markers[point] = name
                body, node, offset = point
                more.append(Marker(name=name, body=body, node=node, offset_m=offset))
        return cls(scene, structs.replace(scene, total_loads=(), markers=(*scene.markers, *more)), markers)

    def told(self, answer: Answer) -> Answer:
        """What the engine answered, with the sums of loads that it gives as numbers, and the scene's markers alone."""
        joints = _joint_points(self.scene)
        found = {}
        for total in self.scene.total_loads:
            points = {name: joints[name] for name in total.joints}
            known = all(self._is_there(point, answer) for point in (*points.values(), _node_point(total)))
            if known and all(np.isfinite(answer.loads.get(name, np.nan)).all() for name in points):
                found[total.name] = self._sum(total, points, answer)
        own = {marker.name for marker in self.scene.markers}
        shown = {name: path for name, path in answer.markers.items() if name in own}
        return replace(answer, markers=shown, total_loads=found)

    def _is_there(self, point: Point, answer: Snapshot | Trajectory) -> bool:
        return point[0] == GROUND or self.markers[point] in answer.markers

    def _position(self, point: Point, answer: Snapshot | Trajectory) -> Real:
        """Where a point is (...,3), World axes."""
        return np.array(point[2]) if point[0] == GROUND else answer.markers[self.markers[point]].position

    def _sum(self, total: TotalLoad, points: Mapping[str, Point], answer: Snapshot | Trajectory) -> Real:
        """Torque about the node and force (...,6) of all joints on the body."""
        about, joined, rows = self._position(_node_point(total), answer), joined_bodies(self.scene), []
        for name in total.joints:
            sign = 1.0 if joined[name][1] == total.body else -1.0
            torque, force = np.split(np.asarray(answer.loads[name]), 2, axis=-1)
            arm = self._position(points[name], answer) - about
            rows.append(sign * np.concatenate([torque + np.cross(arm, force), force], axis=-1))
        return np.sum(rows, axis=0)


def _node_point(total: TotalLoad) -> Point:
    return total.body, total.node, ZERO


def _joint_points(scene: Scene) -> dict[str, Point]:
    """Where the loads of hinges and closures are given: on the outboard body, on `body_b`."""
    hinges = {hinge.name: (hinge.child, hinge.child_node, hinge.child_position_m) for hinge in scene.hinges}
    return hinges | {each.name: (each.body_b, each.node_b, each.position_b_m) for each in scene.closures}
