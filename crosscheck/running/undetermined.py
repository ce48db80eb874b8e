"""Components of loads that the motion of a scene does not determine, found from its closures, whatever engines say.

The motion of flexmb gives the states; what is open there follows from the rank of the closures' rows by the dense route
(`flexmb.dense.closures`), which shares no dynamics with flexmb's algorithms.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain
from typing import assert_never

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from crosscheck.engines.openness import LOAD_PARTS, Openness
from flexmb.closure.closures import ClosureError
from flexmb.dense import DenseSystem
from flexmb.dense.closures import open_loads
from flexmb.run.simulate import simulate
from flexmb.run.trajectory import Trajectory
from flexmb.scene.events import Change, Dock, EndRun, Impact, Latch, Release, Separate
from flexmb.scene.schema import Scene
from flexmb.scene.stops import leaving
from flexmb.scene.tree import coordinates
from flexmb.system.compile import compile
from flexmb.system.system import System
from flexmb.system.watches import WAIVERS
from flexmb.tables.features import asking
from flexmb.tables.state import State
from flexmb.typing import Flags

PLACES = 12  # in a run: what is open depends on the position, but is the same nearly everywhere
STEPS = 100_000  # of the run that gives the states: one that needs more is judged by what it reached
Held = NDArray[np.bool_]


def undetermined(scene: Scene, t_end: float | None = None) -> Openness:
    """The components of loads and drive loads that are open at the start, or at any time until `t_end` (s).

    Where all loads are determined at the start and no event holds or releases anything, they are determined
    everywhere but at single instants: rows that are independent somewhere are so nearly everywhere.
    """
    if not scene.constraints:
        return Openness()
    with asking("general"):
        try:
            found = _open(scene)
        except NotImplementedError:  # the dense route has no bodies of Standard Input Data
            return _by_flexmb(scene)
        if t_end is not None and (found or _holds(scene)):
            found |= _open_in_run(scene, t_end)
    return found


def _by_flexmb(scene: Scene) -> Openness:
    """What flexmb itself finds open at the start, for scenes that the dense route refuses."""
    system = compile(scene)
    state = system.initial_state
    evaluation = system.evaluate(state.t, state.q, state.u)
    flags = {name: np.isnan(load) for name, load in evaluation.loads.items()}
    totals = {
        total.name: np.isnan(system.total_load(state, total.joints, total.body, about=(total.body, total.node)))
        for total in scene.total_loads
    }
    return _openness(flags, totals, {name: np.isnan(drive) for name, drive in evaluation.drives.items()})


def _open(scene: Scene) -> Openness:
    """At the start; the initial values themselves where flexmb cannot close the scene's closures."""
    try:
        state = compile(scene).initial_state
    except (ClosureError, NotImplementedError):
        state = System(scene).initial_state
    dense = DenseSystem(scene)
    return _at(dense, state, _prescribed(dense))


def _open_in_run(scene: Scene, t_end: float) -> Openness:
    """At some times of flexmb's run, and after each of its events."""
    try:
        allowed = structs.replace(scene, allow=(*scene.allow, *WAIVERS))
        run = simulate(allowed, t_end, samples=PLACES, rtol=1e-8, atol=1e-10, max_steps=STEPS)
    except (ClosureError, NotImplementedError):
        return Openness()
    unknown = Openness()
    for dense, state, held in _states(DenseSystem(scene), run):
        unknown |= _at(dense, state, held)
    return unknown


def _states(dense: DenseSystem, run: Trajectory) -> Iterator[tuple[DenseSystem, State, Held]]:
    """States of a run, with the closures that are closed and the speeds that are held there."""
    held, rest = _prescribed(dense), list(run.events)
    for sample in range(len(run.t)):
        while rest and rest[0].t <= run.t[sample]:
            held = _held_after(dense, held, rest[0].name, rest[0].after)
            dense = _joined_after(dense, rest[0].name)
            yield dense, rest.pop(0).after, held
        yield dense, run.state_at(sample), held


def _joined_after(dense: DenseSystem, name: str) -> DenseSystem:
    """The system with the closures open and closed as an event of this name leaves them."""
    scene = dense.scene
    actions = [action for event in scene.events if event.name == name for action in event.actions]
    now = {action.closure: isinstance(action, Dock) for action in actions if isinstance(action, Separate | Dock)}
    if not now:
        return dense
    closures = tuple(structs.replace(each, closed=now.get(each.name, each.closed)) for each in scene.closures)
    return DenseSystem(structs.replace(scene, closures=closures))


def _held_after(dense: DenseSystem, held: Held, name: str, after: State) -> Held:
    """The speeds that are held after an event; a coordinate that rests on a stop has no speed."""
    held, place = held.copy(), _places(dense)
    for event in dense.scene.events:
        for action in event.actions if name in (event.name, leaving(event)) else ():
            match action:
                case Latch():
                    held[place[action.coordinate]] = True
                case Release():
                    held[place[action.coordinate]] = False
                case Impact():
                    if action.rests:
                        stands = after.u[place[action.coordinate]] == 0.0
                        held[place[action.coordinate]] = stands and name == event.name
                case Change() | Separate() | Dock() | EndRun():
                    pass
                case _:
                    assert_never(action)
    return held


def _holds(scene: Scene) -> bool:
    """Whether any event changes which coordinates are held or which closures are closed."""
    return any(
        isinstance(action, Latch | Release | Separate | Dock) or (isinstance(action, Impact) and action.rests)
        for event in scene.events
        for action in event.actions
    )


def _places(dense: DenseSystem) -> dict[str, int]:
    """The number of the speed of each scalar coordinate, by the names that events use."""
    scene = dense.scene
    names = {item.name: [name for name, _ in coordinates(item)] for item in (*scene.hinges, *scene.point_masses)}
    names |= {wheel.name: ["angle"] for wheel in scene.wheels}
    taken = {owner: iter(own) for owner, own in names.items()}
    return {f"{x.owner}.{next(taken[x.owner])}": x.u for x in dense.tree.scalars}


def _prescribed(dense: DenseSystem) -> Held:
    held = np.zeros(dense.nu, dtype=bool)
    held[[x.u for x in dense.tree.scalars if x.prescribed is not None]] = True
    return held


def _at(dense: DenseSystem, state: State, held: Held) -> Openness:
    """What is open at a state. Of a drive whose coordinates are not always held all components count as open."""
    found, always = open_loads(dense, state.q, held), _prescribed(dense)
    sometimes = {x.owner for x in dense.tree.scalars if held[x.u] and not always[x.u]}
    drives = {name: flags | (name in sometimes and np.any(flags)) for name, flags in found.drives.items()}
    return _openness(found.loads, found.total_loads, drives)


def _openness(loads: Mapping[str, Flags], totals: Mapping[str, Flags], drives: Mapping[str, Flags]) -> Openness:
    """From flags (6,) of loads and their sums and (k,) of drive loads, by name."""
    parts = (
        (f"{kind}:{name}.{part}", flags[at])
        for kind, group in (("load", loads), ("total_load", totals))
        for name, flags in group.items()
        for part, at in LOAD_PARTS.items()
    )
    return Openness.of_flags(chain(parts, ((f"drive:{name}", flags) for name, flags in drives.items())))
