"""Derivatives of the numbers of controllers, of what they drive and of events, all functions of a scene's numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import msgspec
import numpy as np

from flexmb.control.wiring import law_numbers, profile_tables, wired
from flexmb.parameters.numbers import Number
from flexmb.parameters.spectral import Parts, derivative
from flexmb.scene.events import Impact
from flexmb.scene.functions import ControlSignal
from flexmb.scene.keys import struct_keys
from flexmb.scene.schema import Scene
from flexmb.system.system import System
from flexmb.typing import Real


class LawRates(NamedTuple):
    """Scaled derivatives of the tables of controllers: parameters (numbers,P), initial states (states,P), gains of what
    signals drive (drives,P); of the functions that sensors read (functions,4,P) and of their pieces (pieces,8,P)."""

    number: Real
    state: Real
    gain: Real
    course: Real
    piece: Real


class EventRates(NamedTuple):
    """Scaled derivatives (P,) of the level of an event and, by number of the action, of restitutions."""

    level: Real
    restitution: dict[int, Real]


def law_rates(system: System, numbers: Sequence[Number | None], scales: Real) -> LawRates:
    """Of a system's controllers by these numbers; None for one on which nothing depends."""
    wiring = wired(system)
    rates = np.zeros((len(_of_laws(system, system.scene, are_driven=False)), len(numbers)))
    concerned = _concerned(numbers, system.scene)
    for are_driven in (False, True):
        chosen = [number if own is are_driven else None for number, own in zip(numbers, concerned, strict=True)]
        if any(chosen):
            rates += _by_numbers(partial(_of_laws, system, are_driven=are_driven), system.scene, chosen, scales)
    shapes = wiring.number.shape, wiring.initial.shape, wiring.drive.shape, (len(wiring.course), 4), wiring.piece.shape
    stops = np.cumsum([np.prod(shape, dtype=int) for shape in shapes])
    parts = np.split(rates, stops[:-1])
    return LawRates(*(part.reshape(*shape, len(numbers)) for part, shape in zip(parts, shapes, strict=True)))


def reaches_laws(system: System, number: Number) -> bool:
    """Whether the numbers of controllers, or of what they drive, differ with a number of the system's scene."""
    [are_driven] = _concerned([number], system.scene)
    return are_driven is not None and not np.array_equal(
        _of_laws(system, system.scene, are_driven), _of_laws(system, number.nearby, are_driven)
    )


def _of_laws(system: System, scene: Scene, are_driven: bool) -> Real:
    """All numbers of controllers, of gains if they `are_driven` by the number that differs, and of profiles."""
    course, piece = profile_tables(scene)
    laws = law_numbers(scene.controllers, wired(system).controller["inputs"].tolist())
    signals = system.with_numbers(scene).signals if are_driven else system.signals
    gains = np.array([signal.gain for signal in signals.values()])
    return np.concatenate([*laws, gains, course["data"].ravel(), piece.ravel()])


def event_rates(scene: Scene, numbers: Sequence[Number | None], scales: Real) -> dict[str, EventRates]:
    """Of all events of a scene, by name."""
    found = dict[str, EventRates]()
    numbers = [number if number is not None and number.nearby.events != scene.events else None for number in numbers]
    for event in scene.events:
        impacts = [i for i, action in enumerate(event.actions) if isinstance(action, Impact)]
        rates = _by_numbers(partial(_of_event, name=event.name), scene, numbers, scales)
        found[event.name] = EventRates(rates[0], dict(zip(impacts, rates[1:], strict=True)))
    return found


def reaches_event(scene: Scene, number: Number) -> bool:
    """Whether the level of an event or a restitution differs with a number."""
    other = number.nearby
    return any(not np.array_equal(_of_event(scene, event.name), _of_event(other, event.name)) for event in scene.events)


def _of_event(scene: Scene, name: str) -> Real:
    [event] = [event for event in scene.events if event.name == name]
    return np.array([event.level, *(action.restitution for action in event.actions if isinstance(action, Impact))])


def _concerned(numbers: Sequence[Number | None], scene: Scene) -> list[bool | None]:
    """Whether the gains of what signals drive depend on each number, or else the tables of controllers (False)."""
    gains, found = _driven_gains(scene), list[bool | None]()
    for number in numbers:
        other = scene if number is None else number.nearby
        is_law = (other.controllers, other.sensors) != (scene.controllers, scene.sensors)
        found.append(True if other is not scene and _driven_gains(other) != gains else False if is_law else None)
    return found


def _driven_gains(item: Any) -> list[float]:
    """Gains of all signals in a scene, a struct or a tuple of structs."""
    if isinstance(item, ControlSignal):
        return [item.gain]
    if isinstance(item, msgspec.Struct):
        item = tuple(getattr(item, key) for key in struct_keys(type(item)))
    elif not (isinstance(item, tuple) and item and isinstance(item[0], msgspec.Struct)):
        return []
    return [gain for each in item for gain in _driven_gains(each)]


def _by_numbers(
    function: Callable[[Scene], Real], scene: Scene, numbers: Sequence[Number | None], scales: Real
) -> Real:
    """Scaled derivatives (n,P) of a function of a scene."""
    now = function(scene)
    found, finite = np.zeros((len(now), len(numbers))), np.isfinite(now)  # limits may be infinite

    def at(value: float, number: Number) -> Real:
        return np.where(finite, function(number.scene_at(value)), 0.0)

    for k, number in enumerate(numbers):
        if number is not None:
            parts = Parts([slice(i, i + 1) for i in range(len(now))])
            rates = derivative(partial(at, number=number), number.value, number.scale, parts)
            found[:, k] = scales[k] * rates.values
    return found
