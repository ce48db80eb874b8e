"""A builder for scenes in Python, each of whose methods appends a struct of the schema.

Argument names are the schema's keys without their unit. Every value is SI; quaternions are scalar-first, have unit
length and map outboard components to inboard ones. Arrays are accepted in place of tuples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, Self, Unpack

import msgspec
from numpy.typing import ArrayLike

from flexmb.scene import schema as s
from flexmb.scene.bodies import ZERO
from flexmb.scene.check import check_scene
from flexmb.scene.collecting import BeamOptions, Placement, Sampling, make
from flexmb.scene.convert import plain, to_struct
from flexmb.scene.garbage import collector_paused
from flexmb.scene.methods import AT_REST, SchemaMethods, angular, linear

__all__ = ["SceneBuilder", "angular", "linear"]


class SceneBuilder(SchemaMethods):
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

    # Methods that say something in another way than the schema does; all others are generated from it

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
        **model: Unpack[BeamOptions],
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

    def gimbal(
        self, name: str, parent: str, child: str, *, sequence: str = "xyz",
        rotations: Sequence[s.AngularCoordinate] | None = None, **placement: Unpack[Placement],
    ) -> Self:  # fmt: skip
        """Two or three successive rotations about carried axes, for example "zxz"; one `angular` each."""
        rotations = (AT_REST,) * len(sequence) if rotations is None else rotations
        return self._append(
            s.Gimbal, name=name, parent=parent, child=child, sequence=sequence, rotations=rotations, **placement
        )

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

    def event(
        self, name: str, watch: str, level: float, *actions: s.Action,
        crossing: Literal["rising", "falling", "either"] = "either",
    ) -> Self:  # fmt: skip
        """Actions when `watch` reaches `level`: `Latch`, `Release`, `Impact`, `Change`, `Separate`, `Dock`,
        `EndRun`, in the given order.

        `watch`: "time", a scalar coordinate such as "pivot.rotation" or "wheel.angle", a rate, "pivot.rotation.rate" or
        "wheel.speed", or one number of a sensor or controller, "height[2]".
        """
        return self._append(s.SceneEvent, name=name, watch=watch, level=level, crossing=crossing, actions=actions)

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

    def user_law(
        self, name: str, inputs: str | Sequence[str], function: str | Callable[..., Any], *, outputs: int = 1,
        initial: ArrayLike = (), parameters: ArrayLike = (), **sampling: Unpack[Sampling],
    ) -> Self:  # fmt: skip
        """A user's function, defined at the top level of a module, or its name "module:function".

        Number of `outputs`; `initial` state; `parameters`; `period`, `offset`, `delay` (s) if it is sampled.
        """
        address = function if isinstance(function, str) else _address(function)
        law = {"outputs": outputs, "initial": initial, "parameters": parameters}
        return self._made(s.UserLaw, {"name": name, "inputs": inputs, "function": address, **law, **sampling})


def _address(function: Callable[..., Any]) -> str:
    """The name "module:function" of a function; ValueError for one that is not at the top level of a module."""
    plain = getattr(function, "py_func", function)
    name = getattr(plain, "__qualname__", repr(plain))
    if "<" in name:
        raise ValueError(
            f"{name} is defined inside another function, where a scene file cannot refer to it: define it by def at "
            "the top level of a module"
        )
    return f"{plain.__module__}:{name}"
