"""Events: what happens where something that a run watches passes a level, located in the step and not at its end."""

from __future__ import annotations

from typing import Literal

from flexmb.scene.bodies import SceneStruct
from flexmb.scene.functions import Function


class Latch(SceneStruct, frozen=True, kw_only=True, tag="latch", tag_field="kind"):
    """The coordinate is held where it is, by an impulse that takes its speed away; its drive load is an output then.

    Its motor is off while it is held; its spring stays. `coordinate`: "<hinge>.<key>" of a scalar coordinate, such as
    "root.rotation", or "<wheel>.angle".
    """

    coordinate: str


class Release(SceneStruct, frozen=True, kw_only=True, tag="release", tag_field="kind"):
    """A coordinate that is latched or prescribed is free, with the spring, damper and motor that the scene gives it."""

    coordinate: str


class Impact(SceneStruct, frozen=True, kw_only=True, tag="impact", tag_field="kind"):
    """An impulse along the coordinate turns its speed over, to `restitution` times as much: contact with a stop.

    With `rests`, a body that is pressed against the stop comes to rest on it where its rebound is below the error that
    the run allows: it is held there, until the stop would have to pull.
    """

    coordinate: str
    restitution: float = 1.0
    rests: bool = False


class Change(SceneStruct, frozen=True, kw_only=True, tag="change", tag_field="kind"):
    """Another value in the scene from then on, to switch a load or a motor, for example.

    `path` is one of `Scene.with_values`, as "push.function" or "pivot.rotation.stiffness_Nm_rad".
    """

    path: str
    value: float | Function


class EndRun(SceneStruct, frozen=True, kw_only=True, tag="end", tag_field="kind"):
    """The run ends there, finished."""


Action = Latch | Release | Impact | Change | EndRun


class SceneEvent(SceneStruct, frozen=True, kw_only=True):
    """What happens, whenever `watch` comes to `level` from below (rising), from above (falling) or either way.

    `watch`: "time" (s); a scalar coordinate, "<hinge>.<key>" or "<wheel>.angle" (m or rad); its rate,
    "<hinge>.<key>.rate" or "<wheel>.speed"; or a signal: one number of a sensor or controller, "height[2]", whose
    number may be left out where there is only one. What is at its level when the run begins has been there before.
    Actions are done in their order, at the same time.
    """

    name: str
    watch: str
    level: float
    crossing: Literal["rising", "falling", "either"] = "either"
    actions: tuple[Action, ...]
