"""The scene's links as a MuJoCo model: one body per link, its elementary joints in sequence at the body's origin.

Conventions of MuJoCo: quaternions wxyz; a ball's velocity in outboard axes; slides before the ball of a floating link
are in inboard axes (three slides and a ball serve on any parent, MuJoCo's free joint only on the ground).

Two workarounds. (1) A prescribed coordinate has an armature so large that only the applied ARMATURE * acceleration
moves it; its load is that of the inverse dynamics, which does not contain armatures, plus what moves the scene's own.
The error of its acceleration is the load / ARMATURE. (2) MuJoCo refuses principal moments of inertia below 1e-15 kg
m^2 of bodies that have joints: smaller ones (point masses, rods) are raised to `LEAST_INERTIA`. Welded bodies have
theirs: raised ones would add 1e-10 and more to the inertia of a small robot's limb.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import assert_never

import mujoco
import numpy as np
from numpy.typing import NDArray

from crosscheck.engines.conventions import quaternion_of
from crosscheck.engines.links import (
    Attachment,
    Ball,
    Floating,
    Freedom,
    Link,
    Scalar,
    by_motion,
    closed_frames,
    is_bare_frame,
    radius_of_gyration,
)
from crosscheck.engines.rigid_tree import Counting, Slot, scene_start
from flexmb.scene.hinges import Closure
from flexmb.scene.schema import Scene
from flexmb.typing import Real

ARMATURE = 1e20
COUNTING = Counting(scalar_first=True, linear_first=True, outboard=False)
LEAST_INERTIA = 1e-14


@dataclass(frozen=True)
class MujocoClosure:
    """A joint that closes a loop between frames `a` and `b`, as soft as MuJoCo's defaults make it.

    `points` (n, 3) of both frames stay together: one for a ball joint, two on the axis of a pin, three for a weld.
    """

    name: str
    a: Attachment
    b: Attachment
    points: Real

    def sites(self, number: int) -> list[tuple[str, str]]:
        """Names of the sites of all points on A and on B, of the closure of this number."""
        return [(f"closure {number}a.{k}", f"closure {number}b.{k}") for k in range(len(self.points))]


def mujoco_closure(scene: Scene, links: tuple[Link, ...], closure: Closure) -> MujocoClosure:
    """A closure whose kind `obstacle` takes.

    The points are as far from the frames as the larger radius of gyration of the two bodies about these: then what
    keeps them together is about as stiff against turns as against displacements, whatever the size of the scene. (The
    rows of MuJoCo's own weld are those of a quaternion, and their loads are twice the torque.)
    """
    a, b = closed_frames(scene, links, closure)
    arm = max(radius_of_gyration(links, a), radius_of_gyration(links, b))
    match closure.type:
        case "spherical":
            points = np.zeros((1, 3))
        case "revolute":
            points = arm * np.outer([-1.0, 1.0], closure.axis)
        case "weld":
            around = 2.0 / 3.0 * np.pi * np.arange(3)
            points = arm * np.stack([np.cos(around), np.sin(around), np.zeros(3)], axis=1)
        case _:
            raise NotImplementedError(f'closure "{closure.name}", which `obstacle` refuses, has reached the adapter')
    return MujocoClosure(closure.name, a, b, points)


@dataclass(frozen=True)
class MujocoCoupling:
    """A fixed tendon whose length, the sum of factors times joints' coordinates, is kept at `offset`, as softly."""

    name: str
    joints: tuple[str, ...]
    factors: tuple[float, ...]
    offset: float


@dataclass(frozen=True)
class MujocoSlot(Slot):
    """A freedom with the ids of its MuJoCo body and of the first of its MuJoCo joints."""

    body: int
    joint: int


@dataclass(frozen=True)
class MujocoTree:
    """`bodies[i]` is the MuJoCo body of link i."""

    model: mujoco.MjModel
    links: tuple[Link, ...]
    bodies: NDArray[np.intp]
    slots: tuple[MujocoSlot, ...]


def build_tree(
    links: tuple[Link, ...],
    gravity: Real,
    closures: tuple[MujocoClosure, ...] = (),
    couplings: tuple[MujocoCoupling, ...] = (),
) -> MujocoTree:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.gravity = gravity
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    off = mujoco.mjtDisableBit
    # AUTORESET would silently rewind a diverged run.
    spec.option.disableflags = int(off.mjDSBL_CONTACT) | int(off.mjDSBL_AUTORESET)
    bodies = []
    for link in links:
        parent = bodies[link.parent] if link.parent >= 0 else spec.worldbody
        body = parent.add_body(name=_body_name(link), pos=link.inboard.position, quat=link.inboard.quaternion)
        body.explicitinertial = True
        body.mass = link.inertia.mass
        body.ipos = link.inertia.com
        if not is_bare_frame(link):
            principal, axes = _principal(link.inertia.inertia, LEAST_INERTIA if link.freedoms else 0.0)
            body.inertia = principal
            body.iquat = quaternion_of(axes)
        for k, freedom in enumerate(link.freedoms):
            _add_joints(body, freedom, joint_name(link, k))
        bodies.append(body)
    for i, closed in enumerate(closures):
        _close(spec, bodies, closed, i)
    for coupling in couplings:
        _couple(spec, coupling)
    driven = any(
        isinstance(freedom, Scalar) and freedom.prescribed is not None for link in links for freedom in link.freedoms
    )
    if couplings or (closures and driven):  # its solver stops at errors relative to the mean inertia, armatures too
        spec.option.tolerance = 0.0
    model = spec.compile()
    ids = np.array([model.body(_body_name(link)).id for link in links], dtype=np.intp)
    return MujocoTree(model, links, ids, _slots(model, links, ids))


def initial_state(tree: MujocoTree) -> tuple[Real, Real]:
    """qpos and qvel at t = 0."""
    return scene_start(tree.slots, (tree.model.nq, tree.model.nv), COUNTING)


def _close(spec: mujoco.MjSpec, bodies: list[mujoco.MjsBody], closed: MujocoClosure, number: int) -> None:
    """Equality constraints between sites: with a body and an anchor they would close where coordinates are zero."""
    for names, point in zip(closed.sites(number), closed.points, strict=True):
        for name, at in zip(names, (closed.a, closed.b), strict=True):
            body = bodies[at.link] if at.link >= 0 else spec.worldbody
            place = at.frame.position + at.frame.rotation @ point
            body.add_site(name=name, pos=place, quat=at.frame.quaternion)
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_SITE, name1=names[0], name2=names[1]
        )


