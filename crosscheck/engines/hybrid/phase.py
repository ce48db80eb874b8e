"""A scene between two events that change it: its mechanics in a peer, what its sensors read and its laws."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from crosscheck.engines.contract import Snapshot
from crosscheck.engines.functions_of_time import Signals, scene_functions
from crosscheck.engines.hybrid.laws import Numbers, law_of
from crosscheck.engines.hybrid.reading import (
    TIME,
    Seen,
    chosen,
    coordinate_names,
    rate_names,
    sensor_reader,
    slot_of,
    split,
)
from crosscheck.engines.links import Link
from crosscheck.engines.rigid_tree import Slot, TreeState
from flexmb.scene.functions import Function
from flexmb.scene.schema import Controller, ProfileSensor, Scene, SceneEvent
from flexmb.typing import Real


class PeerMechanics(Protocol):
    """A scene without its events and controllers in a peer; the last number of its state y is the work done so far."""

    @property
    def slots(self) -> Sequence[Slot]: ...
    def initial(self) -> Real: ...
    def packed(self, q: Real, v: Real) -> Real:
        """y of a state of all coordinates, before any work was done."""

    def state(self, t: float, y: Real) -> TreeState: ...
    def rate(self, t: float, y: Real) -> Real: ...
    def masses(self, q: Real) -> Real:
        """The mass matrix (nv, nv) of the speeds that are not driven."""

    def observe(self, t: float, state: TreeState) -> Snapshot: ...


Compile = Callable[[Scene, tuple[Link, ...], Signals], PeerMechanics]
"""Makes the mechanics of a scene on given links, with motors and loads that follow the signals."""


@dataclass
class ControllerOutputs(Signals):
    """What controllers put out now, by name; nothing before the first time. Of delayed ones it is what acts, not what
    waits.
    """

    now: dict[str, Numbers] = field(default_factory=dict)

    def value(self, source: str) -> float:
        return chosen(self.now, source)[0] if split(source)[0] in self.now else 0.0


class Phase:
    """A scene as it is between two events: its mechanics, sensors and laws."""

    def __init__(self, scene: Scene, chain: tuple[Link, ...], outputs: ControllerOutputs, compiled: Compile) -> None:
        self.scene, self.chain, self.outputs = scene, chain, outputs
        self.mechanics = compiled(scene, chain, outputs)
        self.laws = {law.name: law_of(law) for law in scene.controllers}
        self._readers = {each.name: sensor_reader(scene, self.mechanics.slots, each) for each in scene.sensors}
        self._watched = {event.name: self._watch(event.watch) for event in scene.events if event.watch != TIME}
        self.functions: list[Function] = scene_functions(scene)
        self.functions += [sensor.function for sensor in scene.sensors if isinstance(sensor, ProfileSensor)]
        self._read_by = {law.name: [split(each)[0] for each in law.inputs] for law in scene.controllers}

    def read(self, names: Iterable[str], t: float, state: TreeState) -> dict[str, Numbers]:
        """What the sensors of these names read."""
        seen = self._seen(t, state)
        return {name: self._readers[name](t, state, seen) for name in names if name in self._readers}

    def inputs_of(self, law: Controller, t: float, state: TreeState) -> Numbers:
        """What a controller reads now, of sensors and of the controllers before it."""
        values = self.outputs.now | self.read(self._read_by[law.name], t, state)
        return [number for reference in law.inputs for number in chosen(values, reference)]

    def gap(self, event: SceneEvent, t: float, y: Real) -> float:
        """What an event watches, less its level."""
        state = self.mechanics.state(t, y)
        return self._watched[event.name](t, state, self._seen(t, state))[0] - event.level

    def _watch(self, watch: str) -> Callable[[float, TreeState, Seen], Numbers]:
        slots, scene = self.mechanics.slots, self.scene
        if watch in coordinate_names(scene):
            slot = slot_of(scene, slots, watch)
            return lambda t, state, seen: [float(state.q[slot.q])]
        if watch in (rates := rate_names(scene)):
            slot = slot_of(scene, slots, rates[watch])
            return lambda t, state, seen: [float(state.v[slot.v])]
        name, number = split(watch)
        reader = self._readers[name]
        return lambda t, state, seen: [reader(t, state, seen)[number or 0]]

    def _seen(self, t: float, state: TreeState) -> Seen:
        """The snapshot, observed once if any sensor asks for it."""
        found: list[Snapshot] = []

        def seen() -> Snapshot:
            if not found:
                found.append(self.mechanics.observe(t, state))
            return found[0]

        return seen


class PhaseSample(NamedTuple):
    """A state for the output, with the phase that it belongs to and what controllers put out."""

    phase: Phase
    t: float
    y: Real
    outputs: dict[str, Numbers]
