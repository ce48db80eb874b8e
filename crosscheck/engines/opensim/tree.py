"""The scene's links as an OpenSim `Model`: every hinge a chain of elementary joints on nearly massless bodies.

Conventions of OpenSim and Simbody: spatial vectors [angular; linear]. Ball and free joints have body-fixed angles about
x, y, z for coordinates (then the position), and for speeds those of the outboard frame in the *inboard* one, in inboard
axes, angular first. Pin joints turn about z of their frames, sliders move along x. Where Simbody has a coordinate in
its state is found by a number that is written there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import assert_never

import numpy as np
import opensim
from numpy.typing import NDArray

from crosscheck.engines.connections import Moving, connections
from crosscheck.engines.conventions import IDENTITY_FRAME, Frame, axes_with, rotation_matrix
from crosscheck.engines.links import Attachment, Ball, Floating, Freedom, Link, Scalar, attachment, closed_frames
from crosscheck.engines.rigid_tree import Slot, quaternion_place
from flexmb.scene.rigid_equivalent import Inertia
from flexmb.scene.schema import Closure, Scene
from flexmb.typing import Real

# Else OpenSim writes a log into the working directory, and notes to the terminal.
opensim.Logger.removeFileSink()
opensim.Logger.setLevelString("Error")

NEGLIGIBLE = 1e-200
"""kg, kg m^2: OpenSim fails to order some trees with massless bodies, and Simbody divides by the inertia that a driven
coordinate moves. This is lost in all that it is added to."""
_ASIDE = np.array([0.287, 0.619, 0.731])
"""m: OpenSim drops the inertia of what has next to no mass, unless it is that of a mass centre off all likely axes."""

_NOTHING = Inertia(0.0, np.zeros(3), np.zeros((3, 3)))


@dataclass(frozen=True)
class OpensimSlot(Slot):
    """A freedom, the body that it moves, and where Simbody's coordinates of it start in its state."""

    body: opensim.Body
    place: int


@dataclass(frozen=True)
class OpensimClosure:
    """A closure: where its frame B is, and which of Simbody's multipliers are its own."""

    name: str
    b: Attachment
    multipliers: slice


@dataclass(frozen=True)
class OpensimTree:
    """`bodies[i]`: the body whose frame is that of link i; `joints[i]` carries it. `state` belongs to `model`.

    A slot's `q` counts the scene's coordinates, of which there are `nq`, positions before quaternions wxyz; its `v`
    counts Simbody's speeds. The controls of the model are the generalised forces of the speeds `actuated`, then for
    every link of `loaded` [torque; force] (6,) in World axes about its origin.
    """

    model: opensim.Model
    state: opensim.State
    links: tuple[Link, ...]
    bodies: tuple[opensim.Body, ...]
    joints: tuple[opensim.Joint, ...]
    slots: tuple[OpensimSlot, ...]
    closures: tuple[OpensimClosure, ...]
    nq: int
    actuated: NDArray[np.intp]
    loaded: tuple[int, ...]

    @property
    def nv(self) -> int:
        return int(self.state.getNU())

    def motion(self, link: int) -> Moving:
        """How the frame of a link moves in the state, which is realized to the speeds."""
        body = self.bodies[link]
        pose, speed = body.getTransformInGround(self.state), body.getVelocityInGround(self.state)
        return Moving(pose.p().to_numpy(), matrix(pose.R()), speed.get(0).to_numpy(), speed.get(1).to_numpy())


def spatial(vector: opensim.SpatialVec) -> Real:
    """(6,) [angular; linear]."""
    return np.concatenate([vector.get(0).to_numpy(), vector.get(1).to_numpy()])


def matrix(rotation: opensim.Rotation) -> Real:
    return np.array([[rotation.get(i, k) for k in range(3)] for i in range(3)])


def vector(numbers: Real) -> opensim.Vector:
    return opensim.Vector.createFromMat(np.ascontiguousarray(numbers, dtype=float))


def outboard_rotation(slot: Slot, q: Real) -> Real:
    """R (3,3) of the outboard frame of a ball joint or of free flight in the inboard one."""
    return rotation_matrix(q[quaternion_place(slot)])


