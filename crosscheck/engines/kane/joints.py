"""Joints: which two frames each holds together, and what its coordinate does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import assert_never

import numpy as np

from crosscheck.engines.conventions import rotation_matrix
from crosscheck.engines.functions_of_time import Profile, profile
from crosscheck.engines.kane.bodies import KaneBody, about_z
from crosscheck.engines.kane.frames import FramePlace, ShapedNode
from flexmb.scene.freedoms import AngularCoordinate, ScalarFreedom
from flexmb.scene.hinges import (
    Cylindrical,
    Free,
    Gimbal,
    Hinge,
    Planar,
    Prismatic,
    Revolute,
    Screw,
    Spherical,
    Universal,
    Weld,
)
from flexmb.scene.schema import Scene, Wheel
from flexmb.scene.tree import GROUND
from flexmb.typing import Real

_GROUND = ShapedNode(np.zeros(3), np.eye(3), np.zeros((3, 0)), np.zeros((3, 0)))


@dataclass(frozen=True)
class KaneJoint:
    """A weld, or a turn about the common z axis of both frames with a `coordinate`; `of` is its hinge or wheel."""

    of: Hinge | Wheel
    inboard: FramePlace
    outboard: FramePlace
    coordinate: AngularCoordinate | None

    @property
    def free(self) -> bool:
        """Whether its coordinate is an unknown."""
        return self.coordinate is not None and self.coordinate.prescribed_rad is None

    @property
    def motion(self) -> Callable[[float], Profile]:
        """The prescribed turn; none of a weld."""
        if self.coordinate is None or self.coordinate.prescribed_rad is None:
            return lambda t: Profile(0.0, 0.0, 0.0)
        return profile(self.coordinate.prescribed_rad)

    @property
    def start(self) -> tuple[float, float]:
        """Turn (rad) and its rate at t = 0."""
        if self.coordinate is None:
            return 0.0, 0.0
        return (self.coordinate.value, self.coordinate.rate) if self.free else self.motion(0.0)[:2]


@dataclass(frozen=True)
class KaneFlight:
    """A hinge that holds nothing; its frames are those of the scene."""

    of: Free
    inboard: FramePlace
    outboard: FramePlace


def joint(hinge: Hinge, numbers: dict[str, int], data: dict[str, KaneBody]) -> KaneJoint | KaneFlight:
    """Of a hinge of the kinds that the engine has; TypeError for another."""
    parent = _GROUND if hinge.parent == GROUND else data[hinge.parent].nodes[hinge.parent_node]
    child = data[hinge.child].nodes[hinge.child_node]
    coordinate, turn, flies = None, np.eye(3), None
    match hinge:
        case Weld():
            pass
        case Free():
            flies = hinge
        case Revolute():
            coordinate, turn = hinge.rotation, about_z(np.array(hinge.axis))
        case Prismatic() | Cylindrical() | Universal() | Gimbal() | Spherical() | Planar() | Screw():
            raise TypeError(f'hinge "{hinge.name}" is of a kind that the engine refuses')
        case _:
            assert_never(hinge)
    inboard = FramePlace(
        numbers[hinge.parent],
        parent,
        np.array(hinge.parent_position_m),
        rotation_matrix(hinge.parent_quaternion) @ turn,
    )
    outboard = FramePlace(
        numbers[hinge.child], child, np.array(hinge.child_position_m), rotation_matrix(hinge.child_quaternion) @ turn
    )
    if flies is not None:
        return KaneFlight(flies, inboard, outboard)
    return KaneJoint(hinge, inboard, outboard, coordinate)


def bearing(wheel: Wheel, numbers: dict[str, int], data: dict[str, KaneBody]) -> KaneJoint:
    """Of a wheel, whose body has its z axis along the spin."""
    (freedom,) = wheel.freedoms
    assert isinstance(freedom, ScalarFreedom) and isinstance(freedom.coordinate, AngularCoordinate)
    axes = about_z(np.array(wheel.axis))
    inboard = FramePlace(numbers[wheel.body], data[wheel.body].nodes[wheel.node], np.array(wheel.offset_m), axes)
    outboard = FramePlace(numbers[wheel.name], data[wheel.name].nodes["origin"], np.zeros(3), np.eye(3))
    return KaneJoint(wheel, inboard, outboard, freedom.coordinate)


def motor(coordinate: AngularCoordinate | None) -> Callable[[float], float]:
    """Its torque (N m) as a function of time."""
    if coordinate is None or coordinate.torque_Nm is None:
        return lambda t: 0.0
    torque = profile(coordinate.torque_Nm)
    return lambda t: torque(t).value


def springs(joints: list[KaneJoint]) -> Real:
    """Stiffness, damping and angle at rest (3, j)."""
    given = [(0.0, 0.0, 0.0) if each.coordinate is None else each.coordinate.spring for each in joints]
    return np.array(given).reshape(-1, 3).T


def all_joints(scene: Scene, numbers: dict[str, int], data: dict[str, KaneBody]) -> list[KaneJoint | KaneFlight]:
    """Hinges in the order of the scene, then wheels."""
    hinges: list[KaneJoint | KaneFlight] = [joint(hinge, numbers, data) for hinge in scene.hinges]
    return [*hinges, *(bearing(wheel, numbers, data) for wheel in scene.wheels)]
