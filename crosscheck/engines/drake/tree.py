"""The scene's links as a continuous `MultibodyPlant`: every hinge a chain of elementary joints on massless bodies.

Conventions of Drake: quaternions wxyz; spatial vectors [angular; linear]; the velocities of ball and floating joints
are those of the outboard frame in the *inboard* one, in inboard axes; a floating joint's coordinates are quaternion,
then position. Spatial inertias are taken about the body origin, as multiples of the mass.

An armature is the inertia of a rotor with the gear ratio 1.

Two workarounds. (1) A prescribed coordinate has a rotor with inertia `BALLAST` in place of its armature, so that only
the applied BALLAST * acceleration moves it; the error of its acceleration is the load / BALLAST, below round-off. Its
load is that of a second plant without these rotors. (2) Drake's only ball joint has roll, pitch and yaw, which are
singular at a pitch of pi/2. Its inboard frame F is a parameter of the context: when the pitch is large, F is rotated to
the joint's present orientation and the angles restart at zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, assert_never

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BallRpyJoint,
    FixedOffsetFrame,
    Joint,
    PrismaticJoint,
    PrismaticSpring,
    QuaternionFloatingJoint,
    RevoluteJoint,
    RevoluteSpring,
    RigidBody,
    SpatialInertia,
    UnitInertia,
    WeldJoint,
)
from pydrake.systems.framework import Context

from crosscheck.engines.conventions import Frame, rotation_matrix
from crosscheck.engines.functions_of_time import initial
from crosscheck.engines.links import Ball, Floating, Freedom, Link, Scalar, by_motion
from crosscheck.engines.rigid_tree import Slot
from flexmb.scene.rigid_equivalent import steiner
from flexmb.scene.schema import Scene
from flexmb.typing import Real

BALLAST = 1e20
"""kg m^2 or kg: so large that drive loads of any scene, divided by it, are below round-off of the accelerations."""


@dataclass(frozen=True)
class DrakeSlot(Slot):
    """A freedom with its Drake joint.

    Drake's own elements give springs of scalar joints and all dampers, but refuse negative coefficients.
    """

    joint: Joint


@dataclass(frozen=True)
class DrakeTree:
    """`joints[i]` is the joint whose child is the body of link i; `slots` follow the order of links."""

    plant: MultibodyPlant
    links: tuple[Link, ...]
    bodies: tuple[RigidBody, ...]
    joints: tuple[Joint, ...]
    slots: tuple[DrakeSlot, ...]

    @property
    def balls(self) -> list[DrakeSlot]:
        return [slot for slot in self.slots if isinstance(slot.freedom, Ball)]


class DrakeState(NamedTuple):
    """q (nq,), v (nv,), and the rotation R_PF (3,3) of every ball joint's inboard frame in its parent link."""

    q: Real
    v: Real
    turned: tuple[Real, ...]


def build_tree(scene: Scene, chain: tuple[Link, ...], *, ballasted: bool) -> DrakeTree:
    """A finished plant; `ballasted` gives the prescribed coordinates rotors that nothing but their drives moves."""
    plant = MultibodyPlant(0.0)
    plant.mutable_gravity_field().set_gravity_vector(np.array(scene.gravity_m_s2, dtype=float))
    bodies: list[RigidBody] = []
    last: list[Joint] = []
    joints: list[tuple[Freedom, Link, Joint]] = []
    for link in chain:
        parent = bodies[link.parent] if link.parent >= 0 else plant.world_body()
        name = f"{link.kind} {link.name}"
        at = plant.AddFrame(FixedOffsetFrame(f"{name} inboard", parent.body_frame(), transform(link.inboard)))
        body = plant.AddRigidBody(name, _inertia(link))
        for k, freedom in enumerate(link.freedoms):
            child = body if k == len(link.freedoms) - 1 else plant.AddRigidBody(f"{name} {k}", SpatialInertia.Zero())
            joint = plant.AddJoint(_joint(f"{name} {k}", freedom, at, child.body_frame()))
            _equip(plant, joint, freedom, ballasted)
            joints.append((freedom, link, joint))
            at = child.body_frame()
        if not link.freedoms:
            joint = plant.AddJoint(WeldJoint(name, at, body.body_frame(), RigidTransform()))
        bodies.append(body)
        last.append(joint)
    plant.Finalize()
    slots = tuple(
        DrakeSlot(freedom, link, joint.position_start(), joint.velocity_start(), joint)
        for freedom, link, joint in joints
    )
    return DrakeTree(plant, chain, tuple(bodies), tuple(last), slots)


