"""THE schema of a scene: frozen typed structs. TOML, JSON Schema and the reference table are generated from them.

Conventions: SI; quaternions scalar-first, unit, mapping outboard (child) components to inboard components; names, never
indices; keys carry units. Frames, signs and orders: docs/notation.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import msgspec
from msgspec import structs

from flexmb.scene import connectors, couplings, hinges
from flexmb.scene.bodies import (
    ZERO,
    Axis,
    BeamBody,
    BeamNode,
    BeamStation,
    Body,
    InertiaPoint,
    Level,
    Matrix3,
    ModalBody,
    ModalNode,
    Modes,
    Node,
    Quaternion,
    RigidBody,
    SceneStruct,
    SidBody,
    StrainPolynomials,
    TipMass,
    Vector,
)
from flexmb.scene.connectors import *  # noqa: F403  (exported as that file says)
from flexmb.scene.connectors import Connector
from flexmb.scene.control import (
    Controller,
    CoordinateSensor,
    DistanceSensor,
    DriveSensor,
    GainTable,
    LoadSensor,
    MarkerSensor,
    Pid,
    ProfileSensor,
    Saturation,
    Sensor,
    StateSpace,
    TimeSensor,
    UserLaw,
)
from flexmb.scene.couplings import *  # noqa: F403
from flexmb.scene.couplings import Coupling
from flexmb.scene.events import Action, Change, Dock, EndRun, Impact, Latch, Release, SceneEvent, Separate
from flexmb.scene.freedoms import AngularCoordinate, Freedom, LinearCoordinate, MotionKeys, ScalarFreedom
from flexmb.scene.functions import Constant, ControlSignal, Function, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.scene.hinges import *  # noqa: F403
from flexmb.scene.hinges import Closure, Hinge
from flexmb.scene.pieces import cut_by_themselves
from flexmb.scene.quantities import PURE, Damping, Lump, NotNegative, Number, Positive, unit, within
from flexmb.scene.values import with_values

Spinning = Annotated[float, within(0.0, excluded=0.0, remedy="give a positive one: a wheel stores spin")]


class Wheel(SceneStruct, frozen=True, kw_only=True):
    """A symmetric, balanced wheel on a node of a body; `axis` in node axes, centre at the node plus `offset_m`.

    The data of the body do not include the wheel: `compile` adds the despun wheel (mass, axial and transverse inertia)
    to the body, as Frisch does. The spin is relative to the node. `torque_Nm` is the motor torque on the wheel,
    `friction_Nms_rad` viscous bearing friction, `prescribed_rad` a prescribed relative spin angle.
    """

    name: str
    body: str
    node: str = "origin"
    offset_m: Vector = ZERO
    axis: Axis
    mass_kg: NotNegative
    axial_inertia_kg_m2: Spinning
    transverse_inertia_kg_m2: Positive
    angle_rad: Number = 0.0
    speed_rad_s: Number = 0.0
    friction_Nms_rad: Damping = 0.0
    torque_Nm: Function | None = None
    prescribed_rad: Function | None = None

    KEYS: ClassVar[MotionKeys] = MotionKeys("angle_rad", "speed_rad_s", "torque_Nm", "prescribed_rad")

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """The wheel's turn about its axis, as a hinge would have it."""
        spin = AngularCoordinate(
            angle_rad=self.angle_rad, rate_rad_s=self.speed_rad_s, damping_Nms_rad=self.friction_Nms_rad,
            torque_Nm=self.torque_Nm, prescribed_rad=self.prescribed_rad,
        )  # fmt: skip
        return (ScalarFreedom("angle", self.axis, spin),)


