"""Dry friction that sticks: along which coordinates, in which phase, and the events at which a phase ends.

A run writes the phase of each into its connector (`phase`). While it slides, forward or backward, the zero of the speed
is an event; while it sticks, the coordinate is held, a sensor has the load that this takes, and an event is where that
load comes beyond static friction. While something else holds the coordinate, friction is idle: that carries the load.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple, assert_never

from msgspec.structs import replace

from flexmb.scene.connectors import HingeFriction, Phase, by_stem, sticks
from flexmb.scene.control import DriveSensor
from flexmb.scene.events import Latch, Release, SceneEvent
from flexmb.scene.functions import Constant
from flexmb.scene.keys import split_unit
from flexmb.scene.schema import Scene
from flexmb.scene.tree import coordinate_of, rate_name, scalar_paths

MARGIN = 2.0**-42
"""Relative to static friction: what slips holds this much more. So the acceleration with which it starts has its sign
beyond rounding; the instant moves by this fraction of the time in which the load would rise from zero."""
DIRECTIONS: dict[int, Phase] = {1: "forward", -1: "backward"}


class Sticking(NamedTuple):
    """A connector of dry friction that sticks, and the name of its coordinate as in `scalar_paths`: the scalar one of
    this number, `place`, of the hinge, point mass or wheel `owner`."""

    connector: HingeFriction
    coordinate: str
    owner: str
    place: int

    @property
    def name(self) -> str:
        return self.connector.name

    @property
    def static(self) -> float:
        """The largest load (N or N m) that it holds."""
        law = by_stem(self.connector)
        return float(law["sliding"] if law["static"] is None else law["static"])

    @property
    def breaks_at(self) -> float:
        """The load (N or N m) at which it slips."""
        return (1.0 + MARGIN) * self.static

    @property
    def at_zero(self) -> float:
        """Sliding friction (N or N m) at vanishing speed."""
        law = by_stem(self.connector)
        return float(law["sliding"] if law["stribeck"] is None else law["static"])


def sticking(scene: Scene) -> Iterator[Sticking]:
    """All dry friction of a scene that sticks, in its order; ValueError where a coordinate does not exist."""
    for connector in scene.connectors:
        if isinstance(connector, HingeFriction) and sticks(connector):
            item, place = coordinate_of(scene, connector)
            own = [name for name in scalar_paths(scene) if name.rpartition(".")[0] == item.name]
            yield Sticking(connector, own[place], item.name, place)


NEVER_ZERO = 1e-150
"""A smoothing speed (rad/s or m/s) whose square is a number and below that of every speed that is not zero."""


class Realised(NamedTuple):
    """Friction that sticks as the tables have it in its phase: an actuator's constant load and a smooth law."""

    constant: Constant
    law: HingeFriction


def realised(connector: HingeFriction) -> Realised:
    """What acts along the coordinate in the phase of the connector.

    In a phase of sliding in the direction s the load is

        -s [Fc + (Fs - Fc)/(1 + r^2)] = -s Fs + (Fs - Fc) r^2/(1 + r^2) s,    r = v/vs,

    a constant, and a term with sign(v) in place of s, which is the same where v has the sign s, and whose first
    derivative goes on through zero: so no step that reaches beyond the zero meets a jump. Without a Stribeck speed the
    constant is -s Fc alone. Before a run has decided, the law is that of the sign of v, undefined at zero.
    """
    static, stribeck, sliding, smoothing = _keys(connector)
    law = by_stem(connector)
    Fc, Fs = law["sliding"], law["static"]
    without = {static: None, stribeck: None}
    nothing = replace(connector, **without, **{sliding: 0.0, smoothing: 1.0})
    match connector.phase:
        case "undecided":
            return Realised(Constant(value=0.0), connector if law["stribeck"] else replace(connector, **without))
        case "idle" | "sticking":
            return Realised(Constant(value=0.0), nothing)
        case "forward" | "backward" as phase:
            s = 1.0 if phase == "forward" else -1.0
            if law["stribeck"] is None:
                return Realised(Constant(value=-s * Fc), nothing)
            falling = {static: 0.0, sliding: Fc - Fs, smoothing: NEVER_ZERO}
            return Realised(Constant(value=-s * Fs), replace(connector, **falling))
        case _:
            assert_never(connector.phase)


def _keys(connector: HingeFriction) -> tuple[str, ...]:
    """Its keys of static friction, Stribeck speed, sliding friction and smoothing speed."""
    keys = {split_unit(key)[0]: key for key in connector.__struct_fields__}
    return tuple(keys[stem] for stem in ("static", "stribeck", "sliding", "smoothing"))


def any_sticks(scene: Scene) -> bool:
    """Whether a scene has friction that sticks."""
    return any(map(sticks, scene.connectors))


def load_of(name: str) -> str:
    """The name of the signal with the load (N or N m) along the coordinate by which friction holds it."""
    return f"{name}: holding"


def holding_sensor(friction: Sticking) -> DriveSensor:
    """The sensor of that load, which is 0 unless the coordinate is held."""
    return DriveSensor(name=load_of(friction.name), coordinate=friction.coordinate)


SLIPS = {-1: "slips forward", 1: "slips backward"}
"""How a coordinate slips, by the sign of the load that held it."""


def names_of(name: str) -> tuple[str, ...]:
    """The names of the events that a run adds for friction of this name, and of their records."""
    return tuple(f"{name}: {what}" for what in ("sticks", *SLIPS.values(), "slips", "reverses"))


def phase_events(scene: Scene) -> tuple[SceneEvent, ...]:
    """The events that end the present phases."""
    paths, events = scalar_paths(scene), list[SceneEvent]()
    for friction in sticking(scene):
        name, coordinate = friction.name, friction.coordinate
        match friction.connector.phase:
            case "forward" | "backward" as phase:
                events.append(SceneEvent(
                    name=f"{name}: sticks", watch=rate_name(coordinate, paths[coordinate]), level=0.0,
                    crossing="falling" if phase == "forward" else "rising", actions=(Latch(coordinate=coordinate),),
                ))  # fmt: skip
            case "sticking":
                for sign, what in SLIPS.items():
                    events.append(SceneEvent(
                        name=f"{name}: {what}", watch=load_of(name), level=sign * friction.breaks_at,
                        crossing="rising" if sign > 0 else "falling", actions=(Release(coordinate=coordinate),),
                    ))  # fmt: skip
            case "undecided" | "idle":
                pass
            case _:
                assert_never(friction.connector.phase)
    return tuple(events)


def events_of(scene: Scene) -> tuple[SceneEvent, ...]:
    """The events of a scene, and those that end the present phases of friction."""
    return (*scene.events, *phase_events(scene)) if any_sticks(scene) else scene.events


def with_phases(scene: Scene, phases: Mapping[str, Phase]) -> Scene:
    """The scene with other phases of friction, by name."""
    connectors = tuple(
        replace(each, phase=phases[each.name]) if each.name in phases else each
        for each in scene.connectors
    )
    return scene if connectors == scene.connectors else replace(scene, connectors=connectors)


def refuse_sticking(scene: Scene, what: str, instead: str = "run it by flexmb.simulate") -> None:
    """NotImplementedError for a scene with friction that sticks, which `what` does not take; `instead`: a remedy."""
    for friction in sticking(scene):
        raise NotImplementedError(
            f'scene "{scene.name}": friction "{friction.name}" sticks (its smoothing is 0), and {what}: {instead}, or '
            "give it a smoothing speed"
        )
