"""Writing a scene in Python: a fluent builder that appends the schema's structs.

Argument names are the schema's keys without their unit. Every value is SI; quaternions are scalar-first, have unit
length and map outboard components to inboard ones. Arrays are accepted wherever tuples are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, Self, Unpack, get_args, get_type_hints

import msgspec
from numpy.typing import ArrayLike

from flexmb.scene import schema as s
from flexmb.scene.bodies import IDENTITY, ZERO
from flexmb.scene.check import check_scene
from flexmb.scene.convert import ROOT, label, plain, to_struct
from flexmb.scene.garbage import collector_paused
from flexmb.scene.hinges import Z_AXIS
from flexmb.scene.options import (
    Angle,
    BeamOptions,
    ClosureFrames,
    Displacement,
    FrictionOptions,
    HingeSpringOptions,
    LinearLaw,
    ModalMatrices,
    OwnLaw,
    PidLaw,
    Placement,
    Sampling,
    SlidingHinge,
    SpringOptions,
    TurningHinge,
    WheelMotion,
    refuse_others,
)
from flexmb.scene.problems import closest
from flexmb.scene.units import split_unit

AT_REST = s.AngularCoordinate()
IN_PLACE = s.LinearCoordinate()


def make(kind: type[msgspec.Struct], place: Any = ROOT, **values: Any) -> Any:
    """A schema struct from values named without units; SceneError (at `place`) where a value has a wrong type."""
    keys = {split_unit(key)[0]: key for key in kind.__struct_fields__}
    for name in values:
        if name not in keys:
            raise TypeError(f'a {kind.__name__} has no "{name}": {closest(name, keys)}')
    return to_struct(plain({keys[name]: value for name, value in values.items()}), kind, place=place)


def angular(**angle: Unpack[Angle]) -> s.AngularCoordinate:
    """One angle of a hinge with several coordinates, for example ``universal(..., first=angular(rate=2.0))``."""
    return make(s.AngularCoordinate, **angle)


def linear(**displacement: Unpack[Displacement]) -> s.LinearCoordinate:
    """One displacement of a hinge with several coordinates, or of a point mass."""
    return make(s.LinearCoordinate, **displacement)


def _divided(options: Mapping[str, Any], kind: type) -> tuple[dict[str, Any], dict[str, Any]]:
    """The options that a typed dictionary names, and all others."""
    own = {key: value for key, value in options.items() if key in kind.__annotations__}
    return own, {key: value for key, value in options.items() if key not in own}


def _collections() -> dict[type, str]:
    """The scene's collection each kind of struct is appended to, read from the schema."""
    table = {}
    for key, hint in get_type_hints(s.Scene).items():
        for item in get_args(hint):
            for kind in get_args(item) or (item,):
                if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
                    table[kind] = key
    return table


COLLECTIONS = _collections()


