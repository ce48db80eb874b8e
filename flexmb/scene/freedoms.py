"""Elementary freedoms: what every hinge, wheel and point mass consists of, from its inboard frame to its outboard one.

A freedom is a turn about an axis, a shift along it, both at once by one coordinate, a ball joint or free flight. Its
axes are carried along by the freedoms before it. The directions of a hinge, the joints of other codes, and the effect
of mirrors and units on a hinge follow from its freedoms.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, NamedTuple

from flexmb.scene.bodies import Quaternion, SceneStruct, Vector
from flexmb.scene.functions import Function
from flexmb.scene.quantities import Damping, Number, Stiffness, within

Armature = Annotated[float, within(0.0, remedy="give at least zero: it is the inertia of a rotor")]


class MotionKeys(NamedTuple):
    """The keys under which a coordinate, or a wheel, has its initial value and rate, its motor and prescribed value."""

    value: str
    rate: str
    effort: str
    prescribed: str


class _ScalarCoordinate(SceneStruct, frozen=True, kw_only=True):
    """The common properties of angles and displacements, whose keys have different units."""

    KEYS: ClassVar[MotionKeys]
    ANGULAR: ClassVar[bool]
    UNIT: ClassVar[str]
    SPRING: ClassVar[tuple[str, str, str]]
    ARMATURE: ClassVar[str]

    @property
    def value(self) -> float:
        """Initial value (rad or m)."""
        return float(getattr(self, self.KEYS.value))

    @property
    def rate(self) -> float:
        """Initial rate (rad/s or m/s)."""
        return float(getattr(self, self.KEYS.rate))

    @property
    def effort(self) -> Function | None:
        """The motor (N m or N)."""
        function: Function | None = getattr(self, self.KEYS.effort)
        return function

    @property
    def prescribed(self) -> Function | None:
        """The prescribed value (rad or m)."""
        function: Function | None = getattr(self, self.KEYS.prescribed)
        return function

    @property
    def spring(self) -> tuple[float, float, float]:
        """Stiffness, damping and value at rest (N m, rad, s or N, m, s)."""
        stiffness, damping, rest = (float(getattr(self, key)) for key in self.SPRING)
        return stiffness, damping, rest

    @property
    def armature(self) -> float:
        """Inertia of the drive that moves with the coordinate (kg m^2 or kg)."""
        return float(getattr(self, self.ARMATURE))


class AngularCoordinate(_ScalarCoordinate, frozen=True, kw_only=True):
    """One angle: initial value and rate, spring, damper, armature, motor, or prescribed motion.

    The armature is the inertia of the rotor of a drive, as the coordinate feels it: with a gear ratio n and a rotor of
    moment of inertia I it is n^2 I. Its kinetic energy is half of it times the square of the rate; it has no momentum.

    With closures, initial values other than zero are kept exactly if the other coordinates can be chosen to close the
    loops, and are changed with a warning if they contradict each other. With `given = true`, both must be kept, also if
    they are zero, and it is an error if they cannot be; angles and displacements without it are then only guesses,
    which determine in which of several ways a loop is assembled.
    """

    KEYS: ClassVar[MotionKeys] = MotionKeys("angle_rad", "rate_rad_s", "torque_Nm", "prescribed_rad")
    ANGULAR: ClassVar[bool] = True
    UNIT: ClassVar[str] = "rad"
    SPRING: ClassVar[tuple[str, str, str]] = ("stiffness_Nm_rad", "damping_Nms_rad", "rest_rad")
    ARMATURE: ClassVar[str] = "armature_kg_m2"

    angle_rad: Number = 0.0
    rate_rad_s: Number = 0.0
    given: bool = False
    stiffness_Nm_rad: Stiffness = 0.0
    damping_Nms_rad: Damping = 0.0
    rest_rad: Number = 0.0
    armature_kg_m2: Armature = 0.0
    torque_Nm: Function | None = None
    prescribed_rad: Function | None = None


class LinearCoordinate(_ScalarCoordinate, frozen=True, kw_only=True):
    """One displacement: initial value and rate, spring, damper, armature, motor, or prescribed motion.

    `given` and the armature as of an angle.
    """

    KEYS: ClassVar[MotionKeys] = MotionKeys("position_m", "rate_m_s", "force_N", "prescribed_m")
    ANGULAR: ClassVar[bool] = False
    UNIT: ClassVar[str] = "m"
    SPRING: ClassVar[tuple[str, str, str]] = ("stiffness_N_m", "damping_Ns_m", "rest_m")
    ARMATURE: ClassVar[str] = "armature_kg"

    position_m: Number = 0.0
    rate_m_s: Number = 0.0
    given: bool = False
    stiffness_N_m: Stiffness = 0.0
    damping_Ns_m: Damping = 0.0
    rest_m: Number = 0.0
    armature_kg: Armature = 0.0
    force_N: Function | None = None
    prescribed_m: Function | None = None


Coordinate = AngularCoordinate | LinearCoordinate


class ScalarFreedom(NamedTuple):
    """One coordinate, called `name`: of an angle a turn about `axis`, of a displacement a shift along it.

    With a `pitch` (m/rad) a turn shifts along its axis too, by the pitch times the angle: a screw.
    """

    name: str
    axis: Vector
    coordinate: Coordinate
    pitch: float = 0.0

    @property
    def motion(self) -> Literal["turn", "slide", "screw"]:
        """Which elementary joint it is."""
        if not self.coordinate.ANGULAR:
            return "slide"
        return "screw" if self.pitch else "turn"

    @property
    def turns(self) -> float:
        """rad about the axis per unit of the coordinate."""
        return 1.0 if self.coordinate.ANGULAR else 0.0

    @property
    def shifts(self) -> float:
        """m along the axis per unit of the coordinate."""
        return self.pitch if self.coordinate.ANGULAR else 1.0

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers of coordinates and speeds."""
        return 1, 1


class Ball(NamedTuple):
    """Quaternion and angular velocity (rad/s) in outboard axes; torque -stiffness * rotation vector - damping * w."""

    quaternion: Quaternion
    angular_velocity: Vector
    stiffness: float
    damping: float

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers of coordinates and speeds."""
        return 4, 3


class Floating(NamedTuple):
    """Position (m) of the outboard origin in inboard axes, quaternion; both velocities relative, in outboard axes."""

    position: Vector
    quaternion: Quaternion
    angular_velocity: Vector
    velocity: Vector

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers of coordinates and speeds."""
        return 7, 6


Freedom = ScalarFreedom | Ball | Floating
