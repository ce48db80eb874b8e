"""Applies the actions of events to a scene, its system and its state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import assert_never

import numpy as np
from msgspec.structs import replace

from flexmb.integrate.settings import Settings
from flexmb.run.event_record import EventRecord
from flexmb.run.impulses import struck
from flexmb.run.origin import Beginning
from flexmb.run.propagate import Raw
from flexmb.run.resting import off_stop, on_stop
from flexmb.scene.events import Action, Change, EndRun, Impact, Latch, Release
from flexmb.scene.functions import Constant
from flexmb.scene.schema import Scene, SceneEvent, Wheel
from flexmb.scene.tree import Coordinate, rate_name, scalar_paths
from flexmb.scene.values import changed_at
from flexmb.system.compile import assembled
from flexmb.system.tree_system import System
from flexmb.tables.features import asking
from flexmb.tables.state import State
from flexmb.typing import Real

Accelerations = Callable[[float, Real], Real]
"""Accelerations (nu,) at a time (s) and y = [q, u, work]."""


class Situation:
    """The scene as altered by events, and its system; systems are kept, because the same scene often recurs."""

    def __init__(self, system: System, settings: Settings, given: Scene | None = None) -> None:
        """given: for a resumed run, the scene altered by changes of values alone; see `EventMemory`."""
        self.system = system
        self._settings = settings
        self.given = given or system.scene
        self._built = [system]

    @cached_property
    def _paths(self) -> dict[str, str]:
        """Paths of scalar coordinates in the scene, by name; events do not alter them."""
        return scalar_paths(self.given)

    @cached_property
    def places(self) -> dict[str, int]:
        """Indices of coordinates and speeds in [q, u, work], by name."""
        q, u = self.system.state_names
        return {name: i for i, (name, _) in enumerate((*q, *u))}

    @property
    def speeds(self) -> slice:
        """Indices of all speeds in [q, u, work]."""
        return slice(self.system.nq, self.system.nq + self.system.nu)

    def apart(self, y: Real) -> tuple[Real, Real]:
        """Divide y into [q, u, work] and the states of controllers, which events do not change."""
        motion = self.speeds.stop
        return np.r_[y[:motion], y[-1]], y[motion:-1]

    def with_motion(self, raw: Raw, motion: Real) -> Raw:
        """The result of an integration with its motion replaced by [q, u, work]."""
        return raw._replace(y=np.concatenate([motion[:-1], self.apart(raw.y)[1], motion[-1:]]))

    def going_on(self, raw: Raw) -> Beginning:
        """The beginning of a segment at the end of an integration; controllers keep their memory."""
        state = self.system.layout.known(raw.t, np.r_[self.apart(raw.y)[0][:-1], 0.0])
        return Beginning(state, raw.y, None, raw.controllers)

    def happen(self, event: SceneEvent, t: float, y: Real, accelerations: Accelerations) -> list[EventRecord]:
        """Apply the actions of an event at time t to y = [q, u, work], in place. A coordinate whose rebound is
        negligible comes to rest on its stop."""
        before = y.copy()
        found = [self._recorded(event.name, t, y, [partial(self._do, action) for action in event.actions])]
        self._become(off_stop(self.system.scene, event), t, y)
        for action in event.actions:
            if isinstance(action, Impact) and action.rests:
                push = -int(np.sign(before[self._rate_place(action.coordinate)]))
                if self._is_spent(action.coordinate, push, t, y, accelerations):
                    found.append(self.rest(event, action, push, t, y))
        return found

    def rest(self, event: SceneEvent, impact: Impact, push: int, t: float, y: Real) -> EventRecord:
        """Hold the coordinate of an impact at rest on its stop; push: the sign of the stop's load."""
        rest = partial(self._rest, event, impact.coordinate, push)
        return self._recorded(f"{event.name}: at rest", t, y, [rest])

    def at_rest(self, coordinate: str, t: float, y: Real) -> Real:
        """A copy of y = [q, u, work] after an impulse that makes the speed of a coordinate zero."""
        stopped = y.copy()
        self._strike(t, stopped, coordinate, 0.0, {}, {})
        return stopped

    def speed(self, coordinate: str, y: Real) -> float:
        """The speed of a scalar coordinate."""
        return float(y[self._rate_place(coordinate)])

    def _recorded(self, name: str, t: float, y: Real, actions: Sequence[Callable[..., None]]) -> EventRecord:
        before, work = self._state(t, y), float(y[-1])
        impulses, closures = dict[str, float](), dict[str, Real]()
        for do in actions:
            do(t, y, impulses, closures)
        return EventRecord(name, t, impulses, float(y[-1]) - work, before, self._state(t, y), closures)

    def _is_spent(self, name: str, push: int, t: float, y: Real, accelerations: Accelerations) -> bool:
        """Whether a rebound rises from the stop by no more than the tolerance, against the acceleration towards it.

        The acceleration is that of the coordinate at rest, because loads may depend on the speed of the rebound.
        """
        place = self._rate_place(name)
        rebound = push * y[place]
        pressed = -push * accelerations(t, self.at_rest(name, t, y))[place - self.system.nq]
        allowed = self._settings.atol + self._settings.rtol * abs(y[self.places[name]])
        return bool(pressed > 0.0 and rebound**2 <= 2.0 * pressed * allowed)

    def _rest(
        self, event: SceneEvent, name: str, push: int, t: float, y: Real, impulses: dict[str, float],
        closures: dict[str, Real],
    ) -> None:  # fmt: skip
        """Stop a coordinate and hold it on its stop; a motor that acts along it remains."""
        self._strike(t, y, name, 0.0, impulses, closures)
        held = changed_at(self.system.scene, self._paths[name], self._held(y[self.places[name]], keeps_motor=True))
        self._become(on_stop(held, event, name, push), t, y)
        self.system.project(t, y, self.system.constants)

    def rate_of(self, watched: str) -> int | None:
        """Index in [q, u, work] of the rate of a coordinate; None for any other quantity."""
        path = self._paths.get(watched)
        return None if path is None else self.places[rate_name(watched, path)]

    def _rate_place(self, coordinate: str) -> int:
        return self.places[rate_name(coordinate, self._paths[coordinate])]

    def is_held(self, watched: str) -> bool:
        """Whether a coordinate is latched or prescribed."""
        place = self.rate_of(watched)
        return place is not None and self.system.constants.speed["prescribed"][place - self.system.nq] >= 0

    def _do(
        self, action: Action, t: float, y: Real, impulses: dict[str, float], closures: dict[str, Real]
    ) -> None:
        match action:
            case Latch(coordinate=name):
                self._strike(t, y, name, 0.0, impulses, closures)
                held = self._held(y[self.places[name]])
                self._become(changed_at(self.system.scene, self._paths[name], held), t, y)
                self.system.project(t, y, self.system.constants)
            case Impact(coordinate=name, restitution=restitution):
                self._strike(t, y, name, -restitution, impulses, closures)
            case Release(coordinate=name):
                self._become(changed_at(self.system.scene, self._paths[name], self._freed(name)), t, y)
            case Change(path=path, value=value):
                energy = self._energy(t, y)
                self._become(self.system.scene.with_values({path: value}), t, y)
                self.given = self.given.with_values({path: value})
                y[-1] += self._energy(t, y) - energy
            case EndRun():
                pass
            case _:
                assert_never(action)

    def _strike(
        self, t: float, y: Real, name: str, factor: float, impulses: dict[str, float], closures: dict[str, Real]
    ) -> None:
        """Apply an impulse that multiplies the speed of a coordinate by `factor`."""
        rates = {self.places[rate_name(each, path)]: each for each, path in self._paths.items()}
        place = self.places[rate_name(name, self._paths[name])]
        found = struck(self.system, self._state(t, y), {place - self.system.nq: factor * y[place]})
        y[self.system.nq : -1] = found.u
        y[-1] += found.energy
        for j, impulse in found.impulses.items():
            along = rates[self.system.nq + j]
            impulses[along] = impulses.get(along, 0.0) + impulse
        for closure, wrench in found.closures.items():
            closures[closure] = closures.get(closure, 0.0) + wrench

    def _held(self, value: float, keeps_motor: bool = False):  # type: ignore[no-untyped-def]  # of a coordinate or a wheel
        def held(item: Coordinate | Wheel) -> Coordinate | Wheel:
            keys = item.KEYS
            kept = {keys.effort: getattr(item, keys.effort) if keeps_motor else None}
            still = {keys.value: 0.0, keys.rate: 0.0, keys.prescribed: Constant(value=float(value))}
            return replace(item, **still, **kept)

        return held

    def _freed(self, name: str):  # type: ignore[no-untyped-def]
        found: list[Coordinate | Wheel] = []
        changed_at(self.given, self._paths[name], lambda item: found.append(item) or item)
        return lambda _: replace(found[0], **{found[0].KEYS.prescribed: None})

    def _become(self, scene: Scene, t: float, y: Real) -> None:
        if scene == self.system.scene:
            return
        for system in self._built:
            if system.scene == scene:
                self.system = system
                return
        before = self.system
        with asking(before.kernels):  # the same kind of kernels during the whole run
            self.system = assembled(scene)
        self._built.append(self.system)
        if scene.constraints:
            from flexmb.system.closed import ClosedSystem  # imported here because trees do not need it

            assert isinstance(self.system, ClosedSystem) and isinstance(before, ClosedSystem)
            self.system.closures.begin_at(t, y, before.closures)

    def _state(self, t: float, y: Real) -> State:
        return self.system.state(y[: self.system.nq].copy(), y[self.system.nq : -1].copy(), t)

    def _energy(self, t: float, y: Real) -> float:
        return float(np.sum(list(self.system.energy(self._state(t, y)).values())))
