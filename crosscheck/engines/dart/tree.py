"""The scene's links as a DART `Skeleton`: every hinge a chain of elementary joints on nearly massless bodies.

Conventions of DART: spatial vectors [angular; linear]; a ball joint's coordinates are a rotation vector and its speeds
are in outboard axes; those of a free joint are a rotation vector, then the position, in the joint's inboard frame, and
its speeds, angular first, are in the axes of the *parent body*, wherever the joint's frame is turned to. Its own
springs and dampers belong to its implicit step and are not used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import assert_never

import dartpy
import numpy as np

from crosscheck.engines.conventions import Frame
from crosscheck.engines.links import Ball, Floating, Freedom, Link, Scalar, by_motion
from crosscheck.engines.rigid_tree import Slot
from flexmb.scene.schema import Scene
from flexmb.typing import Real

NEGLIGIBLE = 1e-200
"""kg or kg m^2: DART warns of zero mass and inertia; this is below the round-off of anything to which it is added."""


@dataclass(frozen=True)
class DartTree:
    """`bodies[i]` is the body whose frame is that of link i; `nq` counts the scene's coordinates.

    A slot's `q` counts the scene's coordinates, positions before quaternions wxyz; its `v` counts DART's speeds.
    """

    skeleton: dartpy.dynamics.Skeleton
    links: tuple[Link, ...]
    bodies: tuple[dartpy.dynamics.BodyNode, ...]
    slots: tuple[Slot, ...]
    nq: int


def build_tree(scene: Scene, chain: tuple[Link, ...]) -> DartTree:
    """The tree; prescribed joints take accelerations as commands, all others forces."""
    skeleton = dartpy.dynamics.Skeleton(scene.name)
    skeleton.setGravity(np.array(scene.gravity_m_s2, dtype=float))
    bodies: list[dartpy.dynamics.BodyNode] = []
    slots: list[Slot] = []
    q = 0
    for link in chain:
        body = bodies[link.parent] if link.parent >= 0 else None
        at: Frame | None = link.inboard
        for freedom in link.freedoms:
            joint, body = _joint(skeleton, body, freedom)
            slot = Slot(freedom, link, q, joint.getIndexInSkeleton(0))
            if slot.driven:
                joint.setActuatorType(dartpy.dynamics.ActuatorType.ACCELERATION)
            slots.append(slot)
            q += _coordinates(freedom)
            _place(joint, at)
            at = None
            body.setInertia(_inertia(NEGLIGIBLE, np.zeros(3), np.zeros((3, 3))))
        if not link.freedoms:
            joint, body = skeleton.createWeldJointAndBodyNodePair(body)
            _place(joint, at)
        body.setInertia(_inertia(link.inertia.mass, link.inertia.com, link.inertia.inertia))
        bodies.append(body)
    return DartTree(skeleton, chain, tuple(bodies), tuple(slots), q)


def _coordinates(freedom: Freedom) -> int:
    match freedom:
        case Scalar():
            return 1
        case Ball() | Floating():
            return freedom.sizes[0]
        case _:
            assert_never(freedom)


def _joint(
    skeleton: dartpy.dynamics.Skeleton, parent: dartpy.dynamics.BodyNode | None, freedom: Freedom
) -> tuple[dartpy.dynamics.Joint, dartpy.dynamics.BodyNode]:
    match freedom:
        case Scalar(axis=axis):
            turns, slides = skeleton.createRevoluteJointAndBodyNodePair, skeleton.createPrismaticJointAndBodyNodePair
            joint, body = by_motion(freedom, turns, slides)(parent)
            joint.setAxis(axis)
        case Ball():
            joint, body = skeleton.createBallJointAndBodyNodePair(parent)
        case Floating():
            joint, body = skeleton.createFreeJointAndBodyNodePair(parent)
        case _:
            assert_never(freedom)
    return joint, body


def _place(joint: dartpy.dynamics.Joint, at: Frame | None) -> None:
    """Set the joint's frame on its parent; the frames of a chain's later joints are those of the bodies before them."""
    if at is not None:
        pose = dartpy.math.Isometry3()
        pose.set_rotation(at.rotation)
        pose.set_translation(at.position)
        joint.setTransformFromParentBodyNode(pose)


def _inertia(mass: float, com: Real, about_com: Real) -> dartpy.dynamics.Inertia:
    moment = about_com + NEGLIGIBLE * np.eye(3)
    return dartpy.dynamics.Inertia(max(mass, NEGLIGIBLE), com, moment)