def transform(frame: Frame) -> RigidTransform:
    return RigidTransform(_orthogonal(frame.rotation), frame.position)


def initial_state(tree: DrakeTree) -> DrakeState:
    """The state at t = 0; every ball joint's angles are zero, its inboard frame is where the joint is."""
    q, v = np.zeros(tree.plant.num_positions()), np.zeros(tree.plant.num_velocities())
    turned = []
    for slot in tree.slots:
        match slot.freedom:
            case Scalar() as freedom:
                q[slot.q], v[slot.v] = initial(freedom)
            case Ball() as freedom:
                turned.append(slot.link.inboard.rotation @ rotation_matrix(freedom.quaternion))
                v[slot.v : slot.v + 3] = freedom.angular_velocity
            case Floating() as freedom:
                R = rotation_matrix(freedom.quaternion)
                q[slot.q : slot.q + 7] = [*freedom.quaternion, *freedom.position]
                v[slot.v : slot.v + 6] = [*(R @ freedom.angular_velocity), *(R @ freedom.velocity)]
            case _:
                assert_never(slot.freedom)
    return DrakeState(q, v, tuple(turned))


def recentred(tree: DrakeTree, state: DrakeState) -> DrakeState:
    """The same motion with the angles of all ball joints at zero."""
    q, v = state.q.copy(), state.v.copy()
    turned = []
    for slot, frame in zip(tree.balls, state.turned, strict=True):
        R = ball_rotation(slot, q)
        turned.append(np.array(_orthogonal(frame @ R).matrix()))
        v[slot.v : slot.v + 3] = R.T @ v[slot.v : slot.v + 3]
        q[slot.q : slot.q + 3] = 0.0
    return DrakeState(q, v, tuple(turned))


def ball_rotation(slot: DrakeSlot, q: Real) -> Real:
    """R (3,3) of a ball joint's outboard frame in its inboard frame F."""
    return np.array(RollPitchYaw(q[slot.q : slot.q + 3]).ToRotationMatrix().matrix())


def place(tree: DrakeTree, context: Context, state: DrakeState) -> None:
    """Put the plant's context in a state."""
    for slot, rotation in zip(tree.balls, state.turned, strict=True):
        pose = RigidTransform(_orthogonal(rotation), slot.link.inboard.position)
        slot.joint.frame_on_parent().SetPoseInParentFrame(context, pose)
    tree.plant.SetPositions(context, state.q)
    tree.plant.SetVelocities(context, state.v)


def _orthogonal(rotation: Real) -> RotationMatrix:
    """The nearest rotation: Drake throws where a product of many has left the group by more than 128 round-offs."""
    return RotationMatrix.ProjectToRotationMatrix(rotation)


def _joint(name: str, freedom: Freedom, inboard: object, outboard: object) -> Joint:
    match freedom:
        case Scalar(axis=axis, damping=damping):
            kind = by_motion(freedom, RevoluteJoint, PrismaticJoint)
            return kind(name, inboard, outboard, axis, damping=max(damping, 0.0))
        case Ball(damping=damping):
            return BallRpyJoint(name, inboard, outboard, damping=max(damping, 0.0))
        case Floating():
            return QuaternionFloatingJoint(name, inboard, outboard)
        case _:
            assert_never(freedom)


def _equip(plant: MultibodyPlant, joint: Joint, freedom: Freedom, ballasted: bool) -> None:
    if not isinstance(freedom, Scalar):
        return
    if freedom.stiffness > 0.0:
        spring = by_motion(freedom, RevoluteSpring, PrismaticSpring)
        plant.AddForceElement(spring(joint, freedom.rest, freedom.stiffness))
    inertia = BALLAST if ballasted and freedom.prescribed is not None else freedom.armature
    if inertia:
        rotor = plant.AddJointActuator(joint.name(), joint)
        rotor.set_default_rotor_inertia(inertia)
        rotor.set_default_gear_ratio(1.0)


def _inertia(link: Link) -> SpatialInertia:
    """About the link's origin. Unchecked: a disc's moments miss the triangle inequality by round-off."""
    mass, com, about_com = link.inertia.mass, link.inertia.com, link.inertia.inertia
    unit = about_com / mass + steiner(1.0, com)
    moments, products = np.diag(unit), (unit[0, 1], unit[0, 2], unit[1, 2])
    return SpatialInertia(mass, com, UnitInertia(*moments, *products), skip_validity_check=True)
