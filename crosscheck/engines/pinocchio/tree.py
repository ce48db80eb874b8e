"""The scene's links as a `pinocchio.Model`: every hinge a chain of elementary joints on massless links.

Conventions of Pinocchio: quaternions xyzw, spatial vectors [linear; angular], velocities of spherical and free-flying
joints in outboard axes. A weld is a revolute joint held at zero, so that its load is an output like any other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import assert_never

import numpy as np
import pinocchio as pin

from crosscheck.engines.conventions import Frame
from crosscheck.engines.links import Ball, Floating, Freedom, Link, Scalar
from crosscheck.engines.rigid_tree import Counting, Slot, scene_start
from flexmb.scene.functions import Constant
from flexmb.typing import Real

COUNTING = Counting(scalar_first=False, linear_first=True, outboard=True)
_HELD = Scalar("turn", np.array([0.0, 0.0, 1.0]), *(0.0,) * 7, None, Constant(value=0.0))


@dataclass(frozen=True)
class PinocchioSlot(Slot):
    """A freedom; if it is `held` it stands for a weld."""

    held: bool


@dataclass(frozen=True)
class PinocchioTree:
    """`joints[i]`: the joint whose frame is link i. `slots` follow the order of the coordinates."""

    model: pin.Model
    links: tuple[Link, ...]
    joints: tuple[int, ...]
    slots: tuple[PinocchioSlot, ...]


def placement(frame: Frame) -> pin.SE3:
    return pin.SE3(frame.rotation, frame.position)


def build_tree(links: tuple[Link, ...], gravity: Real) -> PinocchioTree:
    """The model; links are ordered depth-first, since Pinocchio's `crba` is silently wrong in another order."""
    model = pin.Model()
    model.gravity.linear = gravity
    joints: list[int] = []
    slots: list[PinocchioSlot] = []
    for link in links:
        joint = joints[link.parent] if link.parent >= 0 else 0
        at = placement(link.inboard)
        for k, freedom in enumerate(link.freedoms or (_HELD,)):
            joint = model.addJoint(joint, _joint(freedom), at, f"{link.joint}.{k}")
            at = pin.SE3.Identity()
            made = model.joints[joint]
            if isinstance(freedom, Scalar):
                armature = model.armature
                armature[made.idx_v] = freedom.armature
                model.armature = armature
            slots.append(PinocchioSlot(freedom, link, made.idx_q, made.idx_v, not link.freedoms))
        own = link.inertia
        model.appendBodyToJoint(joint, pin.Inertia(own.mass, own.com, own.inertia), pin.SE3.Identity())
        joints.append(joint)
    if not model.check(model.createData()):
        raise RuntimeError("Pinocchio refuses the order of the joints: links must come depth-first")
    return PinocchioTree(model, links, tuple(joints), tuple(slots))


def initial_state(tree: PinocchioTree) -> tuple[Real, Real]:
    """Coordinates (nq,) and speeds (nv,) at t = 0."""
    return scene_start(tree.slots, (tree.model.nq, tree.model.nv), COUNTING)


def _joint(freedom: Freedom) -> pin.JointModel:
    match freedom:
        case Scalar():
            return _along_axis(freedom)
        case Ball():
            return pin.JointModelSpherical()
        case Floating():
            return pin.JointModelFreeFlyer()
        case _:
            assert_never(freedom)


def _along_axis(joint: Scalar) -> pin.JointModel:
    match joint.motion:
        case "turn":
            return pin.JointModelRevoluteUnaligned(joint.axis)
        case "slide":
            return pin.JointModelPrismaticUnaligned(joint.axis)
        case "screw":
            return pin.JointModelHelicalUnaligned(joint.axis, joint.pitch)
        case _:
            assert_never(joint.motion)
