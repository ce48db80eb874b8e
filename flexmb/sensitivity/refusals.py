"""Refuses scenes and numbers by which the derivatives of a run do not exist, or are not found, before anything runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexmb.parameters.numbers import Number
from flexmb.parameters.parameters import ParameterError
from flexmb.scene.check.walk import values
from flexmb.scene.convert import ROOT
from flexmb.scene.functions import Pulse
from flexmb.scene.schema import DriveSensor, LoadSensor, Scene
from flexmb.scene.tree import watches_signals
from flexmb.sensitivity.part_scene import all_changes, changed
from flexmb.system.compile import assembled
from flexmb.system.system import System

_SCHEDULE = "period_s", "offset_s", "delay_s"
_CLOSED = 1e-9  # m and rad, to which starts are closed with room for rounding


def refuse_moving_instants(scene: Scene, numbers: Sequence[Number]) -> None:
    """ParameterError for numbers that move the instants of sampled controllers or the ends of pulses."""
    changes = [(), *((change,) for change in all_changes(scene))]
    own = [(_schedule(now), _pulses(now)) for now in (changed(scene, change) for change in changes)]
    if not any(schedule or pulses for schedule, pulses in own):
        return
    for number in numbers:
        others = [changed(number.nearby, change) for change in changes]
        if any(_schedule(other) != schedule for other, (schedule, _) in zip(others, own, strict=True)):
            raise ParameterError(
                f'parameter "{number.name}" moves the instants at which a sampled controller acts: derivatives by it '
                "are not available; compare runs with other values"
            )
        if any(_pulses(other) != pulses for other, (_, pulses) in zip(others, own, strict=True)):
            raise ParameterError(
                f'parameter "{number.name}" moves the start or the end of a pulse, at which a load jumps: derivatives '
                'by it are not available; use a function of kind "smooth_step", or events on time with their levels as '
                "parameters"
            )


def refuse_measured_loads(scene: Scene) -> None:
    """NotImplementedError where sensors measure loads in a closed chain: no test holds the derivatives of such runs."""
    for sensor in scene.sensors:
        if scene.constraints and isinstance(sensor, LoadSensor | DriveSensor):
            raise NotImplementedError(
                f'sensor "{sensor.name}" measures a load in a scene with closures or couplings: derivatives of its '
                "runs are not available; compare runs with other values, or leave the sensor out"
            )


def refuse_opened_closures(system: System) -> None:
    """NotImplementedError where a change of a value opens a closure or coupling: bodies then jump to where it is
    closed again, and no derivatives pass through that."""
    scene = system.scene
    if not scene.constraints:
        return
    start = system.initial_state
    before = system.closure_gaps(start)
    for change in all_changes(scene):
        other = assembled(changed(scene, [change]))
        gaps = other.closure_gaps(other.state(start.q, start.u, start.t))
        for name, gap in gaps.items():
            if not np.allclose(gap, before[name], rtol=0.0, atol=_CLOSED):
                raise NotImplementedError(
                    f'event "{change.event}" changes a value on which closure "{name}" depends (action '
                    f"{change.action}): bodies jump to where it is closed again, through which there are no "
                    "derivatives; compare runs with other values, or leave the event out"
                )


def _schedule(scene: Scene) -> list[tuple[float | None, ...]]:
    return [tuple(getattr(controller, name) for name in _SCHEDULE) for controller in scene.controllers]


def _pulses(scene: Scene) -> list[tuple[float, float]]:
    return [
        (function.start_s, function.duration_s) for _, _, function in values(ROOT, scene) if isinstance(function, Pulse)
    ]


def refuse_beyond_adjoint(scene: Scene) -> None:
    """NotImplementedError for scenes whose runs are not passed backwards."""
    for has, what in (
        (any(controller.period_s is None for controller in scene.controllers), "continuous controllers"),
        (watches_signals(scene), "events that watch signals"),
    ):
        if has:
            raise NotImplementedError(
                f'scene "{scene.name}" has {what}, through which the adjoint does not pass: use `sensitivities`, which '
                "integrates forwards"
            )