def angles(R: Real) -> Real:
    """Body-fixed angles (3,) about x, y, z of a rotation (3,3): R = Rx Ry Rz.

    Where the second is near a quarter turn the others are ill-determined one by one, but not together: the first is
    that of the rotation which the others leave.
    """
    third = np.arctan2(-R[0, 1], R[0, 0])
    s, c = np.sin(third), np.cos(third)
    first = np.arctan2(R[2, 0] * s + R[2, 1] * c, R[1, 0] * s + R[1, 1] * c)
    return np.array([first, np.arctan2(R[0, 2], np.hypot(R[0, 0], R[0, 1])), third])


def build_tree(scene: Scene, chain: tuple[Link, ...]) -> OpensimTree:
    """The tree, with controls for all that acts on it beside gravity."""
    model = opensim.Model()
    model.setGravity(opensim.Vec3(*scene.gravity_m_s2))
    bodies: list[opensim.Body] = []
    joints: list[opensim.Joint] = []
    made: list[tuple[Freedom, Link, opensim.Body, opensim.Joint]] = []
    for link in chain:
        body, at = bodies[link.parent] if link.parent >= 0 else model.getGround(), link.inboard
        *inner, last = link.freedoms or (None,)
        for freedom in inner:
            body, joint = _add(model, freedom, body, at, _NOTHING)
            made.append((freedom, link, body, joint))
            at = IDENTITY_FRAME
        body, joint = _add(model, last, body, at, link.inertia)
        if last is not None:
            made.append((last, link, body, joint))
        bodies.append(body)
        joints.append(joint)
    for _, _, _, joint in made:
        _actuate(model, joint)
    ends = {at.link for each in connections(scene, chain) for at in (each.a, each.b) if at.link >= 0}
    loaded = tuple(sorted(ends | {attachment(scene, chain, load).link for load in scene.loads}))
    for link in loaded:
        _burden(model, bodies[link])
    constraints = [_close(model, bodies, closure, closed_frames(scene, chain, closure)) for closure in scene.closures]
    state = model.initSystem()
    for constraint in constraints:  # it would otherwise assemble the model from coordinates that are zero
        constraint.setIsEnforced(state, True)
    slots = _slots(state, made)
    nq = sum(_sizes(slot.freedom)[0] for slot in slots)
    actuated = np.array([slot.v + k for slot in slots for k in range(_sizes(slot.freedom)[1])], dtype=np.intp)
    return OpensimTree(
        model, state, chain, tuple(bodies), tuple(joints), slots, _closures(scene, chain), nq, actuated, loaded
    )


def _sizes(freedom: Freedom) -> tuple[int, int]:
    """How many coordinates and speeds the scene has for a freedom."""
    match freedom:
        case Scalar():
            return 1, 1
        case Ball() | Floating():
            return freedom.sizes
        case _:
            assert_never(freedom)


def _add(
    model: opensim.Model, freedom: Freedom | None, parent: opensim.PhysicalFrame, at: Frame, inertia: Inertia
) -> tuple[opensim.Body, opensim.Joint]:
    """A body on its joint, which is a weld where there is no freedom."""
    number = model.getBodySet().getSize()
    I = inertia.inertia + NEGLIGIBLE * np.eye(3)
    moments, products = np.diag(I).tolist(), (float(I[0, 1]), float(I[0, 2]), float(I[1, 2]))
    mass, com = (inertia.mass, inertia.com) if inertia.mass > 0.0 else (NEGLIGIBLE, _ASIDE)
    about_com = opensim.Inertia(*moments, *products)
    body = opensim.Body(f"body{number}", mass, opensim.Vec3(*com.tolist()), about_com)
    _give(model.updBodySet(), body)
    turn, kind, extra = _kind(freedom, number)
    ends = []
    for frame, on in ((parent, at @ Frame(np.zeros(3), turn)), (body, Frame(np.zeros(3), turn))):
        ends += [frame, opensim.Vec3(*on.position.tolist()), opensim.Vec3(*angles(on.rotation).tolist())]
    joint = kind(f"joint{number}", *ends, *extra)
    joint.finalizeFromProperties()  # before which a screw has no coordinate
    _give(model.updJointSet(), joint)
    return body, joint