def _couple(spec: mujoco.MjSpec, coupling: MujocoCoupling) -> None:
    tendon = spec.add_tendon(name=coupling.name)
    for joint, factor in zip(coupling.joints, coupling.factors, strict=True):
        tendon.wrap_joint(joint, factor)
    data = np.zeros(mujoco.mjNEQDATA)
    data[0] = coupling.offset
    spec.add_equality(type=mujoco.mjtEq.mjEQ_TENDON, name1=coupling.name, data=data)


def _add_joints(body: mujoco.MjsBody, freedom: Freedom, name: str) -> None:
    kinds = mujoco.mjtJoint
    match freedom:
        case Scalar():
            joint = body.add_joint(name=name, type=by_motion(freedom, kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE))
            joint.axis = freedom.axis
            if freedom.prescribed is None:
                joint.stiffness = [freedom.stiffness, 0.0, 0.0]
                joint.springref = freedom.rest
                joint.damping = [freedom.damping, 0.0, 0.0]
                joint.armature = freedom.armature
            else:
                joint.armature = ARMATURE
        case Ball():
            joint = body.add_joint(name=name, type=kinds.mjJNT_BALL)
            joint.stiffness = [freedom.stiffness, 0.0, 0.0]
            joint.damping = [freedom.damping, 0.0, 0.0]
        case Floating():
            for axis, letter in zip(np.eye(3), "xyz", strict=True):
                body.add_joint(name=f"{name}.{letter}", type=kinds.mjJNT_SLIDE, axis=axis)
            body.add_joint(name=name, type=kinds.mjJNT_BALL)
        case _:
            assert_never(freedom)


def _slots(model: mujoco.MjModel, links: tuple[Link, ...], bodies: NDArray[np.intp]) -> tuple[MujocoSlot, ...]:
    slots = []
    for link, body in zip(links, bodies, strict=True):
        joint = int(model.body_jntadr[body])
        for freedom in link.freedoms:
            q, v = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
            slots.append(MujocoSlot(freedom, link, q, v, int(body), joint))
            joint += _joints_of(freedom)
    return tuple(slots)


def _joints_of(freedom: Freedom) -> int:
    """How many of MuJoCo's joints it is."""
    match freedom:
        case Scalar() | Ball():
            return 1
        case Floating():
            return 4
        case _:
            assert_never(freedom)


def _principal(inertia: Real, least: float) -> tuple[Real, Real]:
    """Principal moments (3,), none below `least`, and right-handed axes (3,3) as columns."""
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    moments = np.maximum(moments, least)
    # A disc's moments miss the triangle inequality by round-off, and the compiler refuses it.
    moments[2] = min(moments[2], moments[0] + moments[1])
    return moments, axes


def joint_name(link: Link, k: int) -> str:
    """Of the joint that is freedom k of a link."""
    return f"{_body_name(link)}.{k}"


def _body_name(link: Link) -> str:
    return f"{link.kind} {link.name}"
