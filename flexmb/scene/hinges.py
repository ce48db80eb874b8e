"""Hinges of a scene: one struct per kind, with its coordinates, springs, torques and prescribed motion.

A hinge connects a node of `parent` ("ground" for the inertial frame) to a node of `child`. The inboard hinge frame is
the parent's node frame displaced by `parent_position_m`, `parent_quaternion` (fixed offsets in node axes); likewise the
outboard hinge frame on the child. Coordinates vanish when both frames coincide.
Angles follow the right-hand rule of the outboard frame relative to the inboard one.
Springs act between coordinate and its rest value; `torque`/`force` is a motor acting between the two bodies.
A coordinate with `prescribed` follows that function of time; its drive load is an output.
"""

from __future__ import annotations

from typing import Literal, get_args

from flexmb.scene.bodies import IDENTITY, ZERO, Quaternion, SceneStruct, Vector
from flexmb.scene.functions import Function

Z_AXIS: Vector = (0.0, 0.0, 1.0)


class _Hinge(SceneStruct, frozen=True, kw_only=True, tag_field="kind"):
    name: str
    parent: str
    child: str
    parent_node: str = "origin"
    child_node: str = "origin"
    parent_position_m: Vector = ZERO
    parent_quaternion: Quaternion = IDENTITY
    child_position_m: Vector = ZERO
    child_quaternion: Quaternion = IDENTITY


class AngularCoordinate(SceneStruct, frozen=True, kw_only=True):
    """One angle: initial value and rate, spring, damper, motor, or prescribed motion.

    With closures, initial values other than zero are kept to the last digit where the others can follow, and changed
    with a warning where they contradict each other. `given = true`: both are meant, zero too; where they cannot be kept
    there is an error, and angles and displacements without it are guesses that say which way the loop is assembled.
    """

    angle_rad: float = 0.0
    rate_rad_s: float = 0.0
    given: bool = False
    stiffness_Nm_rad: float = 0.0
    damping_Nms_rad: float = 0.0
    rest_rad: float = 0.0
    torque_Nm: Function | None = None
    prescribed_rad: Function | None = None


class LinearCoordinate(SceneStruct, frozen=True, kw_only=True):
    """One displacement: initial value and rate, spring, damper, motor, or prescribed motion.

    `given` as of an angle.
    """

    position_m: float = 0.0
    rate_m_s: float = 0.0
    given: bool = False
    stiffness_N_m: float = 0.0
    damping_Ns_m: float = 0.0
    rest_m: float = 0.0
    force_N: Function | None = None
    prescribed_m: Function | None = None


class Weld(_Hinge, frozen=True, kw_only=True, tag="weld"):
    """No freedom."""


class Revolute(_Hinge, frozen=True, kw_only=True, tag="revolute"):
    """One rotation about `axis` (inboard hinge axes)."""

    axis: Vector = Z_AXIS
    rotation: AngularCoordinate = AngularCoordinate()


class Prismatic(_Hinge, frozen=True, kw_only=True, tag="prismatic"):
    """One translation along `axis`."""

    axis: Vector = Z_AXIS
    translation: LinearCoordinate = LinearCoordinate()


class Cylindrical(_Hinge, frozen=True, kw_only=True, tag="cylindrical"):
    """Rotation about and translation along `axis`. Speeds: [rotation, translation]."""

    axis: Vector = Z_AXIS
    rotation: AngularCoordinate = AngularCoordinate()
    translation: LinearCoordinate = LinearCoordinate()


class Universal(_Hinge, frozen=True, kw_only=True, tag="universal"):
    """Rotation about x of the inboard frame, then about the carried y."""

    first: AngularCoordinate = AngularCoordinate()
    second: AngularCoordinate = AngularCoordinate()


class Gimbal(_Hinge, frozen=True, kw_only=True, tag="gimbal"):
    """Two or three successive rotations about carried axes (Frisch's free coordinate vectors), e.g. "zxz", "xyz".

    Singular where the first and last of three axes align.
    """

    sequence: str = "xyz"
    rotations: tuple[AngularCoordinate, ...] = (AngularCoordinate(), AngularCoordinate(), AngularCoordinate())


class Spherical(_Hinge, frozen=True, kw_only=True, tag="spherical"):
    """Three rotations; coordinate: quaternion (scalar first) of outboard relative to inboard axes; speeds: relative
    angular velocity in outboard axes. The spring torque is -stiffness * rotation vector. `given` as of an angle."""

    quaternion: Quaternion = IDENTITY
    angular_velocity_rad_s: Vector = ZERO
    given: bool = False
    stiffness_Nm_rad: float = 0.0
    damping_Nms_rad: float = 0.0


class Planar(_Hinge, frozen=True, kw_only=True, tag="planar"):
    """Translation in the x-y plane of the inboard frame, then rotation about z. Speeds: [xdot, ydot, angle rate]."""

    x: LinearCoordinate = LinearCoordinate()
    y: LinearCoordinate = LinearCoordinate()
    rotation: AngularCoordinate = AngularCoordinate()


class Free(_Hinge, frozen=True, kw_only=True, tag="free"):
    """Six freedoms. Coordinates: position of the outboard origin in inboard axes, quaternion.

    Speeds: [angular velocity; velocity of the outboard origin], relative to the inboard frame, in outboard axes.
    `given` as of an angle.
    """

    position_m: Vector = ZERO
    quaternion: Quaternion = IDENTITY
    angular_velocity_rad_s: Vector = ZERO
    velocity_m_s: Vector = ZERO
    given: bool = False


Hinge = Weld | Revolute | Prismatic | Cylindrical | Universal | Gimbal | Spherical | Planar | Free
WITH_AXIS = tuple(
    struct.__struct_config__.tag for struct in get_args(Hinge) if "axis" in struct.__struct_fields__
)
"""Kinds that have an axis of their own."""


class Closure(SceneStruct, frozen=True, kw_only=True):
    """A loop closure on top of the tree: a hinge between any two nodes, whose motions are not coordinates.

    Frame A is the node frame of `body_a` ("ground" too) displaced by `position_a_m`, `quaternion_a` (fixed offsets in
    node axes), frame B likewise on `body_b`. The closure lets B move relative to A as the hinge of that `type` lets its
    outboard frame move relative to its inboard one; `axis` has the same components in both frames. Initial coordinates
    need to fit only roughly: a near state that closes all loops is found, that keeps what is given (see
    AngularCoordinate). Its load is an output: on `body_b`, about B. A gimbal of two axes is a universal closure between
    turned frames, one of three a spherical one.
    """

    name: str
    type: Literal["weld", "revolute", "prismatic", "cylindrical", "universal", "spherical", "planar"]
    body_a: str
    node_a: str = "origin"
    body_b: str
    node_b: str = "origin"
    position_a_m: Vector = ZERO
    quaternion_a: Quaternion = IDENTITY
    position_b_m: Vector = ZERO
    quaternion_b: Quaternion = IDENTITY
    axis: Vector = Z_AXIS
