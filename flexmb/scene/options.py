"""Keyword arguments that methods of the builder have in common or that few scenes need, as typed dictionaries.

Type checkers and editors know their names, and other names are refused when a call is made. A name that is not given
has the default of the schema.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal, TypedDict

from numpy.typing import ArrayLike

from flexmb.scene import schema as s
from flexmb.scene.problems import closest


def refuse_others(what: str, names: Iterable[str], known: type) -> None:
    """TypeError for a name that a typed dictionary does not have, with the nearest that it has."""
    for name in names:
        if name not in known.__annotations__:
            raise TypeError(f'{what} has no "{name}": {closest(name, known.__annotations__)}')


class Placement(TypedDict, total=False):
    """Where a hinge sits: nodes of parent and child, and the hinge frames' fixed offsets from them (node axes, m)."""

    parent_node: str
    child_node: str
    parent_position: ArrayLike
    parent_quaternion: ArrayLike
    child_position: ArrayLike
    child_quaternion: ArrayLike


class Angle(TypedDict, total=False):
    """An angular coordinate: initial `angle` (rad) and `rate` (rad/s), `given` where both are kept, spring
    `stiffness` (N m/rad) about `rest` (rad), `damping` (N m s/rad), motor `torque` (N m) or `prescribed` angle (rad) as
    functions of time."""

    angle: float
    rate: float
    given: bool
    stiffness: float
    damping: float
    rest: float
    torque: s.Function | None
    prescribed: s.Function | None


class Displacement(TypedDict, total=False):
    """A linear coordinate: initial `position` (m) and `rate` (m/s), `given` where both are kept, spring `stiffness`
    (N/m) about `rest` (m), `damping` (N s/m), motor `force` (N) or `prescribed` displacement (m) as functions of
    time."""

    position: float
    rate: float
    given: bool
    stiffness: float
    damping: float
    rest: float
    force: s.Function | None
    prescribed: s.Function | None


class GivenHinge(Placement, total=False):
    """Where a hinge sits that has no scalar coordinates, and whether all its initial values are kept, `given`."""

    given: bool


class TurningHinge(Placement, Angle, total=False):
    """Where a hinge sits, and its one angle."""


class SlidingHinge(Placement, Displacement, total=False):
    """Where a hinge sits, and its one displacement."""


class BeamOptions(TypedDict, total=False):
    """How a beam becomes points and modes, see `flexmb.scene.schema.BeamBody`: `theory`, `mass` matrix, inertia
    `points`; and rigid lumps fixed to it, `tip_masses`."""

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


class ClosureFrames(TypedDict, total=False):
    """Frames A and B of a closure: nodes of its two bodies, and fixed offsets from them (node axes, m)."""

    node_a: str
    node_b: str
    position_a: ArrayLike
    quaternion_a: ArrayLike
    position_b: ArrayLike
    quaternion_b: ArrayLike


class SpringEnds(TypedDict, total=False):
    """Where a spring's ends are: nodes of its two bodies, and fixed offsets from them (node axes, m)."""

    node_a: str
    node_b: str
    position_a: ArrayLike
    position_b: ArrayLike


class LoadLaw(TypedDict, total=False):
    """How a spring resists a displacement x: `preload` + `stiffness` x + `stiffening`[0] x² ..., or `loads` over
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
    """When a controller acts: every `period` (s) from `offset` (s) on, its outputs changing `delay` (s) later; without
    a period always."""

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
    `upper`, time `tracking` (s) in which a limit takes back the integral."""

    kp: float
    ki: float
    kd: float
    setpoint: float
    filter: float
    lower: float | None
    upper: float | None
    tracking: float | None


class OwnLaw(Sampling, total=False):
    """Number of `outputs`, `initial` state and `parameters` of a function of one's own."""

    outputs: int
    initial: ArrayLike
    parameters: ArrayLike


class SectionShape(TypedDict, total=False):
    """A beam section's torsion constant `J` (m⁴), `shear_factor`, and station `x` (m)."""

    J: float | None
    shear_factor: float
    x: float
