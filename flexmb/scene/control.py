"""Feedback in a scene: sensors, controllers that read them, and by `ControlSignal` what the controllers' outputs drive.

A *signal* is a number that a sensor measures or a controller puts out. Inputs of controllers name them: a sensor
("gyro", all its numbers) or one of them ("gyro[2]"), or a controller that is listed before ("filter", "filter[0]").
A `flexmb.scene.functions.ControlSignal` takes the place of a function of time wherever a torque or a force stands.

A controller without `period_s` is continuous: its states are integrated with the motion. With a period it acts at
`offset_s`, `offset_s + period_s`, ...: it reads its inputs there, and `delay_s` later its outputs change, to be held
until they change again. Before that they are zero. No step of an integrator crosses such an instant.
"""

from __future__ import annotations

from typing import Literal

from flexmb.scene.bodies import SceneStruct
from flexmb.scene.functions import Function

Matrix = tuple[tuple[float, ...], ...]


class CoordinateSensor(SceneStruct, frozen=True, kw_only=True, tag="coordinate", tag_field="kind"):
    """Coordinates, or their speeds, of a hinge, wheel or point mass, or of `<body>.modes`: `of` names it.

    Quantity "rate" of a spherical or free hinge has its speeds: the angular velocity in outboard axes first.
    """

    name: str
    of: str
    quantity: Literal["value", "rate"] = "value"


class MarkerSensor(SceneStruct, frozen=True, kw_only=True, tag="marker", tag_field="kind"):
    """Motion of a marker, three numbers in World axes or its own; of "orientation" four, a quaternion to World.

    The quaternion is scalar-first, its scalar part never negative. "specific_force" is acceleration minus gravity, what
    an accelerometer shows.
    """

    name: str
    marker: str
    quantity: Literal[
        "position", "orientation", "velocity", "angular_velocity", "acceleration", "angular_acceleration",
        "specific_force",
    ]  # fmt: skip
    frame: Literal["world", "marker"] = "world"


class DistanceSensor(SceneStruct, frozen=True, kw_only=True, tag="distance", tag_field="kind"):
    """Distance of two markers (m) and its rate (m/s), two numbers: how far bodies are apart, how long a spring is."""

    name: str
    marker_a: str
    marker_b: str


class LoadSensor(SceneStruct, frozen=True, kw_only=True, tag="load", tag_field="kind"):
    """Total load across a hinge, six numbers [torque; force] on the outboard body about the hinge point, World axes.

    `hinge` may name a closure: then on body_b about its frame. By algorithm "articulated" it costs little in trees; in
    closed chains and by others, half a millisecond each time.
    """

    name: str
    hinge: str


class DriveSensor(SceneStruct, frozen=True, kw_only=True, tag="drive", tag_field="kind"):
    """Load of the drive that moves or holds a coordinate, prescribed or latched (N or N m); of a free one 0.

    What is beyond its spring, damper and motor, as in `drives` of a run. `coordinate`: "<hinge>.<key>" of a scalar
    coordinate, such as "root.rotation", or "<wheel>.angle".
    """

    name: str
    coordinate: str


class TimeSensor(SceneStruct, frozen=True, kw_only=True, tag="time", tag_field="kind"):
    """Time since the start (s)."""

    name: str


class ProfileSensor(SceneStruct, frozen=True, kw_only=True, tag="profile", tag_field="kind"):
    """A function of time and its rate, two numbers: a reference to follow."""

    name: str
    function: Function


Sensor = CoordinateSensor | MarkerSensor | DistanceSensor | LoadSensor | DriveSensor | TimeSensor | ProfileSensor


class _Controller(SceneStruct, frozen=True, kw_only=True, tag_field="kind"):
    name: str
    inputs: tuple[str, ...]
    period_s: float | None = None
    offset_s: float = 0.0
    delay_s: float = 0.0


class StateSpace(_Controller, frozen=True, kw_only=True, tag="state_space"):
    """A linear controller of states x, inputs u and outputs y.

    x' = A x + B u, y = C x + D u; with a period x becomes A x + B u when it acts, after y = C x + D u.
    A (n,n), B (n,m), C (p,n), D (p,m), x(0) = `initial` (n,), zero if left out. Without states D alone; D is zero if
    left out.
    """

    A: Matrix = ()
    B: Matrix = ()
    C: Matrix = ()
    D: Matrix = ()
    initial: tuple[float, ...] = ()


class Pid(_Controller, frozen=True, kw_only=True, tag="pid"):
    """y = kp e + integral of ki e + kd e', e = setpoint - input; between `lower` and `upper`.

    Inputs are one number, the measured one, or with a second one the setpoint in place of `setpoint`. The derivative is
    that of e behind a filter of the time constant `filter_s`, which starts at the first e; without `filter_s`, which is
    for a period only, the difference to the e before. A limit that is reached takes back the integral in the time
    `tracking_s`, kp / ki if left out.
    """

    kp: float = 0.0
    ki: float = 0.0
    kd: float = 0.0
    setpoint: float = 0.0
    filter_s: float = 0.0
    lower: float | None = None
    upper: float | None = None
    tracking_s: float | None = None


class Saturation(_Controller, frozen=True, kw_only=True, tag="saturation"):
    """Each input, not below `lower` and not above `upper`."""

    lower: float
    upper: float


class GainTable(_Controller, frozen=True, kw_only=True, tag="gain_table"):
    """A gain g(x) by the first input x, linear between `values` at `points` and constant beyond, times all others.

    With the first input alone the output is g(x) itself.
    """

    points: tuple[float, ...]
    values: tuple[float, ...]


class UserLaw(_Controller, frozen=True, kw_only=True, tag="user"):
    """A function of one's own, "module:function", of `outputs` numbers: see `flexmb.user_function`.

    function(t, inputs, state, parameters, outputs, change) writes `outputs` and `change`: the rate of `state`, or with
    a period its next value. The state starts at `initial`.
    """

    function: str
    outputs: int = 1
    initial: tuple[float, ...] = ()
    parameters: tuple[float, ...] = ()


Controller = StateSpace | Pid | Saturation | GainTable | UserLaw
