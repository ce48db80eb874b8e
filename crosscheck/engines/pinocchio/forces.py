"""Motion and wrenches of the joints of a Pinocchio tree, between their own axes and those of World."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from crosscheck.engines.connections import WORLD, Moving
from crosscheck.engines.conventions import cross, shift_wrench
from crosscheck.engines.tree_observer import STILL, BodyMotion
from flexmb.typing import Real


def moving(data: pin.Data, joint: int) -> Moving:
    """How the frame of a joint moves, 0 being World; needs the kinematics of `data` to be up to date."""
    if joint == 0:
        return WORLD
    pose, speed = data.oMi[joint], data.v[joint]
    R = pose.rotation
    return Moving(pose.translation, R, R @ speed.angular, R @ speed.linear)


def body_motion(data: pin.Data, joint: int) -> BodyMotion:
    """The same with accelerations; those of Pinocchio are spatial."""
    if joint == 0:
        return STILL
    at, speed, rate = moving(data, joint), data.v[joint], data.a[joint]
    of_point = rate.linear + cross(speed.angular, speed.linear)
    return BodyMotion(*at, at.rotation @ rate.angular, at.rotation @ of_point)


def mass_matrix(model: pin.Model, data: pin.Data, q: Real) -> Real:
    """(nv, nv) with the armatures of the model, of which Pinocchio fills the upper half."""
    return _symmetric(pin.crba(model, data, q))


def inverse_mass_matrix(data: pin.Data) -> Real:
    """(nv, nv) after forward dynamics with derivatives, of which Pinocchio fills the upper half."""
    return _symmetric(data.Minv)


def _symmetric(upper: Real) -> Real:
    upper = np.triu(upper)
    return np.asarray(upper + np.triu(upper, 1).T)


class ClosedLoad(NamedTuple):
    """The load of a closure: `wrench` [torque; force] (6,) on B about `place` (3,) m, both in World axes, and the
    joints of A and B, 0 for World."""

    wrench: Real
    place: Real
    sides: tuple[int, int]


def on_both_sides(data: pin.Data, loads: Iterable[ClosedLoad]) -> Iterator[tuple[int, Real]]:
    """The joints of closures with their loads about the joints' origins, World axes."""
    for load in loads:
        for joint, sign in zip(load.sides, (-1.0, 1.0), strict=True):
            if joint:
                yield joint, shift_wrench(sign * load.wrench, load.place - data.oMi[joint].translation)


def on_joints(model: pin.Model, data: pin.Data, wrenches: Iterable[tuple[int, Real]]) -> pin.StdVec_Force:
    """[torque; force] (6,) on joints about their origins, World axes, as Pinocchio takes them: in joint axes.

    `data` has the places of the joints.
    """
    total = pin.StdVec_Force(_none(model.njoints))
    for joint, wrench in wrenches:
        back = data.oMi[joint].rotation.T
        total[joint] = total[joint] + pin.Force(back @ wrench[3:], back @ wrench[:3])
    return total


@cache
def _none(joints: int) -> pin.StdVec_Force:
    """No forces on so many joints; a copy takes a tenth of the time of another one."""
    forces = pin.StdVec_Force()
    forces.extend([pin.Force.Zero() for _ in range(joints)])
    return forces