class SceneBuilder:
    """Collects bodies, hinges and what acts on them; every method returns the builder, `scene()` the checked Scene.

    >>> pendulum = (
    ...     SceneBuilder("pendulum", gravity=(0, 0, -9.81))
    ...     .rigid_body("arm", mass=1.0, com=(0.5, 0, 0), inertia=(0.01, 0.1, 0.1))
    ...     .revolute("pivot", "ground", "arm", axis=(0, 1, 0), angle=0.3)
    ...     .marker("end", "arm", offset=(1, 0, 0))
    ...     .scene()
    ... )
    """

    def __init__(
        self, name: str, *, gravity: ArrayLike = ZERO, description: str = "", allow: Sequence[s.Waiver] = ()
    ) -> None:
        """`gravity`: uniform acceleration (m/s²) in World axes. `allow`: doubts that are meant, see `Scene`."""
        self._head: dict[str, Any] = {
            "name": name, "description": description, "allow": list(allow), "gravity_m_s2": plain(gravity)
        }  # fmt: skip
        self._lists: dict[str, list[msgspec.Struct]] = {key: [] for key in COLLECTIONS.values()}

    def add(self, *structs: msgspec.Struct) -> Self:
        """Append schema structs of any kind: bodies, hinges, wheels, loads, markers ..."""
        for struct in structs:
            if type(struct) not in COLLECTIONS:
                names = ", ".join(sorted(kind.__name__ for kind in COLLECTIONS))
                raise TypeError(f"a {type(struct).__name__} is not a part of a scene by itself; these are: {names}")
            self._lists[COLLECTIONS[type(struct)]].append(struct)
        return self

    def scene(self, *, t_end: float | None = None) -> s.Scene:
        """The scene, checked; raises SceneError listing every problem. `t_end` (s) also checks what the run needs.

        What is doubtful is for `check_scene` to return, and for runs to warn of.
        """
        with collector_paused():
            data = self._head | {key: plain(items) for key, items in self._lists.items()}
            scene = to_struct(data, s.Scene)
        check_scene(scene, t_end)
        return scene

    def _append(self, kind: type[msgspec.Struct], **values: Any) -> Self:
        key = COLLECTIONS[kind]
        place = ROOT.key(key, len(self._lists[key])).named(label(key, values))
        return self.add(make(kind, place, **values))

    # Bodies

    def rigid_body(
        self, name: str, *, mass: float, inertia: ArrayLike, com: ArrayLike = ZERO,
        nodes: Mapping[str, ArrayLike] | Sequence[s.Node] = (),
    ) -> Self:  # fmt: skip
        """A rigid body of `mass` (kg) with centre of mass `com` (m, body frame).

        `inertia` (kg m²): 3x3 about the centre of mass in body axes, or the three principal moments. `nodes`: names and
        positions (m), or Node structs where a node is turned.
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
        **model: Unpack[BeamOptions],
    ) -> Self:  # fmt: skip
        """A beam along +x of `length` (m), root at the body origin.

        `section`: one BeamStation for a uniform beam (see `beam_section`), or stations from 0 to `length`. `modes`: how
        many clamped-free modes, or a Modes struct. `nodes`: names and stations (m); "root" and "tip" exist anyway.
        `model`: `theory` ("euler-bernoulli" or "timoshenko"), `mass` ("consistent" or "lumped"), `points` ("section",
        "rotary" or "line") and `tip_masses`, see BeamBody.
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
        nodes: Sequence[s.ModalNode] = (), **matrices: Unpack[ModalMatrices],
    ) -> Self:  # fmt: skip
        """A flexible body of raw points and modes: `points` (see `inertia_points`) or an `.npz` `file`.

        `stiffness`, `damping`: modal matrices (m,m), if the file does not hold them. `gravity_stiffness` (3,m,m) and
        `gradient_stiffness` (3,3,m,m): geometric stiffness under unit loads (see ModalBody).
        """
        return self._append(
            s.ModalBody, name=name, points=points, file=file, boundary=boundary, level=level, nodes=nodes, **matrices
        )

    def sid_body(self, name: str, *, file: str, level: s.Level = "full") -> Self:
        """A flexible body from a Standard Input Data file."""
        return self._append(s.SidBody, name=name, file=file, level=level)

    # Hinges

    def weld(self, name: str, parent: str, child: str, **placement: Unpack[Placement]) -> Self:
        """No freedom between `parent` ("ground" for the inertial frame) and `child`."""
        return self._append(s.Weld, name=name, parent=parent, child=child, **placement)

    def revolute(
        self, name: str, parent: str, child: str, *, axis: ArrayLike = Z_AXIS, **options: Unpack[TurningHinge]
    ) -> Self:
        """One rotation about the unit vector `axis` (inboard hinge axes).

        Initial `angle` (rad) and `rate` (rad/s), spring `stiffness` (N m/rad) about `rest` (rad), `damping`
        (N m s/rad), motor `torque` (N m) or `prescribed` angle (rad) as functions of time; and where it sits, as of
        every hinge.
        """
        refuse_others("a Revolute", options, TurningHinge)
        angle, placement = _divided(options, Angle)
        rotation = make(s.AngularCoordinate, **angle)
        return self._append(
            s.Revolute, name=name, parent=parent, child=child, axis=axis, rotation=rotation, **placement
        )

    def prismatic(
        self, name: str, parent: str, child: str, *, axis: ArrayLike = Z_AXIS, **options: Unpack[SlidingHinge]
    ) -> Self:
        """One translation along the unit vector `axis` (inboard hinge axes).

        Initial `position` (m) and `rate` (m/s), spring `stiffness` (N/m) about `rest` (m), `damping` (N s/m), motor
        `force` (N) or `prescribed` displacement (m) as functions of time; and where it sits, as of every hinge.
        """
        refuse_others("a Prismatic", options, SlidingHinge)
        displacement, placement = _divided(options, Displacement)
        translation = make(s.LinearCoordinate, **displacement)
        return self._append(
            s.Prismatic, name=name, parent=parent, child=child, axis=axis, translation=translation, **placement
        )

    def cylindrical(
        self, name: str, parent: str, child: str, *, axis: ArrayLike = Z_AXIS, rotation: s.AngularCoordinate = AT_REST,
        translation: s.LinearCoordinate = IN_PLACE, **placement: Unpack[Placement],
    ) -> Self:  # fmt: skip
        """Rotation about and translation along the unit vector `axis`; see `angular` and `linear`."""
        return self._append(
            s.Cylindrical, name=name, parent=parent, child=child, axis=axis, rotation=rotation, translation=translation,
            **placement,
        )  # fmt: skip

    def universal(
        self, name: str, parent: str, child: str, *, first: s.AngularCoordinate = AT_REST,
        second: s.AngularCoordinate = AT_REST, **placement: Unpack[Placement],
    ) -> Self:  # fmt: skip
        """Rotation about x of the inboard frame, then about the carried y; see `angular`."""
        return self._append(
            s.Universal, name=name, parent=parent, child=child, first=first, second=second, **placement
        )

    def gimbal(
        self, name: str, parent: str, child: str, *, sequence: str = "xyz",
        rotations: Sequence[s.AngularCoordinate] | None = None, **placement: Unpack[Placement],
    ) -> Self:  # fmt: skip
        """Two or three successive rotations about carried axes, for example "zxz"; one `angular` each."""
        rotations = (AT_REST,) * len(sequence) if rotations is None else rotations
        return self._append(
            s.Gimbal, name=name, parent=parent, child=child, sequence=sequence, rotations=rotations, **placement
        )

    def spherical(
        self, name: str, parent: str, child: str, *, quaternion: ArrayLike = IDENTITY,
        angular_velocity: ArrayLike = ZERO, stiffness: float = 0.0, damping: float = 0.0,
        **placement: Unpack[Placement],
    ) -> Self:  # fmt: skip
        """Three rotations: initial `quaternion`, relative `angular_velocity` (rad/s, outboard axes), spring `stiffness`
        (N m/rad) and `damping` (N m s/rad)."""
        return self._append(
            s.Spherical, name=name, parent=parent, child=child, quaternion=quaternion,
            angular_velocity=angular_velocity, stiffness=stiffness, damping=damping, **placement,
        )  # fmt: skip

    def planar(
        self, name: str, parent: str, child: str, *, x: s.LinearCoordinate = IN_PLACE,
        y: s.LinearCoordinate = IN_PLACE, rotation: s.AngularCoordinate = AT_REST, **placement: Unpack[Placement],
    ) -> Self:  # fmt: skip
        """Translation in the x-y plane of the inboard frame, then rotation about z; see `linear` and `angular`."""
        return self._append(
            s.Planar, name=name, parent=parent, child=child, x=x, y=y, rotation=rotation, **placement
        )

    def free(
        self, name: str, parent: str, child: str, *, position: ArrayLike = ZERO, quaternion: ArrayLike = IDENTITY,
        angular_velocity: ArrayLike = ZERO, velocity: ArrayLike = ZERO, **placement: Unpack[Placement],
    ) -> Self:  # fmt: skip
        """Six freedoms: initial `position` (m, inboard axes), `quaternion`, and relative `angular_velocity` (rad/s) and
        `velocity` (m/s) of the outboard origin, both in outboard axes."""
        return self._append(
            s.Free, name=name, parent=parent, child=child, position=position, quaternion=quaternion,
            angular_velocity=angular_velocity, velocity=velocity, **placement,
        )  # fmt: skip

    # What acts on the tree, and what is asked of it

    def wheel(
        self, name: str, body: str, *, axis: ArrayLike, mass: float, axial_inertia: float, transverse_inertia: float,
        node: str = "origin", **motion: Unpack[WheelMotion],
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

        `coordinates`: one `linear` for each direction, at rest and without spring if not given.
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
        """What happens where `watch` comes to `level`: `Latch`, `Release`, `Impact`, `Change`, `EndRun`, in this order.

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
        body_a: str, body_b: str, *, axis: ArrayLike = Z_AXIS, **frames: Unpack[ClosureFrames],
    ) -> Self:  # fmt: skip
        """A loop closure between nodes of two bodies of the tree ("ground" too), plus fixed offsets in node axes (m).

        `axis`: unit vector with the same components in frames A and B. `frames`: `node_a`, `position_a` and
        `quaternion_a` of frame A, and the same of B.
        """
        return self._append(
            s.Closure, name=name, type=type, body_a=body_a, body_b=body_b, axis=axis, **frames
        )

    # Connectors

    def spring_damper(self, name: str, body_a: str, body_b: str, **options: Unpack[SpringOptions]) -> Self:
        """A spring, damper and actuator along the line between nodes of two bodies ("ground" too).

        Ends: `node_a`, `position_a` (m, node axes) and the same of b. Law: `free_length` (m), `preload` (N),
        `stiffness` (N/m), `stiffening`, or `table` (m) and `loads` (N); `damping` (N s/m), `acts`, actuator `force`.
        """
        refuse_others("a SpringDamper", options, SpringOptions)
        return self._append(s.SpringDamper, name=name, body_a=body_a, body_b=body_b, **options)

    def bushing(
        self, name: str, body_a: str, body_b: str, *, stiffness: ArrayLike, damping: ArrayLike | None = None,
        **frames: Unpack[ClosureFrames],
    ) -> Self:  # fmt: skip
        """Stiffness and damping of all relative motions of two frames, symmetric (6,6): [rotation; translation] of B
        in axes of A. `frames`: as of a closure."""
        values = frames if damping is None else frames | {"damping": damping}
        return self._append(s.Bushing, name=name, body_a=body_a, body_b=body_b, stiffness=stiffness, **values)

    def angular_spring(self, name: str, hinge: str, **options: Unpack[HingeSpringOptions]) -> Self:
        """A nonlinear spring (N m/rad) along an angle of a hinge, with stops; see AngularSpring."""
        refuse_others("an AngularSpring", options, HingeSpringOptions)
        return self._append(s.AngularSpring, name=name, hinge=hinge, **options)

    def linear_spring(self, name: str, hinge: str, **options: Unpack[HingeSpringOptions]) -> Self:
        """A nonlinear spring (N/m) along a displacement of a hinge or point mass, with stops; see LinearSpring."""
        refuse_others("a LinearSpring", options, HingeSpringOptions)
        return self._append(s.LinearSpring, name=name, hinge=hinge, **options)

    def angular_friction(
        self, name: str, hinge: str, *, sliding: float, smoothing: float, **options: Unpack[FrictionOptions]
    ) -> Self:
        """Dry friction (N m) along an angle of a hinge or in a wheel's bearing, smooth below the rate `smoothing`."""
        return self._append(s.AngularFriction, name=name, hinge=hinge, sliding=sliding, smoothing=smoothing, **options)

    def linear_friction(
        self, name: str, hinge: str, *, sliding: float, smoothing: float, **options: Unpack[FrictionOptions]
    ) -> Self:
        """Dry friction (N) along a displacement of a hinge or point mass, smooth below the speed `smoothing`."""
        return self._append(s.LinearFriction, name=name, hinge=hinge, sliding=sliding, smoothing=smoothing, **options)

    # Feedback: what controllers put out acts through a ControlSignal in place of a function of time

    def sense_coordinate(self, name: str, of: str, *, quantity: Literal["value", "rate"] = "value") -> Self:
        """Coordinates or speeds of a hinge, wheel, point mass or "<body>.modes" as a signal."""
        return self._append(s.CoordinateSensor, name=name, of=of, quantity=quantity)

    def sense_marker(
        self, name: str, marker: str, quantity: str, *, frame: Literal["world", "marker"] = "world"
    ) -> Self:
        """A marker's "position", "orientation", "velocity", "angular_velocity", "acceleration", "angular_acceleration"
        or "specific_force", in World axes or its own."""
        return self._append(s.MarkerSensor, name=name, marker=marker, quantity=quantity, frame=frame)

    def sense_distance(self, name: str, marker_a: str, marker_b: str) -> Self:
        """The distance of two markers (m) and its rate (m/s)."""
        return self._append(s.DistanceSensor, name=name, marker_a=marker_a, marker_b=marker_b)

    def sense_load(self, name: str, hinge: str) -> Self:
        """The load across a hinge, [torque; force] on the outboard body, World axes."""
        return self._append(s.LoadSensor, name=name, hinge=hinge)

    def sense_drive(self, name: str, coordinate: str) -> Self:
        """The load of the drive of a prescribed or latched coordinate, "pivot.rotation"; of a free one 0."""
        return self._append(s.DriveSensor, name=name, coordinate=coordinate)

    def sense_time(self, name: str) -> Self:
        """Time (s) as a signal."""
        return self._append(s.TimeSensor, name=name)

    def sense_profile(self, name: str, function: s.Function) -> Self:
        """A function of time and its rate as signals."""
        return self._append(s.ProfileSensor, name=name, function=function)

    def state_space(self, name: str, inputs: str | Sequence[str], **law: Unpack[LinearLaw]) -> Self:
        """A linear controller: `A`, `B`, `C`, `D`, `initial`; `period`, `offset`, `delay` (s) where it is sampled."""
        refuse_others("a StateSpace", law, LinearLaw)
        return self._append(s.StateSpace, name=name, inputs=_several(inputs), **law)

    def pid(self, name: str, inputs: str | Sequence[str], **law: Unpack[PidLaw]) -> Self:
        """kp e + integral of ki e + kd e', e = setpoint - input: gains, `setpoint`, `filter` (s), `lower`, `upper`,
        `tracking` (s); `period`, `offset`, `delay` (s) where it is sampled."""
        refuse_others("a Pid", law, PidLaw)
        return self._append(s.Pid, name=name, inputs=_several(inputs), **law)

    def saturation(
        self, name: str, inputs: str | Sequence[str], *, lower: float, upper: float, **sampling: Unpack[Sampling]
    ) -> Self:
        """Inputs between limits."""
        refuse_others("a Saturation", sampling, Sampling)
        return self._append(s.Saturation, name=name, inputs=_several(inputs), lower=lower, upper=upper, **sampling)

    def gain_table(
        self, name: str, inputs: str | Sequence[str], *, points: ArrayLike, values: ArrayLike,
        **sampling: Unpack[Sampling],
    ) -> Self:  # fmt: skip
        """A gain by the first input, linear between `values` at `points`, times all others."""
        refuse_others("a GainTable", sampling, Sampling)
        return self._append(
            s.GainTable, name=name, inputs=_several(inputs), points=points, values=values, **sampling
        )

    def user_law(
        self, name: str, inputs: str | Sequence[str], function: str | Callable[..., Any], **law: Unpack[OwnLaw]
    ) -> Self:
        """A function of one's own, which a module has at its top level, or its name "module:function".

        `outputs`: how many; `initial` state; `parameters`; `period`, `offset`, `delay` (s) where it is sampled.
        """
        refuse_others("a UserLaw", law, OwnLaw)
        address = function if isinstance(function, str) else _address(function)
        return self._append(s.UserLaw, name=name, inputs=_several(inputs), function=address, **law)


def _several(inputs: str | Sequence[str]) -> Sequence[str]:
    return (inputs,) if isinstance(inputs, str) else inputs


def _address(function: Callable[..., Any]) -> str:
    """ "module:function", by which a scene finds it again; ValueError for one that no module has at its top level."""
    plain = getattr(function, "py_func", function)
    name = getattr(plain, "__qualname__", repr(plain))
    if "<" in name:
        raise ValueError(
            f"{name} exists inside of another function only, where no file finds it: define it by def at the top level "
            "of a module"
        )
    return f"{plain.__module__}:{name}"
