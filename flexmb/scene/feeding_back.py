"""The builder's methods for sensors and controllers.

Outputs of controllers act through a `flexmb.scene.functions.ControlSignal` in place of a function of time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, Self, Unpack

from numpy.typing import ArrayLike

from flexmb.scene import schema as s
from flexmb.scene.collecting import Collector
from flexmb.scene.options import LinearLaw, OwnLaw, PidLaw, Sampling, refuse_others


class FeedbackMaker(Collector):
    """A method for each kind of sensor and controller."""

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
        """The load of the drive of a prescribed or latched coordinate, "pivot.rotation"; 0 for a free one."""
        return self._append(s.DriveSensor, name=name, coordinate=coordinate)

    def sense_time(self, name: str) -> Self:
        """Time (s) as a signal."""
        return self._append(s.TimeSensor, name=name)

    def sense_profile(self, name: str, function: s.Function) -> Self:
        """A function of time and its rate as signals."""
        return self._append(s.ProfileSensor, name=name, function=function)

    def state_space(self, name: str, inputs: str | Sequence[str], **law: Unpack[LinearLaw]) -> Self:
        """A linear controller: `A`, `B`, `C`, `D`, `initial`; `period`, `offset`, `delay` (s) if it is sampled."""
        return self._controller(s.StateSpace, LinearLaw, law, name=name, inputs=inputs)

    def pid(self, name: str, inputs: str | Sequence[str], **law: Unpack[PidLaw]) -> Self:
        """kp e + integral of ki e + kd e', e = setpoint - input: gains, `setpoint`, `filter` (s), `lower`, `upper`,
        `tracking` (s); `period`, `offset`, `delay` (s) if it is sampled."""
        return self._controller(s.Pid, PidLaw, law, name=name, inputs=inputs)

    def saturation(
        self, name: str, inputs: str | Sequence[str], *, lower: float, upper: float, **sampling: Unpack[Sampling]
    ) -> Self:
        """The inputs, limited to a range."""
        return self._controller(s.Saturation, Sampling, sampling, name=name, inputs=inputs, lower=lower, upper=upper)

    def gain_table(
        self, name: str, inputs: str | Sequence[str], *, points: ArrayLike, values: ArrayLike,
        **sampling: Unpack[Sampling],
    ) -> Self:  # fmt: skip
        """A gain that depends on the first input, linear between `values` at `points`, times all other inputs."""
        return self._controller(s.GainTable, Sampling, sampling, name=name, inputs=inputs, points=points, values=values)

    def user_law(
        self, name: str, inputs: str | Sequence[str], function: str | Callable[..., Any], **law: Unpack[OwnLaw]
    ) -> Self:
        """A user's function, defined at the top level of a module, or its name "module:function".

        Number of `outputs`; `initial` state; `parameters`; `period`, `offset`, `delay` (s) if it is sampled.
        """
        address = function if isinstance(function, str) else _address(function)
        return self._controller(s.UserLaw, OwnLaw, law, name=name, inputs=inputs, function=address)

    def _controller(
        self, kind: type[s.Controller], known: type, options: Mapping[str, Any], *, inputs: str | Sequence[str],
        **own: Any,
    ) -> Self:  # fmt: skip
        """A controller, whose `options` must be `known`; a single input may be given by its name alone."""
        refuse_others(f"a {kind.__name__}", options, known)
        return self._append(kind, inputs=(inputs,) if isinstance(inputs, str) else inputs, **own, **options)


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
