"""The scene of a run as altered by events, how its motion is integrated, and what the actions of events do to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace as replace_fields
from functools import partial
from math import asin, pi
from typing import TYPE_CHECKING, NamedTuple, assert_never

import numpy as np
from msgspec.structs import replace

from flexmb.integrate.settings import Settings
from flexmb.kept import kept
from flexmb.run.event_record import EventRecord
from flexmb.run.impulses import Struck, struck
from flexmb.run.origin import Beginning
from flexmb.run.outputs import doubt_about, observed
from flexmb.run.propagate import Integration, Raw, integration
from flexmb.run.trajectory import Trajectory
from flexmb.scene.connectors import Phase
from flexmb.scene.events import Action, Change, Dock, EndRun, Impact, Latch, Release, Separate
from flexmb.scene.functions import Constant
from flexmb.scene.schema import Closure, Scene, SceneEvent, Wheel
from flexmb.scene.sticking import Sticking, any_sticks, holding_sensor, sticking, with_phases
from flexmb.scene.stops import leaves, leaving, resting, stop_sensor
from flexmb.scene.tree import Coordinate, rate_name, scalar_paths
from flexmb.scene.values import changed_at, values_at
from flexmb.system.algorithm import Algorithm
from flexmb.system.compile import assembled
from flexmb.system.scene_arrays import kernels_of
from flexmb.system.system import System
from flexmb.tables.features import asking
from flexmb.tables.state import DynamicsError, State
from flexmb.tables.status import Status
from flexmb.typing import Real

if TYPE_CHECKING:
    from flexmb.closure.closures import Closures


PASSES = 5  # in which frame B of a closure that closes as it is found comes to its place


class EventInstant(NamedTuple):
    """Time (s) and y = [q, u, work] at which actions happen, which change y in place; the state and the work (J) before
    them, and their impulses so far, as in `EventRecord`."""

    t: float
    y: Real
    before: State
    work: float
    impulses: dict[str, float]
    closures: dict[str, Real]
    misfits: dict[str, tuple[float, float]]


class Situation:
    """The scene as altered by events, and its system; systems are kept, because the same scene often recurs."""

    def __init__(
        self, system: System, settings: Settings, algorithm: Algorithm, stabilise: float, given: Scene | None = None
    ) -> None:
        """stabilise (1/s): see `flexmb.simulate`. given: for a resumed run, the scene altered by changes of values
        alone; see `EventMemory`."""
        self.system = system = with_stops(system)
        self.settings, self._algorithm, self._stabilise = settings, algorithm, stabilise
        self.given = given or system.scene
        self._built = [system]
        self.doubts: list[str] = []
        """Warnings about integrations that did not fail."""

    def integration(self) -> AbstractContextManager[Integration]:
        """An integration of the present system for exclusive use within the context."""
        return integration(self.system, self._algorithm, self._stabilise, self.settings.integrator)

    def observed(self, raw: Raw, times: Real, solve: Integration) -> Trajectory:
        """Outputs of an integration by `solve` at these times (T,) s."""
        part, doubt = observed(self.system, times, raw, self._algorithm, solve), doubt_about(self.system, solve)
        if part.status is Status.OK and doubt is not None:
            self.doubts.append(f'scene "{self.system.scene.name}": {doubt}')
        return part

    def accelerations(self, raw: Raw, motion: Real) -> Real:
        """Accelerations (nu,) with the controllers' outputs at the end of an integration, but with another motion
        [q, u, work]."""
        begin = self.going_on(self.with_motion(raw, motion))
        with self.integration() as solve:
            if solve.feedback is None:
                return self.system.accelerations(begin.state, self._algorithm)
            return solve.feedback.accelerations(begin)

    @kept
    def _paths(self) -> dict[str, str]:
        """Paths of scalar coordinates in the scene, by name; events do not alter them."""
        return scalar_paths(self.given)

    @kept
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

    def happen(self, event: SceneEvent, raw: Raw, y: Real) -> list[EventRecord]:
        """Apply the actions of an event at the end of an integration to y = [q, u, work], in place. A coordinate whose
        rebound is negligible comes to rest on its stop."""
        arriving, at = y.copy(), self.instant(raw.t, y)
        for action in event.actions:
            self._do(action, at)
        records = [_recorded(event.name, at, self._state(at.t, at.y))]
        self._become(self._off_stop(event), at)
        for action in event.actions:
            if isinstance(action, Impact) and action.rests:
                push = -int(np.sign(self.speed(action.coordinate, arriving)))
                if self._is_spent(action.coordinate, push, raw, y):
                    records.append(self.rest(event, action, push, raw.t, y))
        return records

    def rest(self, event: SceneEvent, impact: Impact, push: int, t: float, y: Real) -> EventRecord:
        """Stop the coordinate of an impact and hold it on its stop, until an event releases it before the stop would
        pull; a motor that acts along it remains. push: the sign of the stop's load."""
        name, at = impact.coordinate, self.instant(t, y)
        self._free_of_friction(at)
        self._strike(at, name, 0.0)
        self._hold(at, name, leaves(event, name, push))
        return _recorded(f"{event.name}: at rest", at, self._state(at.t, at.y))

    def holds_otherwise(self, friction: Sticking) -> bool:
        """Whether a latch or a stop holds the coordinate of friction."""
        return friction.connector.phase != "sticking" and self.is_held(friction.coordinate)

    def with_friction(self, phases: Mapping[str, Phase], held: Sequence[Sticking], at: EventInstant) -> None:
        """Give friction these phases; that in `held` holds its coordinate where it is, all other friction none."""
        scene = self.system.scene
        for each in sticking(scene):
            if each.connector.phase == "sticking":
                scene = self._freed(scene, each.coordinate)
        scene = with_phases(scene, phases)
        for each in held:
            scene = changed_at(scene, self._paths[each.coordinate], partial(self._still, at, each.coordinate, True))
        speeds = {self.speed_place(each.coordinate) - self.system.nq: 0.0 for each in held}
        if speeds and (self.system.scene.constraints or np.any(at.y[self.speeds][list(speeds)])):
            self._take(at, struck(self.system, self._state(at.t, at.y), speeds))
        self._become(scene, at)
        if held:
            self.system.project(at.t, at.y, self.system.constants)

    def recorded_of_friction(self, names: Sequence[str], at: EventInstant) -> list[EventRecord]:
        """The records of what happened to friction; the first has what all of it changed together."""
        after = self._state(at.t, at.y)
        records = [_recorded(name, at, after) for name in names]
        return records[:1] + [replace_fields(each, impulses={}, closures={}, energy_change=0.0) for each in records[1:]]

    def at_rest(self, coordinate: str, t: float, y: Real) -> Real:
        """A copy of y = [q, u, work] after an impulse that makes the speed of a coordinate zero."""
        stopped = y.copy()
        self._strike(self.instant(t, stopped), coordinate, 0.0)
        return stopped

    def speed(self, coordinate: str, y: Real) -> float:
        """The speed of a scalar coordinate."""
        return float(y[self.speed_place(coordinate)])

    def _is_spent(self, name: str, push: int, raw: Raw, y: Real) -> bool:
        """Whether a rebound rises from the stop by no more than the tolerance, against the acceleration towards it.

        The acceleration is that of the coordinate at rest, because loads may depend on the speed of the rebound.
        """
        place = self.speed_place(name)
        rebound = push * y[place]
        pressed = -push * self.accelerations(raw, self.at_rest(name, raw.t, y))[place - self.system.nq]
        allowed = self.settings.atol + self.settings.rtol * abs(y[self.places[name]])
        return bool(pressed > 0.0 and rebound**2 <= 2.0 * pressed * allowed)

    def rate_of(self, watched: str) -> int | None:
        """Index in [q, u, work] of the rate of a coordinate; None for any other quantity."""
        path = self._paths.get(watched)
        return None if path is None else self.places[rate_name(watched, path)]

    def speed_place(self, coordinate: str) -> int:
        """Index in [q, u, work] of the speed of a scalar coordinate."""
        return self.places[rate_name(coordinate, self._paths[coordinate])]

    def is_held(self, watched: str) -> bool:
        """Whether a coordinate is latched or prescribed."""
        place = self.rate_of(watched)
        return place is not None and self.system.constants.speed["prescribed"][place - self.system.nq] >= 0

    def _do(self, action: Action, at: EventInstant) -> None:
        if isinstance(action, Latch | Impact | Dock):
            self._free_of_friction(at)
        match action:
            case Latch(coordinate=name):
                self._strike(at, name, 0.0)
                self._hold(at, name)
            case Impact(coordinate=name, restitution=restitution):
                self._strike(at, name, -restitution)
            case Release(coordinate=name):
                self._become(self._freed(self.system.scene, name), at)
            case Change(path=path, value=value):
                energy = self._energy(at)
                self._become(self.system.scene.with_values({path: value}), at)
                self.given = self.given.with_values({path: value})
                at.y[-1] += self._energy(at) - energy
            case Separate(closure=name):
                self._become(_with_closure(self.system.scene, self._given_closure(name, closed=False)), at)
            case Dock():
                self._dock(action, at)
            case EndRun():
                pass
            case _:
                assert_never(action)

    def _freed(self, scene: Scene, coordinate: str) -> Scene:
        """A scene in which a coordinate is free, with the spring, damper and motor that the scene gives it."""
        [item] = values_at(self.given, self._paths[coordinate])
        freed = replace(item, **{item.KEYS.prescribed: None})
        return changed_at(scene, self._paths[coordinate], lambda _: freed)

    def _free_of_friction(self, at: EventInstant) -> None:
        """Let go what friction holds: its load is bounded, so that it takes no part in an impulse."""
        if any_sticks(self.system.scene):
            self.with_friction({each.name: "idle" for each in sticking(self.system.scene)}, (), at)

    def _given_closure(self, name: str, *, closed: bool) -> Closure:
        """A closure as the scene gives it, open or closed."""
        [closure] = [each for each in self.given.closures if each.name == name]
        return replace(closure, closed=closed)

    def _dock(self, dock: Dock, at: EventInstant) -> None:
        """Close a closure: first the positions, then, by an impulse, the speeds. Nothing happens if it is closed."""
        from flexmb.closure.assembly import closed_positions  # imported here because trees do not need it

        name = dock.closure
        if any(closure.name == name and closure.closed for closure in self.system.scene.closures):
            return
        self._become(_with_closure(self.system.scene, self._given_closure(name, closed=True)), at)
        at.misfits[name] = self._misfit(dock, self._closures, at)
        if dock.as_found:
            self._take_as_found(name, at)
        energy = self._energy(at)
        at.y[:] = closed_positions(self._closures, at.t, at.y)
        at.y[-1] += self._energy(at) - energy
        self._take(at, struck(self.system, self._state(at.t, at.y), {}, name))
        self.system.project(at.t, at.y, self.system.constants)

    @property
    def _closures(self) -> Closures:
        closures = self.system.closures
        assert closures is not None  # the one that closes is among them
        return closures

    def _take_as_found(self, name: str, at: EventInstant) -> None:
        """Move frame B of a closure to where it is closed. A node that deforms moves it a little further each time."""
        from flexmb.closure.as_found import as_found  # imported here because trees do not need it
        from flexmb.closure.projection import CLOSED

        for _ in range(PASSES):
            [closure] = [each for each in self.system.scene.closures if each.name == name]
            pose = self._closures.relative_pose(at.t, at.y, name)
            self._become(_with_closure(self.system.scene, as_found(closure, *pose)), at)
            self._closures.linearise(at.t, at.y)
            if np.abs(self._closures.errors()).max() <= CLOSED:
                break

    def _misfit(self, dock: Dock, closures: Closures, at: EventInstant) -> tuple[float, float]:
        """How far the frames of a closure are apart (m, rad) before it closes; DynamicsError beyond its tolerance."""
        gap, sine = closures.gaps(at.t, at.y)[dock.closure]
        number = [closure.name for closure in self.system.scene.closures].index(dock.closure)
        angle = pi / 2.0 if dock.closure in closures.half_turned() else asin(min(sine, 1.0))
        atol, rtol = self.settings.atol, self.settings.rtol
        size = float(closures.sizes[number])
        if not (gap <= dock.tolerance_m + atol + rtol * size and angle <= dock.tolerance_rad + atol + rtol):
            at_least = "at least " if angle == pi / 2.0 else ""
            raise DynamicsError(
                f'at t = {at.t:g} s an event closes closure "{dock.closure}", whose frames are {gap:.3g} m and '
                f"{at_least}{angle:.3g} rad apart: bring them together first, or give tolerance_m and tolerance_rad "
                "that admit this, and bodies are moved by so much"
            )
        return gap, angle

    def _strike(self, at: EventInstant, name: str, factor: float) -> None:
        """Apply an impulse that multiplies the speed of a coordinate by `factor`."""
        place = self.speed_place(name)
        speeds = {place - self.system.nq: factor * at.y[place]}
        self._take(at, struck(self.system, self._state(at.t, at.y), speeds))

    def _take(self, at: EventInstant, state: Struck) -> None:
        """Take over the speeds after impulses, and add these to those of the instant."""
        y, nq = at.y, self.system.nq
        rates = {self.speed_place(path): path for path in self._paths}
        y[nq:-1] = state.u
        y[-1] += state.energy
        for j, impulse in state.impulses.items():
            along = rates[nq + j]
            at.impulses[along] = at.impulses.get(along, 0.0) + impulse
        for closure, wrench in state.closures.items():
            at.closures[closure] = at.closures.get(closure, 0.0) + wrench

    def _hold(self, at: EventInstant, name: str, leaving_stop: SceneEvent | None = None) -> None:
        """Hold a coordinate or wheel where it is; on a stop with its motor, until the event that it leaves the stop."""
        still = partial(self._still, at, name, leaving_stop is not None)
        scene = changed_at(self.system.scene, self._paths[name], still)
        if leaving_stop is not None:
            scene = replace(scene, events=(*scene.events, leaving_stop))
        self._become(scene, at)
        self.system.project(at.t, at.y, self.system.constants)

    def _still(self, at: EventInstant, name: str, driven: bool, item: Coordinate | Wheel) -> Coordinate | Wheel:
        """A coordinate or wheel held where it is; driven: with its motor."""
        keys = item.KEYS
        kept = {keys.effort: getattr(item, keys.effort) if driven else None}
        still = {keys.value: 0.0, keys.rate: 0.0, keys.prescribed: Constant(value=float(at.y[self.places[name]]))}
        return replace(item, **still, **kept)

    def _off_stop(self, event: SceneEvent) -> Scene:
        """The scene after an event: without it, if it was one that released a coordinate from its stop."""
        scene = self.system.scene
        if event.name not in {leaving(connector) for connector, _ in resting(scene)}:
            return scene
        return replace(scene, events=tuple(candidate for candidate in scene.events if candidate.name != event.name))

    def _become(self, scene: Scene, at: EventInstant) -> None:
        if scene == self.system.scene:
            return
        for system in self._built:
            if system.scene == scene:
                self.system = system
                return
        before = self.system
        with asking(kernels_of(before)):  # the same kind of kernels during the whole run
            self.system = assembled(scene)
        self._built.append(self.system)
        if self.system.closures is not None:
            self.system.closures.begin_at(at.t, at.y, before.closures)

    def instant(self, t: float, y: Real) -> EventInstant:
        """An instant at which something is going to change y = [q, u, work] in place."""
        return EventInstant(t, y, self._state(t, y), float(y[-1]), {}, {}, {})

    def _state(self, t: float, y: Real) -> State:
        return self.system.state(y[: self.system.nq].copy(), y[self.system.nq : -1].copy(), t)

    def _energy(self, at: EventInstant) -> float:
        return float(np.sum(list(self.system.energy(self._state(at.t, at.y)).values())))


def _recorded(name: str, at: EventInstant, after: State) -> EventRecord:
    gained = float(at.y[-1]) - at.work
    return EventRecord(name, at.t, at.impulses, gained, at.before, after, at.closures, misfits=at.misfits)


def _with_closure(scene: Scene, changed: Closure) -> Scene:
    """The scene with a closure in place of that of its name."""
    return replace(scene, closures=tuple(changed if each.name == changed.name else each for each in scene.closures))


def with_stops(system: System) -> System:
    """The system with sensors for the loads of all stops on which a coordinate may come to rest, and of all friction
    that may hold one."""
    known = {sensor.name for sensor in system.scene.sensors}  # the scene of a resumed run has these sensors already
    sensors = [stop_sensor(event, action) for event, action in resting(system.scene)]
    sensors += map(holding_sensor, sticking(system.scene))
    missing = [sensor for sensor in sensors if sensor.name not in known]
    if not missing:
        return system
    with asking(kernels_of(system)):
        return assembled(replace(system.scene, sensors=(*system.scene.sensors, *missing)))
