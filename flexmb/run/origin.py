"""Where a run begins: the scene's own state, a state, values by name, or where another run ended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flexmb.control.memory import LoopMemory
from flexmb.integrate.memory import Memory
from flexmb.run.event_memory import EventMemory
from flexmb.run.restart import Restart
from flexmb.run.taking_up import fitting
from flexmb.scene.problems import closest
from flexmb.system.tree_system import System
from flexmb.tables import arguments
from flexmb.tables.state import State, pack
from flexmb.typing import Real

Values = Mapping[str, float | Sequence[float] | Real]
Given = State | Restart | Values | None
SAME = 1e-9  # relative difference of a value that is given and one that a prescribed motion has


class Beginning(NamedTuple):
    """state: what the run starts from, with its time; y (nq+nu+1,) = [q, u, work], a copy; of one taken up its memory,
    those of its controllers and events, and states of controllers before the work in y."""

    state: State
    y: Real
    memory: Memory | None
    controllers: LoopMemory | None = None
    events: EventMemory | None = None


def start_time(t_start: float | None, state: Given) -> float:
    """Time (s) at which a run begins; ValueError or TypeError for one that makes no sense."""
    if isinstance(state, Restart):
        state = state.examined()
    own = state.t if isinstance(state, State | Restart) else 0.0
    if t_start is None:
        return own
    t_start = arguments.number("t_start", t_start)
    if isinstance(state, Restart) and not state.since <= t_start <= own:
        raise ValueError(
            f"t_start is {t_start:g} s, but the run that is taken up goes on from {state.since:.17g} s and ended at "
            f"{own:.17g} s: leave t_start out, or give a time between these"
        )
    return t_start


def origin(system: System, t: float, state: Given, method: str) -> Beginning:
    """What a run by this method begins with at time t (s).

    ValueError for a restart of another scene or method, for values that do not belong to the scene or contradict its
    prescribed motions, for a state that closes its closures only roughly; TypeError for anything else than `Given`.
    """
    if isinstance(state, Restart):
        return _taken_up(system, state, method)
    if state is None:
        found = system.initial_state if t == 0.0 else system.admissible(system.scene_state(t), "scene")
    elif isinstance(state, State):
        system.layout.entering(state)
        found = system.admissible(system.layout.known(t, pack(state)), "state")
    elif isinstance(state, Mapping):
        found = _named(system, t, state)
    else:
        raise TypeError(f"state is {type(state).__name__}: give a State, a Restart, or values by name")
    return Beginning(found, found.y.copy(), None)


def _taken_up(system: System, restart: Restart, method: str) -> Beginning:
    restart = fitting(system, restart, method)
    y = restart.memory.y.copy()
    t, motion = system.layout.whole(restart.since, np.r_[y[: system.nq + system.nu], y[-1]])
    if system.scene.closures:
        _count_rows(system, t, motion)
    is_anew = restart.events is not None and restart.events.anew
    return Beginning(
        system.layout.known(t, np.r_[motion[:-1], 0.0]), y, None if is_anew else restart.taken_up(),
        restart.controllers, restart.events,
    )  # fmt: skip


def _count_rows(system: System, t: float, motion: Real) -> None:
    """Of a scene that events have left, with hinges that are held, the run itself may know the only closed state."""
    from flexmb.closure.closures import ClosureError  # a tree needs none of it
    from flexmb.system.closed import ClosedSystem

    assert isinstance(system, ClosedSystem)
    try:
        system.initial_state  # noqa: B018 - counts them
    except ClosureError:
        system.closures.begin_at(t, motion)


def _named(system: System, t: float, values: Values) -> State:
    places, y = names_of_places(system), system.scene_state(t).y
    given = np.zeros(len(y), bool)
    for name, value in values.items():
        if name not in places:
            raise ValueError(
                f"state: scene \"{system.scene.name}\" has no coordinate or speed {name!r}: {closest(name, places)} "
                f"There are {', '.join(sorted(places))}"
            )
        place, called = places[name], f'state["{name}"]'
        is_one = value.ndim == 0 if hasattr(value, "ndim") else not isinstance(value, Sequence)
        row = [value] if is_one else value
        numbers = arguments.finite(called, arguments.vector(called, row, place.stop - place.start))
        if np.any(given[place] & (y[place] != numbers)):
            raise ValueError(f"{called} is {value}, and another name gives the same coordinates other values")
        y[place], given[place] = numbers, True
    _, whole = system.layout.whole(t, y)
    found = system.admissible(system.layout.known(t, whole), given)
    _refuse_other_than_prescribed(system, whole, found, given)
    return found


def names_of_places(system: System) -> dict[str, slice]:
    """Places in [q, u, work] of all that a state may be given by.

    Single entries as in `Trajectory.q_names` and `u_names`; "<hinge>", "<wheel>", "<body>.modes" for all coordinates of
    one, with ".speeds" behind it for all its speeds.
    """
    q, u = system.state_names
    found = {name: slice(i, i + 1) for i, (name, _) in enumerate((*q, *u))}
    for suffix, places, first in (("", system.layout.q, 0), (".speeds", system.layout.u, system.nq)):
        for name, place in places.items():
            if place.stop > place.start and not name.endswith(".hinge"):
                found[name + suffix] = slice(first + place.start, first + place.stop)
    return found


def _refuse_other_than_prescribed(system: System, whole: Real, found: State, given: Real) -> None:
    """A value that is given says where the motion starts: a prescribed motion must agree."""
    names = [name for names in system.state_names for name, _ in names]
    speed = system.constants.speed
    for j in np.flatnonzero(speed["prescribed"] >= 0).tolist():
        for i in (int(speed["coordinate"][j]), system.nq + j):
            if given[i] and abs(whole[i] - found.y[i]) > SAME * max(1.0, abs(found.y[i])):
                raise ValueError(
                    f'state: "{names[i]}" is prescribed, and its motion has {found.y[i]:g} at t = {found.t:g} s, not '
                    f"{whole[i]:g}: leave it out, or change the function"
                )
