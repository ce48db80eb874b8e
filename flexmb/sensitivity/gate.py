"""The one gate of the numbers by which runs are differentiated: each reaches what is differentiated, or is refused, as
are scenes whose runs have no derivatives, before anything runs.

A number acts through tables of the mechanics or the initial state, through laws of controllers, through levels and
restitutions of events, or through the values to which events change the scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexmb.parameters.numbers import Number, numbers
from flexmb.parameters.parameters import ParameterError, Parameters
from flexmb.run.situation import with_stops
from flexmb.scene.check.walk import values
from flexmb.scene.convert import ROOT
from flexmb.scene.functions import Pulse
from flexmb.scene.schema import DriveSensor, LoadSensor, Scene
from flexmb.scene.sticking import refuse_sticking
from flexmb.scene.tree import watches_signals
from flexmb.sensitivity.law_rates import reaches_event, reaches_laws
from flexmb.sensitivity.part_scene import PartNumber, PartScene, all_changes, changed, differ_in_mechanics
from flexmb.sensitivity.systems import HandedOver
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


def is_passed_backwards(scene: Scene) -> bool:
    """Whether the adjoint passes runs of a scene: continuous controllers and events that watch signals have no
    transposes."""
    return not (any(controller.period_s is None for controller in scene.controllers) or watches_signals(scene))


class Admitted(NamedTuple):
    """A system whose run may be differentiated by all of these numbers, of which the tables of its own scene depend on
    those of `tables`. handed: what a run takes over from one at other values, and leaves for the next."""

    system: System
    numbers: tuple[Number, ...]
    tables: Parameters
    handed: HandedOver


def admitted(scene: Scene, names: Sequence[str]) -> Admitted:
    """The system of a checked scene, with numbers by which it may be differentiated.

    PathError or ParameterError (ValueErrors) for a number that is none, or by which there is no derivative, or on which
    nothing depends; NotImplementedError for scenes whose runs have none.
    """
    return admitted_to(prepared(scene), names)


def prepared(scene: Scene) -> System:
    """The system whose runs are differentiated; NotImplementedError for scenes whose runs have no derivatives."""
    refuse_sticking(scene, "derivatives through its phases are not available", "compare runs with other values")
    refuse_measured_loads(scene)
    system = with_stops(assembled(scene))
    refuse_opened_closures(system)
    return system


def admitted_to(system: System, names: Sequence[str]) -> Admitted:
    """The same of a prepared system."""
    scene = system.scene
    numbers_of = numbers(scene, names)
    refuse_moving_instants(scene, numbers_of)
    acting = [number for number in numbers_of if differ_in_mechanics(scene, number.nearby)]
    tables = Parameters(system, acting)
    reached = {number.name for number, is_reached in zip(acting, tables.reached.tolist(), strict=True) if is_reached}
    for number in numbers_of:
        if not (
            number.name in reached
            or reaches_event(scene, number)
            or reaches_laws(system, number)
            or _reaches_change(scene, number)
        ):
            raise ParameterError(
                f'parameter "{number.name}" = {number.value:g}: nothing in the run depends on it, neither the '
                "equations of motion or the initial state nor a controller or an event (initial values of prescribed "
                "coordinates, for example, come from their functions): leave it out"
            )
    return Admitted(system, numbers_of, tables, HandedOver())


def again(before: Admitted, system: System) -> Admitted:
    """The same numbers of a prepared system that differs in their values only: what admits them does not depend on
    these, and steady derivatives are kept. Blocks are taken over, so that `before` must not be followed any more."""
    found = numbers(system.scene, [number.name for number in before.numbers])
    acting = [number for number in found if number.name in before.tables.names]
    handed = HandedOver(None if system.scene.controllers else before.handed.left)  # controllers write into the tables
    return Admitted(system, found, Parameters(system, acting, like=before.tables), handed)


def _reaches_change(scene: Scene, number: Number) -> bool:
    """Whether a scene depends on a number after a change of a value, by what it is changed to."""
    for change in all_changes(scene):
        now = changed(scene, [change])
        if now == changed(number.nearby, [change]):
            continue
        own = PartNumber(number, PartScene(scene, [change], now))
        system = assembled(now)
        if differ_in_mechanics(now, own.nearby) and Parameters(system, [own], starts=False).reached[0]:
            return True
        if reaches_laws(system, own):
            return True
    return False
