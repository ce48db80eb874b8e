"""A builder for scenes in Python, each of whose methods appends a struct of the schema.

Argument names are the schema's keys without their unit. Every value is SI; quaternions are scalar-first, have unit
length and map outboard components to inboard ones. Arrays are accepted in place of tuples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Self, Unpack

import msgspec
from numpy.typing import ArrayLike

from flexmb.scene import options as o
from flexmb.scene import schema as s
from flexmb.scene.bodies import IDENTITY, ZERO
from flexmb.scene.check import check_scene
from flexmb.scene.collecting import make
from flexmb.scene.connecting import ConnectorMaker
from flexmb.scene.convert import plain, to_struct
from flexmb.scene.feeding_back import FeedbackMaker
from flexmb.scene.garbage import collector_paused
from flexmb.scene.hinges import Z_AXIS

AT_REST = s.AngularCoordinate()
IN_PLACE = s.LinearCoordinate()


def angular(**angle: Unpack[o.Angle]) -> s.AngularCoordinate:
    """One angle of a hinge with several coordinates, for example ``universal(..., first=angular(rate=2.0))``."""
    return make(s.AngularCoordinate, **angle)


def linear(**displacement: Unpack[o.Displacement]) -> s.LinearCoordinate:
    """One displacement of a hinge with several coordinates, or of a point mass."""
    return make(s.LinearCoordinate, **displacement)


def _divided(options: Mapping[str, Any], kind: type) -> tuple[dict[str, Any], dict[str, Any]]:
    """The options that a typed dictionary declares, and all others."""
    own = {key: value for key, value in options.items() if key in kind.__annotations__}
    return own, {key: value for key, value in options.items() if key not in own}


class SceneBuilder(ConnectorMaker, FeedbackMaker):
    """Collects the parts of a scene; every method returns the builder, and `scene()` returns the checked Scene.

    >>> pendulum = (
    ...     SceneBuilder("pendulum", gravity=(0, 0, -9.81))
    ...     .rigid_body("arm", mass=1.0, com=(0.5, 0, 0), inertia=(0.01, 0.1, 0.1))
    ...     .revolute("pivot", "ground", "arm", axis=(0, 1, 0), angle=0.3)
    ...     .marker("end", "arm", offset=(1, 0, 0))
    ...     .scene()
    ... )
    """

    def scene(self, *, t_end: float | None = None) -> s.Scene:
        """The scene, checked; raises SceneError, which lists all problems. `t_end` (s) adds the checks of a run.

        Doubtful values are accepted here; `check_scene` returns them, and runs warn of them.
        """
        with collector_paused():
            data = self._head | {key: plain(items) for key, items in self._lists.items()}
            scene = to_struct(data, s.Scene)
        check_scene(scene, t_end)
        return scene

    # Bodies

    def rigid_body(
        self, name: str, *, mass: float, inertia: ArrayLike, com: ArrayLike = ZERO,
        nodes: Mapping[str, ArrayLike] | Sequence[s.Node] = (),
    ) -> Self:  # fmt: skip
        """A rigid body of `mass` (kg) with centre of mass `com` (m, body frame).

        `inertia` (kg m²): 3x3 about the centre of mass in body axes, or the three principal moments. `nodes`: names and
        positions (m), or Node structs, which can be turned.
        """
        tensor = plain(inertia)
        if len(tensor) == 3 and all(isinstance(moment, float | int) for moment in tensor):
            tensor = [[tensor[i] if i == j else 0.0 for j in range(3)] for i in range(3)]
        if isinstance(nodes, Mapping):
            nodes = [make(s.Node, name=node, position=position) for node, position in nodes.items()]
        return self._append(s.RigidBody, name=name, mass=mass, inertia=tensor, com=com, nodes=nodes)

    def beam(
        self, name: str, *, length: float, elements: int, section: s.BeamStation | Sequence[s.BeamStation],
        modes: int | s.Modes, level: s.Level = "full", nodes: Mapping[str, float] | Sequence[s.BeamNode] = (),
        **model: Unpack[o.BeamOptions],
    ) -> Self:  # fmt: skip
        """A beam along +x of `length` (m), root at the body origin.

        `section`: one BeamStation for a uniform beam (see `beam_section`), or stations from 0 to `length`. `modes`: the
        number of clamped-free modes, or a Modes struct; at `level` "exact" the number of polynomials of each curvature
        (docs/exact.md), for which `elements` has no meaning. `nodes`: names and stations (m); "root" and "tip" always
        exist. `model`: `theory` ("euler-bernoulli" or "timoshenko"), `mass` ("consistent" or "lumped"), `points`
        ("section", "rotary" or "line") and `tip_masses`, see BeamBody.
        """
        if isinstance(section, s.BeamStation):
            section = [msgspec.structs.replace(section, x_m=x) for x in (0.0, length)]
        if isinstance(modes, int):
            modes = s.Modes(count=modes)
        if isinstance(nodes, Mapping):
            nodes = [make(s.BeamNode, name=node, x=x) for node, x in nodes.items()]
        return self._append(
            s.BeamBody, name=name, length=length, elements=elements, stations=section, modes=modes, level=level,
            nodes=nodes, **model,
        )  # fmt: skip

    def modal_body(
        self, name: str, *, points: Sequence[s.InertiaPoint] = (), file: str | None = None,
        boundary: Literal["clamped-free", "free-free"] = "clamped-free", level: s.Level = "full",
        nodes: Sequence[s.ModalNode] = (), **matrices: Unpack[o.ModalMatrices],
    ) -> Self:  # fmt: skip
        """A flexible body of raw points and modes: `points` (see `inertia_points`) or an `.npz` `file`.

        `stiffness`, `damping`: modal matrices (m,m), if they are not in the file. `gravity_stiffness` (3,m,m) and
        `gradient_stiffness` (3,3,m,m): geometric stiffness under unit loads (see ModalBody).
        """
        return self._append(
            s.ModalBody, name=name, points=points, file=file, boundary=boundary, level=level, nodes=nodes, **matrices
        )

    def sid_body(self, name: str, *, file: str, level: s.Level = "full") -> Self:
        """A flexible body from a Standard Input Data file."""
        return self._append(s.SidBody, name=name, file=file, level=level)

    # Hinges

    def weld(self, name: str, parent: str, child: str, **placement: Unpack[o.Placement]) -> Self:
        """No freedom between `parent` ("ground" for the inertial frame) and `child`."""
        return self._append(s.Weld, name=name, parent=parent, child=child, **placement)

    def revolute(
        self, name: str, parent: str, child: str, *, axis: ArrayLike = Z_AXIS, **options: Unpack[o.TurningHinge]
    ) -> Self:
        """One rotation about the unit vector `axis` (inboard hinge axes).

        Initial `angle` (rad) and `rate` (rad/s), spring `stiffness` (N m/rad) about `rest` (rad), `damping`
        (N m s/rad), `armature` (kg m²), motor `torque` (N m) or `prescribed` angle (rad) as functions of time; nodes
        and offsets as for every hinge (`flexmb.scene.options.Placement`).
        """
        return self._turning(s.Revolute, options, name=name, parent=parent, child=child, axis=axis)

    def prismatic(
        self, name: str, parent: str, child: str, *, axis: ArrayLike = Z_AXIS, **options: Unpack[o.SlidingHinge]
    ) -> Self:
        """One translation along the unit vector `axis` (inboard hinge axes).

        Initial `position` (m) and `rate` (m/s), spring `stiffness` (N/m) about `rest` (m), `damping` (N s/m),
        `armature` (kg), motor `force` (N) or `prescribed` displacement (m) as functions of time; nodes and offsets as
        for every hinge (`flexmb.scene.options.Placement`).
        """
        o.refuse_others("a Prismatic", options, o.SlidingHinge)
        displacement, placement = _divided(options, o.Displacement)
        translation = make(s.LinearCoordinate, **displacement)
        return self._append(
            s.Prismatic, name=name, parent=parent, child=child, axis=axis, translation=translation, **placement
        )

    def screw(
        self, name: str, parent: str, child: str, *, pitch: float, axis: ArrayLike = Z_AXIS,
        **options: Unpack[o.TurningHinge],
    ) -> Self:  # fmt: skip
        """One rotation about the unit vector `axis`, with `pitch` (m/rad) times as much translation along it.

        A screw that advances by h (m) a turn has the pitch h / (2 pi), a left-handed one a negative pitch. The angle is
        as of a `revolute`.
        """
        return self._turning(s.Screw, options, name=name, parent=parent, child=child, axis=axis, pitch=pitch)

    def _turning(self, kind: type[s.Revolute | s.Screw], options: Mapping[str, Any], **hinge: Any) -> Self:
        """A hinge with one angle, whose arguments are among the `options`."""
        o.refuse_others(f"a {kind.__name__}", options, o.TurningHinge)
        angle, placement = _divided(options, o.Angle)
        return self._append(kind, **hinge, rotation=make(s.AngularCoordinate, **angle), **placement)

    def cylindrical(
        self, name: str, parent: str, child: str, *, axis: ArrayLike = Z_AXIS, rotation: s.AngularCoordinate = AT_REST,
        translation: s.LinearCoordinate = IN_PLACE, **placement: Unpack[o.Placement],
    ) -> Self:  # fmt: skip
        """Rotation about and translation along the unit vector `axis`; see `angular` and `linear`."""
        return self._append(
            s.Cylindrical, name=name, parent=parent, child=child, axis=axis, rotation=rotation, translation=translation,
            **placement,
        )  # fmt: skip

    def universal(
        self, name: str, parent: str, child: str, *, first: s.AngularCoordinate = AT_REST,
        second: s.AngularCoordinate = AT_REST, **placement: Unpack[o.Placement],
    ) -> Self:  # fmt: skip
        """Rotation about x of the inboard frame, then about the carried y; see `angular`."""
        return self._append(
            s.Universal, name=name, parent=parent, child=child, first=first, second=second, **placement
        )

    def gimbal(
        self, name: str, parent: str, child: str, *, sequence: str = "xyz",
        rotations: Sequence[s.AngularCoordinate] | None = None, **placement: Unpack[o.Placement],
    ) -> Self:  # fmt: skip
        """Two or three successive rotations about carried axes, for example "zxz"; one `angular` each."""
        rotations = (AT_REST,) * len(sequence) if rotations is None else rotations
        return self._append(
            s.Gimbal, name=name, parent=parent, child=child, sequence=sequence, rotations=rotations, **placement
        )

    def spherical(
        self, name: str, parent: str, child: str, *, quaternion: ArrayLike = IDENTITY,
        angular_velocity: ArrayLike = ZERO, stiffness: float = 0.0, damping: float = 0.0,
        **placement: Unpack[o.GivenHinge],
    ) -> Self:  # fmt: skip
        """Three rotations: initial `quaternion` and relative `angular_velocity` (rad/s, outboard axes), `given` if
        closures must keep both, spring `stiffness` (N m/rad) and `damping` (N m s/rad)."""
        return self._append(
            s.Spherical, name=name, parent=parent, child=child, quaternion=quaternion,
            angular_velocity=angular_velocity, stiffness=stiffness, damping=damping, **placement,
        )  # fmt: skip

    def planar(
        self, name: str, parent: str, child: str, *, x: s.LinearCoordinate = IN_PLACE,
        y: s.LinearCoordinate = IN_PLACE, rotation: s.AngularCoordinate = AT_REST, **placement: Unpack[o.Placement],
    ) -> Self:  # fmt: skip
        """Translation in the x-y plane of the inboard frame, then rotation about z; see `linear` and `angular`."""
        return self._append(
            s.Planar, name=name, parent=parent, child=child, x=x, y=y, rotation=rotation, **placement
        )

    def free(
        self, name: str, parent: str, child: str, *, position: ArrayLike = ZERO, quaternion: ArrayLike = IDENTITY,
        angular_velocity: ArrayLike = ZERO, velocity: ArrayLike = ZERO, **placement: Unpack[o.GivenHinge],
    ) -> Self:  # fmt: skip
        """Six freedoms: initial `position` (m, inboard axes), `quaternion`, and relative `angular_velocity` (rad/s) and
        `velocity` (m/s) of the outboard origin, both in outboard axes; `given` if closures must keep all of them."""
        return self._append(
            s.Free, name=name, parent=parent, child=child, position=position, quaternion=quaternion,
            angular_velocity=angular_velocity, velocity=velocity, **placement,
        )  # fmt: skip

    # Loads, further inertia, outputs, events and closures

    def wheel(
        self, name: str, body: str, *, axis: ArrayLike, mass: float, axial_inertia: float, transverse_inertia: float,
        node: str = "origin", **motion: Unpack[o.WheelMotion],
    ) -> Self:  # fmt: skip
        """A symmetric wheel at a node plus `offset` (m), spinning about the unit vector `axis` (node axes).

        `mass` (kg), `axial_inertia` and `transverse_inertia` (kg m²), initial `angle` (rad) and `speed` (rad/s),
        `friction` (N m s/rad), motor `torque` (N m) or `prescribed` angle (rad). The body's mass excludes the wheel.
        """
        return self._append(
            s.Wheel, name=name, body=body, node=node, axis=axis, mass=mass, axial_inertia=axial_inertia,
            transverse_inertia=transverse_inertia, **motion,
        )  # fmt: skip

    def point_mass(
        self, name: str, body: str, *, mass: float, node: str = "origin", offset: ArrayLike = ZERO,
        directions: Sequence[ArrayLike] = (), coordinates: Sequence[s.LinearCoordinate] = (),
    ) -> Self:  # fmt: skip
        """A point mass (kg) at a node plus `offset` (m), free along orthonormal `directions` (node axes).

        `coordinates`: one `linear` for each direction; by default at rest and without springs.
        """
        return self._append(
            s.PointMass, name=name, body=body, node=node, offset=offset, mass=mass, directions=directions,
            coordinates=coordinates,
        )  # fmt: skip

    def force(
        self, name: str, body: str, *, direction: ArrayLike, function: s.Function, node: str = "origin",
        frame: Literal["world", "node"] = "world",
    ) -> Self:  # fmt: skip
        """A force (N) at a node: unit vector `direction`, in World or in turning node axes, times `function`."""
        return self._append(
            s.Load, name=name, body=body, node=node, type="force", direction=direction, frame=frame, function=function
        )

    def torque(
        self, name: str, body: str, *, direction: ArrayLike, function: s.Function, node: str = "origin",
        frame: Literal["world", "node"] = "world",
    ) -> Self:  # fmt: skip
        """A torque (N m) at a node: unit vector `direction`, in World or in turning node axes, times `function`."""
        return self._append(
            s.Load, name=name, body=body, node=node, type="torque", direction=direction, frame=frame, function=function
        )

    def marker(self, name: str, body: str, *, node: str = "origin", offset: ArrayLike = ZERO) -> Self:
        """A frame whose motion is an output: a node plus `offset` (m, node axes)."""
        return self._append(s.Marker, name=name, body=body, node=node, offset=offset)

    def event(
        self, name: str, watch: str, level: float, *actions: s.Action,
        crossing: Literal["rising", "falling", "either"] = "either",
    ) -> Self:  # fmt: skip
        """Actions when `watch` reaches `level`: `Latch`, `Release`, `Impact`, `Change`, `EndRun`, in the given order.

        `watch`: "time", a scalar coordinate such as "pivot.rotation" or "wheel.angle", a rate, "pivot.rotation.rate" or
        "wheel.speed", or one number of a sensor or controller, "height[2]".
        """
        return self._append(s.SceneEvent, name=name, watch=watch, level=level, crossing=crossing, actions=actions)

    def modal_state(self, body: str, *, coordinates: ArrayLike, rates: ArrayLike = ()) -> Self:
        """Initial modal coordinates and rates (1/s) of a flexible body."""
        return self._append(s.ModalState, body=body, coordinates=coordinates, rates=rates)

    def closure(
        self, name: str,
        type: Literal["weld", "revolute", "prismatic", "cylindrical", "universal", "spherical", "planar"],
        body_a: str, body_b: str, *, axis: ArrayLike = Z_AXIS, **frames: Unpack[o.ClosureFrames],
    ) -> Self:  # fmt: skip
        """A loop closure between nodes of two bodies of the tree, or of a body and "ground".

        `axis`: unit vector with the same components in frames A and B. `frames`: `node_a`, and `position_a` (m) and
        `quaternion_a`, the fixed offset in node axes, of frame A; likewise of frame B.
        """
        return self._append(
            s.Closure, name=name, type=type, body_a=body_a, body_b=body_b, axis=axis, **frames
        )

    def coupling(
        self, name: str, hinge: str, ratios: Mapping[str, float] | Mapping[str | tuple[str, str], float], *,
        coordinate: str = "", offset: float = 0.0,
    ) -> Self:  # fmt: skip
        """A linear relation of hinge coordinates, q = `offset` + sum of ratio_i q_i: a gear, belt, rack or linkage.

        q is the coordinate of `hinge`, in rad or m. `ratios` by the hinge of q_i, or by (hinge, coordinate) where the
        hinge has several, in units of q per unit of q_i.
        """
        named = [((key, "") if isinstance(key, str) else key, ratio) for key, ratio in ratios.items()]
        terms = [{"hinge": at, "coordinate": which, "ratio": ratio} for (at, which), ratio in named]
        return self._append(s.Coupling, name=name, hinge=hinge, coordinate=coordinate, terms=terms, offset=offset)