class PointMass(SceneStruct, frozen=True, kw_only=True):
    """A point mass on a node of a body, free along 0 to 3 orthonormal `directions` (node axes)."""

    name: str
    body: str
    node: str = "origin"
    offset_m: Vector = ZERO
    mass_kg: Lump
    directions: tuple[Axis, ...] = ()
    coordinates: tuple[LinearCoordinate, ...] = ()

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Its slides, as a hinge would have them; without coordinates it is at rest, without spring."""
        given = self.coordinates or (LinearCoordinate(),) * len(self.directions)
        pairs = enumerate(zip(self.directions, given, strict=True))
        return tuple(ScalarFreedom(f"coordinates[{n}]", axis, coordinate) for n, (axis, coordinate) in pairs)


class Load(SceneStruct, frozen=True, kw_only=True):
    """A force or torque at a node: `direction` (unit vector, in World or in turning node axes) times `function`.

    Unit: N for type "force", Nm for type "torque".
    """

    name: str
    body: str
    node: str = "origin"
    type: Literal["force", "torque"]
    direction: Axis
    frame: Literal["world", "node"] = "world"
    function: Function


class Marker(SceneStruct, frozen=True, kw_only=True):
    """A named frame whose motion is an output, at a node plus a fixed offset in node axes."""

    name: str
    body: str
    node: str = "origin"
    offset_m: Vector = ZERO


class TotalLoad(SceneStruct, frozen=True, kw_only=True):
    """The sum of the loads that some hinges and closures exert on a body, about a node of it, as an output.

    It is determined where the sum is: how two parallel pins share a force follows from flexibility alone, but not what
    they carry together. `body` may be "ground".
    """

    name: str
    joints: tuple[str, ...]
    body: str
    node: str = "origin"


class ModalState(SceneStruct, frozen=True, kw_only=True):
    """Initial modal coordinates and rates of one flexible body (zero where not listed)."""

    body: str
    coordinates: tuple[Annotated[Number, PURE], ...]
    rates: tuple[Annotated[Number, unit("1/s")], ...] = ()


Waiver = Literal[
    "wave_speed", "thick_section", "shear_stiffness", "many_elements", "modal_frequency", "negative_stiffness",
    "negative_damping", "friction_peak", "uncut_beam", "level_range", "few_modes", "few_points",
    "few_polynomials", "held_stretch",
]  # fmt: skip


class Scene(SceneStruct, frozen=True, kw_only=True, weakref=True):
    """A multibody scene: bodies joined to a tree by hinges (base "ground"), with the loads and devices that act on it.

    Numbers that no usual structure has cause a warning, because errors of units have such effects; `allow` lists the
    warnings to be omitted. For beams: "wave_speed", sqrt(EA / mass per length) outside 50 to 20,000 m/s;
    "thick_section", sqrt(EI / EA) above half the length; "shear_stiffness", GJ or GA far above EI or EA;
    "many_elements", more elements than the modes need, which only cost time and memory. For raw modes:
    "modal_frequency", the lowest frequency times the size. For hinges, wheels and modes: "negative_stiffness",
    "negative_damping". For friction: "friction_peak", a peak of less than 99 % of static friction because of smoothing.
    For beams of level "exact": "uncut_beam", something inside a piece that makes strains jump; "few_points" and
    "few_polynomials", at rest or in a motion that bends the beam more than they can follow; "held_stretch", loads that
    would change the length of a beam whose stretch is held by a thousandth.
    For bodies with modes: "level_range", a turn that is fast beside the first frequency, at a level without stiffening;
    "few_modes", loads on a beam, its own or of what it is joined to, that would move a node by a thousandth of its
    length or 0.003 rad in a family of modes that `count` leaves out.
    A scene without dimensions, or in other consistent units than SI (mm, tonne, s, N), lists "wave_speed",
    "thick_section", "shear_stiffness" and "modal_frequency".
    """

    name: str
    description: str = ""
    allow: tuple[Waiver, ...] = ()
    gravity_m_s2: Vector = ZERO
    bodies: tuple[Body, ...]
    hinges: tuple[Hinge, ...]
    closures: tuple[Closure, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    connectors: tuple[Connector, ...] = ()
    wheels: tuple[Wheel, ...] = ()
    point_masses: tuple[PointMass, ...] = ()
    loads: tuple[Load, ...] = ()
    markers: tuple[Marker, ...] = ()
    total_loads: tuple[TotalLoad, ...] = ()
    modal_states: tuple[ModalState, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    controllers: tuple[Controller, ...] = ()
    events: tuple[SceneEvent, ...] = ()

    def __post_init__(self) -> None:
        """Beams of level "exact" are cut where something is joined to them or acts on them, unless they say where."""
        try:
            bodies = cut_by_themselves(self)
        except (AttributeError, TypeError):  # values of other types, which checks name with their places
            return
        if any(new is not body for new, body in zip(bodies, self.bodies, strict=True)):
            structs.force_setattr(self, "bodies", bodies)

    @property
    def constraints(self) -> tuple[Closure | Coupling, ...]:
        """All that makes a tree a closed chain: closures, then couplings."""
        return (*self.closures, *self.couplings)

    def with_values(self, values: Mapping[str, Any]) -> Scene:
        """The scene with other values, for sweeps and stages: `scene.with_values({"rod.mass_kg": 2.0})`.

        A path consists of keys, and names or numbers of items, `*` for all: see `flexmb.scene.values.with_values`.
        Raises PathError, a ValueError, for a path that does not exist, and for a value of another kind.
        """
        return with_values(self, values)


# msgspec keeps what it finds out about a struct in its class before it has found all: of two threads that decode their
# first scenes at once, one reads an unfinished part, and the process crashes. One thread alone imports a module.
msgspec.msgpack.Decoder(Scene)

__all__ = [
    "Action", "BeamBody", "BeamNode", "BeamStation", "Body", "Change", "Constant", "ControlSignal", "Controller",
    "CoordinateSensor", "DistanceSensor", "Dock", "DriveSensor", "EndRun", "Function", "GainTable", "Impact",
    "InertiaPoint", "Latch", "Level", "Load", "LoadSensor", "Marker", "MarkerSensor", "Matrix3", "ModalBody",
    "ModalNode", "ModalState", "Modes", "Node", "Pid", "PointMass", "ProfileSensor", "Pulse", "Quaternion", "Ramp",
    "Release", "RigidBody", "Saturation", "Scene", "SceneEvent", "Sensor", "Separate", "SidBody", "Sine", "SmoothStep",
    "SpinUp", "StateSpace", "StrainPolynomials", "Table", "TimeSensor", "TipMass", "TotalLoad", "UserLaw", "Vector",
    "Waiver", "Wheel",
]  # fmt: skip
__all__ += hinges.__all__
__all__ += connectors.__all__
__all__ += couplings.__all__
