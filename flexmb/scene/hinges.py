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

from flexmb.scene.bodies import IDENTITY, ZERO, Axis, Quaternion, SceneStruct, Vector
from flexmb.scene.freedoms import AngularCoordinate, Ball, Floating, Freedom, LinearCoordinate, ScalarFreedom
from flexmb.scene.quantities import Damping, Number, Stiffness

__all__ = [
    "AngularCoordinate", "Closure", "Cylindrical", "Free", "Gimbal", "Hinge", "LinearCoordinate", "Planar", "Prismatic",
    "Revolute", "Screw", "Spherical", "Universal", "Weld",
]  # fmt: skip
"""What the schema exports."""

X_AXIS: Vector = (1.0, 0.0, 0.0)
Y_AXIS: Vector = (0.0, 1.0, 0.0)
Z_AXIS: Vector = (0.0, 0.0, 1.0)
AXES = {"x": X_AXIS, "y": Y_AXIS, "z": Z_AXIS}


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

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """What the hinge consists of, from the inboard frame outward; every kind says it."""
        raise NotImplementedError(f'hinge "{self.name}": {type(self).__name__} does not say which freedoms it has')


class Weld(_Hinge, frozen=True, kw_only=True, tag="weld"):
    """No freedom between `parent` ("ground" for the inertial frame) and `child`."""

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        return ()


class Revolute(_Hinge, frozen=True, kw_only=True, tag="revolute"):
    """One rotation about `axis` (inboard hinge axes)."""

    axis: Axis = Z_AXIS
    rotation: AngularCoordinate = AngularCoordinate()

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        return (ScalarFreedom("rotation", self.axis, self.rotation),)


class Screw(_Hinge, frozen=True, kw_only=True, tag="screw"):
    """One rotation about `axis`, with a translation along it of `pitch_m_rad` times the angle.

    A positive pitch is a right-handed screw; one that advances by h (m) a turn has the pitch h / (2 pi). The spring,
    damper and motor act on the angle: its torque does the work of the force along the axis too.
    """

    axis: Axis = Z_AXIS
    pitch_m_rad: Number
    rotation: AngularCoordinate = AngularCoordinate()

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        return (ScalarFreedom("rotation", self.axis, self.rotation, self.pitch_m_rad),)


class Prismatic(_Hinge, frozen=True, kw_only=True, tag="prismatic"):
    """One translation along `axis`."""

    axis: Axis = Z_AXIS
    translation: LinearCoordinate = LinearCoordinate()

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        return (ScalarFreedom("translation", self.axis, self.translation),)


class Cylindrical(_Hinge, frozen=True, kw_only=True, tag="cylindrical"):
    """Rotation about and translation along `axis`. Speeds: [rotation, translation]."""

    axis: Axis = Z_AXIS
    rotation: AngularCoordinate = AngularCoordinate()
    translation: LinearCoordinate = LinearCoordinate()

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        return (
            ScalarFreedom("rotation", self.axis, self.rotation),
            ScalarFreedom("translation", self.axis, self.translation),
        )


class Universal(_Hinge, frozen=True, kw_only=True, tag="universal"):
    """Rotation about x of the inboard frame, then about the carried y."""

    first: AngularCoordinate = AngularCoordinate()
    second: AngularCoordinate = AngularCoordinate()

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        return ScalarFreedom("first", X_AXIS, self.first), ScalarFreedom("second", Y_AXIS, self.second)


class Gimbal(_Hinge, frozen=True, kw_only=True, tag="gimbal"):
    """Two or three successive rotations about carried axes (Frisch's free coordinate vectors), e.g. "zxz", "xyz".

    Singular where the first and last of three axes align.
    """

    sequence: str = "xyz"
    rotations: tuple[AngularCoordinate, ...] = (AngularCoordinate(), AngularCoordinate(), AngularCoordinate())

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        return tuple(
            ScalarFreedom(f"rotations[{n}]", AXES[letter], rotation)
            for n, (letter, rotation) in enumerate(zip(self.sequence, self.rotations, strict=True))
        )


class Spherical(_Hinge, frozen=True, kw_only=True, tag="spherical"):
    """Three rotations; coordinate: quaternion (scalar first) of outboard relative to inboard axes; speeds: relative
    angular velocity in outboard axes. The spring torque is -stiffness * rotation vector. `given` as of an angle."""

    quaternion: Quaternion = IDENTITY
    angular_velocity_rad_s: Vector = ZERO
    given: bool = False
    stiffness_Nm_rad: Stiffness = 0.0
    damping_Nms_rad: Damping = 0.0

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        return (Ball(self.quaternion, self.angular_velocity_rad_s, self.stiffness_Nm_rad, self.damping_Nms_rad),)


class Planar(_Hinge, frozen=True, kw_only=True, tag="planar"):
    """Translation in the x-y plane of the inboard frame, then rotation about z. Speeds: [xdot, ydot, angle rate]."""

    x: LinearCoordinate = LinearCoordinate()
    y: LinearCoordinate = LinearCoordinate()
    rotation: AngularCoordinate = AngularCoordinate()

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        return (
            ScalarFreedom("x", X_AXIS, self.x),
            ScalarFreedom("y", Y_AXIS, self.y),
            ScalarFreedom("rotation", Z_AXIS, self.rotation),
        )


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

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        return (Floating(self.position_m, self.quaternion, self.angular_velocity_rad_s, self.velocity_m_s),)


Hinge = Weld | Revolute | Prismatic | Cylindrical | Universal | Gimbal | Spherical | Planar | Free | Screw
WITH_AXIS = (
    *(struct.__struct_config__.tag for struct in get_args(Hinge) if "axis" in struct.__struct_fields__),
    "in_line", "in_plane",
)  # fmt: skip
"""Kinds of hinges and closures that have an axis of their own."""


ClosureKind = Literal[
    "weld", "revolute", "prismatic", "cylindrical", "universal", "spherical", "planar", "in_line", "in_plane"
]


class Closure(SceneStruct, frozen=True, kw_only=True):
    """A loop closure on top of the tree: a hinge between any two nodes, whose motions are not coordinates.

    Frame A is the node frame of `body_a` ("ground" too) displaced by `position_a_m`, `quaternion_a` (fixed offsets in
    node axes), frame B likewise on `body_b`. The closure lets B move relative to A as the hinge of that `type` lets its
    outboard frame move relative to its inboard one; `axis` has the same components in both frames. Two more types are
    no hinges, as B may turn at will: `in_line` keeps its origin on the line along `axis` of A (a pin in a slot, a ball
    in a groove), `in_plane` in the plane across it. Initial coordinates need to fit only roughly: a near state that
    closes all loops is found, that keeps what is given (see AngularCoordinate). Its load is an output: on `body_b`,
    about B. A gimbal of two axes is a universal closure between turned frames, one of three a spherical one.

    With `closed = false` it is open at the start: it suppresses nothing and its load is zero, until an event closes it
    (`Dock`). Events open closures by `Separate`.
    """

    name: str
    type: ClosureKind
    body_a: str
    node_a: str = "origin"
    body_b: str
    node_b: str = "origin"
    position_a_m: Vector = ZERO
    quaternion_a: Quaternion = IDENTITY
    position_b_m: Vector = ZERO
    quaternion_b: Quaternion = IDENTITY
    axis: Axis = Z_AXIS
    closed: bool = True