def _kind(
    freedom: Freedom | None, number: int
) -> tuple[Real, type[opensim.Joint], tuple[opensim.SpatialTransform, ...]]:
    """How the frames of a numbered joint are turned on both sides, its class, and what else that takes."""
    match freedom:
        case Scalar(motion=motion, axis=axis):
            match motion:
                case "turn":
                    return axes_with(axis, 2), opensim.PinJoint, ()
                case "slide":
                    return axes_with(axis, 0), opensim.SliderJoint, ()
                case "screw":
                    return axes_with(axis, 2), opensim.CustomJoint, (_screw(freedom.pitch, f"screw{number}"),)
                case _:
                    assert_never(motion)
        case Ball():
            return np.eye(3), opensim.BallJoint, ()
        case Floating():
            return np.eye(3), opensim.FreeJoint, ()
        case None:
            return np.eye(3), opensim.WeldJoint, ()
        case _:
            assert_never(freedom)


def _screw(pitch: float, coordinate: str) -> opensim.SpatialTransform:
    """A turn about z and a shift along it (m/rad) by one coordinate, whose name no other one has."""
    motion, name = opensim.SpatialTransform(), opensim.ArrayStr(coordinate, 1)
    for axis, factor in ((motion.upd_rotation3(), 1.0), (motion.upd_translation3(), pitch)):
        axis.setCoordinateNames(name)
        axis.set_function(opensim.LinearFunction(factor, 0.0))
    return motion


def _give(collection: opensim.Set, item: opensim.Object) -> None:
    """Let the model own an item. Its own `addBody` and the like do so too, but look at all others each time."""
    collection.adoptAndAppend(item)
    item.thisown = False  # else Python would delete it as well


def _actuate(model: opensim.Model, joint: opensim.Joint) -> None:
    for k in range(joint.numCoordinates()):
        actuator = opensim.CoordinateActuator()
        actuator.setName(f"effort{model.getForceSet().getSize()}")
        actuator.setCoordinate(joint.upd_coordinates(k))
        actuator.setOptimalForce(1.0)
        _give(model.updForceSet(), actuator)


def _burden(model: opensim.Model, body: opensim.Body) -> None:
    actuator = opensim.BodyActuator()
    actuator.setName(f"wrench{model.getForceSet().getSize()}")
    actuator.setBody(body)
    actuator.setPointForceIsGlobal(False)
    actuator.setSpatialForceIsGlobal(True)
    _give(model.updForceSet(), actuator)


def _close(
    model: opensim.Model, bodies: list[opensim.Body], closure: Closure, ends: tuple[Attachment, Attachment]
) -> opensim.Constraint:
    """The constraint of a closure, which is not yet enforced."""
    on = [bodies[end.link] if end.link >= 0 else model.getGround() for end in ends]
    points = [opensim.Vec3(*end.frame.position.tolist()) for end in ends]
    turns = [opensim.Vec3(*angles(end.frame.rotation).tolist()) for end in ends]
    match closure.type:
        case "spherical":
            constraint = opensim.PointConstraint(on[0], points[0], on[1], points[1])
        case "weld":
            constraint = opensim.WeldConstraint("weld", on[0], points[0], turns[0], on[1], points[1], turns[1])
        case _:
            raise NotImplementedError(f"a {closure.type} closure, which `obstacle` refuses, has reached the adapter")
    constraint.setName(f"closure{model.getConstraintSet().getSize()}")
    constraint.set_isEnforced(False)
    _give(model.updConstraintSet(), constraint)
    return constraint


def _closures(scene: Scene, chain: tuple[Link, ...]) -> tuple[OpensimClosure, ...]:
    found, first = [], 0
    for closure in scene.closures:
        end = first + (6 if closure.type == "weld" else 3)
        found.append(OpensimClosure(closure.name, closed_frames(scene, chain, closure)[1], slice(first, end)))
        first = end
    return tuple(found)


def _slots(
    state: opensim.State, made: list[tuple[Freedom, Link, opensim.Body, opensim.Joint]]
) -> tuple[OpensimSlot, ...]:
    for number, (*_, joint) in enumerate(made, 1):
        joint.get_coordinates(0).setValue(state, float(number), False)
        joint.get_coordinates(0).setSpeedValue(state, float(number))
    places, speeds = state.getQ().to_numpy(), state.getU().to_numpy()
    slots, q = [], 0
    for number, (freedom, link, body, _) in enumerate(made, 1):
        v, place = (int(np.flatnonzero(each == number)[0]) for each in (speeds, places))
        slots.append(OpensimSlot(freedom, link, q, v, body, place))
        q += _sizes(freedom)[0]
    return tuple(slots)
