"""The one gate of the numbers by which runs are differentiated: each reaches what is differentiated, or is refused.

A number acts through tables of the mechanics or the initial state, through laws of controllers, through levels and
restitutions of events, or through the values to which events change the scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from flexmb.parameters.numbers import Number, numbers
from flexmb.parameters.parameters import ParameterError, Parameters
from flexmb.run.situation import with_stops
from flexmb.scene.schema import Scene
from flexmb.sensitivity.law_rates import reaches_event, reaches_laws
from flexmb.sensitivity.part_scene import PartNumber, PartScene, all_changes, changed, differ_in_mechanics
from flexmb.sensitivity.refusals import refuse_measured_loads, refuse_moving_instants, refuse_opened_closures
from flexmb.sensitivity.systems import HandedOver
from flexmb.system.compile import assembled
from flexmb.system.system import System


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
