"""Where a run begins: the scene's own state, a state, values by name, or where another run ended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flexmb.control.schedule import LoopMemory
from flexmb.integrate.memory import Memory
from flexmb.run.event_record import EventMemory
from flexmb.run.restart import Restart, fitting
from flexmb.scene.problems import closest
from flexmb.scene.tree import closes
from flexmb.system.system import System
from flexmb.tables import arguments
from flexmb.tables.state import State, pack
from flexmb.typing import Real

Values = Mapping[str, float | Sequence[float] | Real]
Given = State | Restart | Values | None
SAME = 1e-9  # allowed relative difference of a given value from that of a prescribed motion


class Beginning(NamedTuple):
    """state: the state and time at which the run starts; y (nq+nu+1,) = [q, u, work], a copy. For a resumed run also
    the memories of its integrator, controllers and events; y then has the controllers' states before the work."""

    state: State
    y: Real
    memory: Memory | None
    controllers: LoopMemory | None = None
    events: EventMemory | None = None


def start_time(t_start: float | None, state: Given) -> float:
    """Time (s) at which a run begins; ValueError or TypeError for an invalid one."""
    if isinstance(state, Restart):
        state = state.examined()
    own = state.t if isinstance(state, State | Restart) else 0.0
    if t_start is None:
        return own
    t_start = arguments.number("t_start", t_start)
    if isinstance(state, Restart) and not state.since <= t_start <= own:
        raise ValueError(
            f"t_start is {t_start:g} s, but the run to resume continues from {state.since:.17g} s and ended at "
            f"{own:.17g} s: leave t_start out, or give a time between these"
        )
    return t_start


def origin(system: System, t: float, state: Given, method: str) -> Beginning:
    """The beginning of a run by this method at time t (s).

    ValueError for a restart of another scene or method, for values that do not belong to the scene or contradict its
    prescribed motions, and for a state that is far from closing its closures; TypeError for other types than `Given`.
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
    if system.scene.constraints:
        _count_rows(system, t, motion)
    is_anew = restart.events is not None and restart.events.anew
    return Beginning(
        system.layout.known(t, np.r_[motion[:-1], 0.0]), y, None if is_anew else restart.taken_up(),
        restart.controllers, restart.events,
    )  # fmt: skip


def _count_rows(system: System, t: float, motion: Real) -> None:
    """Have the independent rows of closures counted. If no closed state is found from the scene's own initial state, as
    after events that hold hinges, the state of the resumed run is used; likewise if events close closures, because in
    the initial state their frames may be anywhere."""
    from flexmb.closure.closures import ClosureError  # imported here because trees do not need it

    assert system.closures is not None  # of a closed chain
    if closes(system.scene):
        system.closures.begin_at(t, motion)
        return
    try:
        system.initial_state  # noqa: B018 - counts the rows
    except ClosureError:
        system.closures.begin_at(t, motion)


def _named(system: System, t: float, values: Values) -> State:
    places, y = names_of_places(system), system.scene_state(t).y
    given = np.zeros(len(y), bool)
    for name, value in values.items():
        if name not in places:
            raise ValueError(
                f'state: scene "{system.scene.name}" has no coordinate or speed {name!r}: {closest(name, places)} '
                f"There are {', '.join(sorted(places))}"
            )
        place, called = places[name], f'state["{name}"]'
        is_one = value.ndim == 0 if hasattr(value, "ndim") else not isinstance(value, Sequence)
        row = [value] if is_one else value
        numbers = arguments.finite(called, arguments.vector(called, row, place.stop - place.start))
        if np.any(given[place] & (y[place] != numbers)):
            raise ValueError(f"{called} is {value}, but another name gives the same coordinates other values")
        y[place], given[place] = numbers, True
    _, whole = system.layout.whole(t, y)
    state = system.admissible(system.layout.known(t, whole), given)
    _refuse_other_than_prescribed(system, whole, state, given)
    return state


def names_of_places(system: System) -> dict[str, slice]:
    """Places in [q, u, work] by all names that a state may be given by.

    These are single entries as in `Trajectory.q_names` and `u_names`; "<hinge>", "<wheel>" or "<body>.modes" for all
    coordinates of an item; and the same followed by ".speeds" for all its speeds.
    """
    q, u = system.state_names
    found = {name: slice(i, i + 1) for i, (name, _) in enumerate((*q, *u))}
    for suffix, places, first in (("", system.layout.q, 0), (".speeds", system.layout.u, system.nq)):
        for name, place in places.items():
            if place.stop > place.start and not name.endswith(".hinge"):
                found[name + suffix] = slice(first + place.start, first + place.stop)
    return found


def _refuse_other_than_prescribed(system: System, whole: Real, found: State, given: Real) -> None:
    """ValueError for a given value that differs from that of a prescribed motion."""
    names = [name for names in system.state_names for name, _ in names]
    speed = system.constants.speed
    for j in np.flatnonzero(speed["prescribed"] >= 0).tolist():
        for i in (int(speed["coordinate"][j]), system.nq + j):
            if given[i] and abs(whole[i] - found.y[i]) > SAME * max(1.0, abs(found.y[i])):
                raise ValueError(
                    f'state: "{names[i]}" is prescribed, and its function gives {found.y[i]:g} at t = {found.t:g} s, '
                    f"not {whole[i]:g}: leave it out, or change the function"
                )
