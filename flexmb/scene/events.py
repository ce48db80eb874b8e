"""Events: actions when a watched quantity passes a level, at an instant that is located within the step."""

from __future__ import annotations

from typing import Annotated, Literal

from flexmb.scene.bodies import SceneStruct
from flexmb.scene.functions import Function
from flexmb.scene.quantities import PURE, Number, unit, within

Misfit = Annotated[float, within(0.0)]
Restitution = Annotated[float, within(0.0, 1.0, remedy="from 0 (no rebound) to 1 (no loss)"), PURE]


class Latch(SceneStruct, frozen=True, kw_only=True, tag="latch", tag_field="kind"):
    """An impulse stops the coordinate, which is then held at its value; its drive load is an output.

    While it is held, its motor is off and its spring acts. `coordinate`: "<hinge>.<key>" of a scalar coordinate, such
    as "root.rotation", or "<wheel>.angle".
    """

    coordinate: str


class Release(SceneStruct, frozen=True, kw_only=True, tag="release", tag_field="kind"):
    """A latched or prescribed coordinate becomes free, with the spring, damper and motor that it has in the scene."""

    coordinate: str


class Impact(SceneStruct, frozen=True, kw_only=True, tag="impact", tag_field="kind"):
    """Contact with a stop: an impulse along the coordinate reverses its speed, multiplied by `restitution`.

    With `rests`, the coordinate comes to rest on the stop when it is pressed against it and its rebound is below the
    error tolerance of the run. It is held there until the stop would have to pull.
    """

    coordinate: str
    restitution: Restitution = 1.0
    rests: bool = False


class Change(SceneStruct, frozen=True, kw_only=True, tag="change", tag_field="kind"):
    """A value in the scene changes at the event, for example to switch a load or a motor.

    `path` is a path of `Scene.with_values`, such as "push.function" or "pivot.rotation.stiffness_Nm_rad".
    """

    path: str
    value: Annotated[Number, unit("of the path")] | Function


class Separate(SceneStruct, frozen=True, kw_only=True, tag="separate", tag_field="kind"):
    """A closure opens: a clamp lets go, a stage separates. Its load is zero from then on; nothing jumps."""

    closure: str


class Dock(SceneStruct, frozen=True, kw_only=True, tag="dock", tag_field="kind"):
    """A closure closes: an impulse takes away the motion that it suppresses from then on; its load is an output.

    Its frames may be apart by `tolerance_m` along the suppressed translations and by `tolerance_rad` about the
    suppressed rotations, beside the error that the run allows: bodies are moved until it is closed, as at the start of
    a run, and the record of the event says by how much. With `as_found` no body is moved: a gripper holds what it grips
    as it finds it, and frame B moves on its body. A larger misfit ends the run with an error.
    """

    closure: str
    tolerance_m: Misfit = 0.0
    tolerance_rad: Misfit = 0.0
    as_found: bool = False


class EndRun(SceneStruct, frozen=True, kw_only=True, tag="end", tag_field="kind"):
    """The run ends, with status OK."""


Action = Latch | Release | Impact | Change | Separate | Dock | EndRun


class SceneEvent(SceneStruct, frozen=True, kw_only=True):
    """Actions whenever `watch` reaches `level` from below (rising), from above (falling) or from either side.

    `watch`: "time" (s); a scalar coordinate, "<hinge>.<key>" or "<wheel>.angle" (m or rad); its rate,
    "<hinge>.<key>.rate" or "<wheel>.speed"; or a signal, one number of a sensor or controller, "height[2]", whose index
    may be omitted if there is only one. An event whose quantity starts at its level does not fire until the quantity
    has left the level and returned. The actions are performed in the given order at the same instant.
    """

    name: str
    watch: str
    level: Annotated[Number, unit("of what is watched")]
    crossing: Literal["rising", "falling", "either"] = "either"
    actions: tuple[Action, ...]
