"""Connectors of a scene: springs, dampers, actuators, bushings and friction, which exert loads and suppress nothing.

Those between two nodes act on frame A, on a node of `body_a` displaced by fixed offsets in node axes, and frame B,
likewise on `body_b`; either may be the ground, both may be on one body. Those along a hinge act on one of its scalar
coordinates. What resists a displacement is positive: a stretched spring's tension, a turned spring's torque back.
A law is `preload` + `stiffness` x + `stiffening[0]` x² + `stiffening[1]` x³ ..., or a table of loads over x.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from flexmb.scene.bodies import IDENTITY, ZERO, Matrix6, Quaternion, SceneStruct, Vector
from flexmb.scene.functions import Function
from flexmb.scene.keys import split_unit
from flexmb.scene.quantities import NotNegative, Number, unit, within

__all__ = [
    "AngularFriction", "AngularSpring", "Bushing", "Connector", "LinearFriction", "LinearSpring", "SpringDamper",
]  # fmt: skip
"""What the schema exports."""

Stiffening = tuple[Annotated[Number, unit("of the load, per power of x")], ...]
Stribeck = Annotated[float, within(0.0, excluded=0.0, noun="Stribeck speed")]
SLOW = "give a speed well below those that matter, or 0 for friction that sticks"
Smoothing = Annotated[float, within(0.0, noun="smoothing speed", remedy=SLOW)]
Phase = Literal["undecided", "idle", "sticking", "forward", "backward"]
NONE6: Matrix6 = ((0.0,) * 6,) * 6


class SpringDamper(SceneStruct, frozen=True, kw_only=True, tag_field="kind", tag="spring_damper"):
    """A spring, damper and actuator along the line from A to B.

    x is the distance beyond `free_length_m`, the law its tension; or `loads_N` over `table_m`, a smooth curve through
    the samples that keeps their rises and falls (PCHIP), continued by its end slopes. `acts = "tension"` makes a cable:
    it neither pushes nor damps while slack; "compression" a buffer that touches below `free_length_m`. `force_N` is an
    actuator: positive pushes A and B apart. The load is an output: on `body_b`, about B.
    """

    name: str
    body_a: str
    node_a: str = "origin"
    body_b: str
    node_b: str = "origin"
    position_a_m: Vector = ZERO
    position_b_m: Vector = ZERO
    free_length_m: NotNegative = 0.0
    preload_N: Number = 0.0
    stiffness_N_m: Number = 0.0
    stiffening: Stiffening = ()
    table_m: tuple[Number, ...] = ()
    loads_N: tuple[Number, ...] = ()
    damping_Ns_m: NotNegative = 0.0
    acts: Literal["both", "tension", "compression"] = "both"
    force_N: Function | None = None

    ACTUATOR: ClassVar[str] = "force_N"


class Bushing(SceneStruct, frozen=True, kw_only=True, tag_field="kind", tag="bushing"):
    """Elasticity and damping of all relative motions of frame B seen from frame A, in axes of A.

    The displacement is [rotation vector of B; position of B], `stiffness` and `damping` are symmetric (6,6) in this
    order: N m/rad, N/m and what couples them. Energy is that of the stiffness, and the load is exactly its derivative,
    for any rotation below 170 degrees; a run that turns a bushing further stops. The load is an output: on `body_b`,
    about B.
    """

    name: str
    body_a: str
    node_a: str = "origin"
    body_b: str
    node_b: str = "origin"
    position_a_m: Vector = ZERO
    quaternion_a: Quaternion = IDENTITY
    position_b_m: Vector = ZERO
    quaternion_b: Quaternion = IDENTITY
    stiffness: Annotated[Matrix6, unit("N m/rad, N/rad, N/m")]
    damping: Annotated[Matrix6, unit("N m s/rad, N s/rad, N s/m")] = NONE6


class AngularSpring(SceneStruct, frozen=True, kw_only=True, tag_field="kind", tag="angular_spring"):
    """A nonlinear spring, damper and actuator along an angle of a hinge, beside what the hinge has itself, and stops.

    `coordinate` names the angle as the hinge does ("rotation", "first", "rotations[1]"); it may be left out where there
    is only one. x is the angle beyond `rest_rad`; or `loads_Nm` over `table_rad`, see SpringDamper. Beyond `lower_rad`
    or `upper_rad` a stop pushes back by `stop_stiffness_Nm_rad` d (1 + `stop_dissipation_s_rad` d'), where d is how
    deep it is pressed in; it never pulls. `torque_Nm` is an actuator that acts as the motor of a hinge does: one
    more drive, for any number of springs may share a coordinate.
    """

    name: str
    hinge: str
    coordinate: str = ""
    rest_rad: Number = 0.0
    preload_Nm: Number = 0.0
    stiffness_Nm_rad: Number = 0.0
    stiffening: Stiffening = ()
    table_rad: tuple[Number, ...] = ()
    loads_Nm: tuple[Number, ...] = ()
    damping_Nms_rad: NotNegative = 0.0
    lower_rad: Number | None = None
    upper_rad: Number | None = None
    stop_stiffness_Nm_rad: NotNegative = 0.0
    stop_dissipation_s_rad: NotNegative = 0.0
    torque_Nm: Function | None = None

    ANGULAR: ClassVar[bool] = True
    ACTUATOR: ClassVar[str] = "torque_Nm"


class LinearSpring(SceneStruct, frozen=True, kw_only=True, tag_field="kind", tag="linear_spring"):
    """The same along a displacement of a hinge or point mass, with an actuator `force_N`: see AngularSpring."""

    name: str
    hinge: str
    coordinate: str = ""
    rest_m: Number = 0.0
    preload_N: Number = 0.0
    stiffness_N_m: Number = 0.0
    stiffening: Stiffening = ()
    table_m: tuple[Number, ...] = ()
    loads_N: tuple[Number, ...] = ()
    damping_Ns_m: NotNegative = 0.0
    lower_m: Number | None = None
    upper_m: Number | None = None
    stop_stiffness_N_m: NotNegative = 0.0
    stop_dissipation_s_m: NotNegative = 0.0
    force_N: Function | None = None

    ANGULAR: ClassVar[bool] = False
    ACTUATOR: ClassVar[str] = "force_N"


class AngularFriction(SceneStruct, frozen=True, kw_only=True, tag_field="kind", tag="angular_friction"):
    """Dry friction along an angle of a hinge, or in the bearing of a wheel; `hinge` names either.

    The torque is `sliding_Nm`, near rest rising to `static_Nm` as Hess and Soom have it, and smooth through zero:
    [sliding + (static - sliding) / (1 + (v / stribeck)²)] v / sqrt(v² + smoothing²), v the rate. What would stick
    creeps with a rate of the order of `smoothing_rad_s`; the smaller it is, the stiffer the equations.

    With a smoothing of 0 it sticks: where the rate comes to zero, the coordinate is held as long as the load that this
    takes is `static_Nm` at most; beyond, it slips. `stribeck_rad_s` may then be left out: friction is `sliding_Nm` at
    every rate but zero. `phase` is what a run writes into the scene of its restart; leave it out.
    """

    name: str
    hinge: str
    coordinate: str = ""
    sliding_Nm: NotNegative
    static_Nm: NotNegative | None = None
    stribeck_rad_s: Stribeck | None = None
    smoothing_rad_s: Smoothing
    phase: Phase = "undecided"

    ANGULAR: ClassVar[bool] = True


class LinearFriction(SceneStruct, frozen=True, kw_only=True, tag_field="kind", tag="linear_friction"):
    """Dry friction along a displacement of a hinge or point mass: see AngularFriction."""

    name: str
    hinge: str
    coordinate: str = ""
    sliding_N: NotNegative
    static_N: NotNegative | None = None
    stribeck_m_s: Stribeck | None = None
    smoothing_m_s: Smoothing
    phase: Phase = "undecided"

    ANGULAR: ClassVar[bool] = False


BetweenNodes = SpringDamper | Bushing
HingeSpring = AngularSpring | LinearSpring
HingeFriction = AngularFriction | LinearFriction
AlongHinge = HingeSpring | HingeFriction
Connector = BetweenNodes | AlongHinge


def sticks(connector: Connector) -> bool:
    """Whether it is friction with a true zero of the speed."""
    return isinstance(connector, HingeFriction) and by_stem(connector)["smoothing"] == 0.0


def by_stem(connector: Connector) -> dict[str, Any]:
    """The values of a connector by their keys without units: those of angles and displacements are called alike."""
    return {split_unit(key)[0]: getattr(connector, key) for key in connector.__struct_fields__}


def actuator(connector: SpringDamper | HingeSpring) -> Function | None:
    """What its actuator does over time."""
    function: Function | None = getattr(connector, connector.ACTUATOR)
    return function
