"""Feedback in a scene: sensors, controllers that read them, and actuation by `ControlSignal`.

A *signal* is a number that a sensor measures or a controller computes. The inputs of a controller are named: a sensor
("gyro", all its numbers), one of its numbers ("gyro[2]"), or a controller listed before ("filter", "filter[0]"). A
`flexmb.scene.functions.ControlSignal` can replace the function of time of any torque or force.

A controller without `period_s` is continuous: its states are integrated with the motion. With a period it is sampled at
`offset_s`, `offset_s + period_s`, ...: it reads its inputs at these instants, and its outputs change `delay_s` later
and are held until the next change. Before the first change they are zero. No step of an integrator crosses such an
instant.
"""

from __future__ import annotations

from typing import Annotated, Literal

from flexmb.scene.bodies import Matrix, SceneStruct
from flexmb.scene.functions import Function
from flexmb.scene.quantities import Number, Positive, Time, unit, whole, within

Period = Annotated[float, within(0.0, excluded=0.0, remedy="give a positive one, or leave it out")]
Mixed = unit("of what it leads to, per one of what it multiplies")
Entries = Annotated[Matrix, Mixed]
OfLaw = tuple[Annotated[Number, unit("of the law")], ...]
Gain = Annotated[Number, Mixed]
OfSignal = Annotated[Number, unit("of the signal")]

MOST_OUTPUTS = 10_000
"""Of a user's law, whose outputs have a place each in every row of a run."""


class CoordinateSensor(SceneStruct, frozen=True, kw_only=True, tag="coordinate", tag_field="kind"):
    """Coordinates, or their speeds, of a hinge, wheel or point mass, or of `<body>.modes`, whichever `of` names.

    The "rate" of a spherical or free hinge consists of its speeds, the angular velocity in outboard axes first.
    """

    name: str
    of: str
    quantity: Literal["value", "rate"] = "value"


class MarkerSensor(SceneStruct, frozen=True, kw_only=True, tag="marker", tag_field="kind"):
    """Motion of a marker: three numbers in World axes or its own axes, or the "orientation" as a quaternion to World.

    The quaternion is scalar-first, its scalar part never negative. "specific_force" is acceleration minus gravity, the
    reading of an accelerometer.
    """

    name: str
    marker: str
    quantity: Literal[
        "position", "orientation", "velocity", "angular_velocity", "acceleration", "angular_acceleration",
        "specific_force",
    ]  # fmt: skip
    frame: Literal["world", "marker"] = "world"


class DistanceSensor(SceneStruct, frozen=True, kw_only=True, tag="distance", tag_field="kind"):
    """Distance of two markers (m) and its rate (m/s), two numbers."""

    name: str
    marker_a: str
    marker_b: str


class LoadSensor(SceneStruct, frozen=True, kw_only=True, tag="load", tag_field="kind"):
    """Total load across a hinge, six numbers [torque; force] on the outboard body about the hinge point, World axes.

    `hinge` may name a closure: the load is then that on body_b about its frame. With algorithm "articulated" it costs
    little in trees; in closed chains and with other algorithms, half a millisecond for each evaluation.
    """

    name: str
    hinge: str


class DriveSensor(SceneStruct, frozen=True, kw_only=True, tag="drive", tag_field="kind"):
    """Load of the drive of a prescribed or latched coordinate (N or N m); 0 for a free coordinate.

    Like `drives` of a run, it does not include spring, damper and motor of the coordinate. `coordinate`:
    "<hinge>.<key>" of a scalar coordinate, such as "root.rotation", or "<wheel>.angle".
    """

    name: str
    coordinate: str


class TimeSensor(SceneStruct, frozen=True, kw_only=True, tag="time", tag_field="kind"):
    """Time since the start (s)."""

    name: str


class ProfileSensor(SceneStruct, frozen=True, kw_only=True, tag="profile", tag_field="kind"):
    """A function of time and its rate, two numbers, for example a reference to be tracked."""

    name: str
    function: Function


Sensor = CoordinateSensor | MarkerSensor | DistanceSensor | LoadSensor | DriveSensor | TimeSensor | ProfileSensor


class _Controller(SceneStruct, frozen=True, kw_only=True, tag_field="kind"):
    name: str
    inputs: tuple[str, ...]
    period_s: Period | None = None
    offset_s: Time = 0.0
    delay_s: Time = 0.0


class StateSpace(_Controller, frozen=True, kw_only=True, tag="state_space"):
    """A linear controller with states x, inputs u and outputs y.

    Continuous: x' = A x + B u, y = C x + D u. Sampled: at each sample y = C x + D u, then x := A x + B u. A (n,n),
    B (n,m), C (p,n), D (p,m); x(0) = `initial` (n,), by default zero. Without states only D is given; with states D is
    zero by default.
    """

    A: Entries = ()
    B: Entries = ()
    C: Entries = ()
    D: Entries = ()
    initial: OfLaw = ()


class Pid(_Controller, frozen=True, kw_only=True, tag="pid"):
    """y = kp e + integral of ki e + kd e', e = setpoint - input, limited to the range `lower` to `upper`.

    The input is the measured number; a second input replaces `setpoint`. The derivative is that of e after a
    first-order filter with the time constant `filter_s`, which starts at the first e; a sampled controller without
    `filter_s` uses the difference from the previous e. At a limit, back-calculation with the time constant
    `tracking_s`, by default kp / ki, prevents wind-up of the integral.
    """

    kp: Gain = 0.0
    ki: Gain = 0.0
    kd: Gain = 0.0
    setpoint: OfSignal = 0.0
    filter_s: Time = 0.0
    lower: OfSignal | None = None
    upper: OfSignal | None = None
    tracking_s: Positive | None = None


class Saturation(_Controller, frozen=True, kw_only=True, tag="saturation"):
    """Each input, limited to the range `lower` to `upper`."""

    lower: OfSignal
    upper: OfSignal


class GainTable(_Controller, frozen=True, kw_only=True, tag="gain_table"):
    """Gain scheduling: g(x) times all inputs after the first, where x is the first input.

    g is linear between `values` at `points` and constant beyond. If x is the only input, the output is g(x) itself.
    """

    points: tuple[OfSignal, ...]
    values: tuple[Gain, ...]


class UserLaw(_Controller, frozen=True, kw_only=True, tag="user"):
    """A user's function, "module:function", that computes `outputs` numbers: see `flexmb.user_function`.

    function(t, inputs, state, parameters, outputs, change) writes `outputs` and `change`: the rate of `state`, or its
    next value if the controller is sampled. The state starts at `initial`.
    """

    function: str
    outputs: Annotated[int, whole(1, MOST_OUTPUTS, noun="outputs", remedy=f"give 1 to {MOST_OUTPUTS}")] = 1
    initial: OfLaw = ()
    parameters: OfLaw = ()


Controller = StateSpace | Pid | Saturation | GainTable | UserLaw
