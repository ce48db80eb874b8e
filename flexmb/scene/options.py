"""Keyword arguments of the builder's methods that are shared or rarely needed, as typed dictionaries.

Type checkers and editors know their names; calls refuse other names. Omitted arguments have the defaults of the schema.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal, TypedDict

from numpy.typing import ArrayLike

from flexmb.scene import schema as s
from flexmb.scene.problems import closest


def refuse_others(what: str, names: Iterable[str], known: type) -> None:
    """TypeError for a name that a typed dictionary does not declare, with the nearest name that it declares."""
    for name in names:
        if name not in known.__annotations__:
            raise TypeError(f'{what} has no "{name}": {closest(name, known.__annotations__)}')


class Placement(TypedDict, total=False):
    """Hinge frames: nodes of parent and child, and fixed offsets from them (node axes, m)."""

    parent_node: str
    child_node: str
    parent_position: ArrayLike
    parent_quaternion: ArrayLike
    child_position: ArrayLike
    child_quaternion: ArrayLike


class Angle(TypedDict, total=False):
    """An angular coordinate: initial `angle` (rad) and `rate` (rad/s), `given` if closures must keep both, spring
    `stiffness` (N m/rad) about `rest` (rad), `damping` (N m s/rad), `armature` (kg m²), motor `torque` (N m) or
    `prescribed` angle (rad) as functions of time."""

    angle: float
    rate: float
    given: bool
    stiffness: float
    damping: float
    rest: float
    armature: float
    torque: s.Function | None
    prescribed: s.Function | None


class Displacement(TypedDict, total=False):
    """A linear coordinate: initial `position` (m) and `rate` (m/s), `given` if closures must keep both, spring
    `stiffness` (N/m) about `rest` (m), `damping` (N s/m), `armature` (kg), motor `force` (N) or `prescribed`
    displacement (m) as functions of time."""

    position: float
    rate: float
    given: bool
    stiffness: float
    damping: float
    rest: float
    armature: float
    force: s.Function | None
    prescribed: s.Function | None


class GivenHinge(Placement, total=False):
    """Frames of a hinge without scalar coordinates, and whether closures must keep all its initial values, `given`."""

    given: bool


class TurningHinge(Placement, Angle, total=False):
    """Frames of a hinge with one angle, and the angle."""


class SlidingHinge(Placement, Displacement, total=False):
    """Frames of a hinge with one displacement, and the displacement."""


class BeamOptions(TypedDict, total=False):
    """Model of a beam, see `flexmb.scene.schema.BeamBody`: `theory`, `mass` matrix, inertia `points`; and rigid lumps
    fixed to it, `tip_masses`."""

    theory: Literal["euler-bernoulli", "timoshenko"]
    mass: Literal["consistent", "lumped"]
    points: Literal["line", "rotary", "section"]
    tip_masses: Sequence[s.TipMass]


class ModalMatrices(TypedDict, total=False):
    """`stiffness`, `damping`: modal matrices (m,m). `gravity_stiffness` (3,m,m) and `gradient_stiffness` (3,3,m,m):
    geometric stiffness under unit loads, see `flexmb.scene.schema.ModalBody`."""

    stiffness: ArrayLike
    damping: ArrayLike
    gravity_stiffness: ArrayLike
    gradient_stiffness: ArrayLike


class WheelMotion(TypedDict, total=False):
    """A wheel's `offset` (m) from its node, initial `angle` (rad) and `speed` (rad/s), `friction` (N m s/rad), motor
    `torque` (N m) or `prescribed` angle (rad) as functions of time."""

    offset: ArrayLike
    angle: float
    speed: float
    friction: float
    torque: s.Function | None
    prescribed: s.Function | None


class SpringEnds(TypedDict, total=False):
    """Ends of a spring: nodes of its two bodies, and fixed offsets from them (node axes, m)."""

    node_a: str
    node_b: str
    position_a: ArrayLike
    position_b: ArrayLike


class ClosureFrames(SpringEnds, total=False):
    """Frames A and B of a closure: nodes of its two bodies, and fixed offsets from them (node axes, m)."""

    quaternion_a: ArrayLike
    quaternion_b: ArrayLike


class LoadLaw(TypedDict, total=False):
    """Load of a spring at a displacement x: `preload` + `stiffness` x + `stiffening`[0] x² ..., or `loads` over
    `table`; and `damping`."""

    preload: float
    stiffness: float
    stiffening: Sequence[float]
    table: ArrayLike
    loads: ArrayLike
    damping: float


class SpringOptions(SpringEnds, LoadLaw, total=False):
    """Ends and law, the `free_length` (m) from which x counts, whether it `acts` in "tension" or "compression" only,
    and an actuator's `force` (N) as a function of time: positive pushes the ends apart."""

    free_length: float
    acts: Literal["both", "tension", "compression"]
    force: s.Function | None


class HingeSpringOptions(LoadLaw, total=False):
    """Which `coordinate` of the hinge, the law about `rest`, and stops at `lower` and `upper` (rad or m) with their
    `stop_stiffness` and `stop_dissipation` (s/rad or s/m); an actuator's `torque` (N m) along an angle,
    `force` (N) along a displacement."""

    coordinate: str
    rest: float
    lower: float | None
    upper: float | None
    stop_stiffness: float
    stop_dissipation: float
    torque: s.Function | None
    force: s.Function | None


class FrictionOptions(TypedDict, total=False):
    """Which `coordinate` of the hinge, and static friction `static` (N m or N) with its `stribeck` speed."""

    coordinate: str
    static: float | None
    stribeck: float | None


class Sampling(TypedDict, total=False):
    """Sampling of a controller: every `period` (s) from `offset` (s) on, with outputs that change `delay` (s) later;
    without a period the controller is continuous."""

    period: float | None
    offset: float
    delay: float


class LinearLaw(Sampling, total=False):
    """Matrices `A`, `B`, `C`, `D` and `initial` states of a linear controller."""

    A: ArrayLike
    B: ArrayLike
    C: ArrayLike
    D: ArrayLike
    initial: ArrayLike


class PidLaw(Sampling, total=False):
    """Gains `kp`, `ki`, `kd`, constant `setpoint`, time constant `filter` (s) of the derivative, limits `lower` and
    `upper`, time constant `tracking` (s) of the anti-windup."""

    kp: float
    ki: float
    kd: float
    setpoint: float
    filter: float
    lower: float | None
    upper: float | None
    tracking: float | None


class OwnLaw(Sampling, total=False):
    """Number of `outputs`, `initial` state and `parameters` of a user's function."""

    outputs: int
    initial: ArrayLike
    parameters: ArrayLike


class SectionShape(TypedDict, total=False):
    """A beam section's torsion constant `J` (m⁴), `shear_factor`, and station `x` (m)."""

    J: float | None
    shear_factor: float
    x: float
