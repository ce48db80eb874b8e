"""The watches of accuracy: whether motions went beyond what points, polynomials and levels of fidelity can describe.

A watch is declared once, in WATCHES, with the word of a scene's `allow` that waives it. Whatever answers a question
about a motion has the states of its answer looked at here: runs and their batches, equilibria and paths of them, steady
spins, linear models, Campbell diagrams, and `check_scene` at the start. Whether loads would stretch what is held needs
loads, which runs, equilibria, spins and linear models have.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from flexmb.scene.bodies import BeamBody
from flexmb.scene.problems import Doubt, Place, SceneWarning
from flexmb.scene.schema import Waiver
from flexmb.system.section_loads import ExertedLoads, LoadsByName
from flexmb.system.system import System
from flexmb.tables.state import State
from flexmb.typing import Real

_NONE: Real = np.zeros((0, 0))
_NOTHING = np.zeros(0), _NONE, _NONE


class WatchedStates(NamedTuple):
    """States that are looked at: coordinates q (T,nq) and speeds u (T,nu) at t (T,) s.

    turns: angular velocities (N,3) rad/s of the bodies in a state, by its number. failed: whether a run ended early,
    which may have diverged. exerted: loads (T,6) by name, as of a trajectory; None where they were not asked for.
    fastest: further states of a run, at ends of its steps, see `flexmb.run.propagate.Raw`. turned: what the watch of
    levels says, if it has looked at every step while a batch ran.
    """

    system: System
    t: Real
    q: Real
    u: Real
    turns: Callable[[int], Real]
    failed: bool = False
    exerted: ExertedLoads | None = None
    fastest: Real = _NONE
    turned: Sequence[AccuracyFinding] | None = None

    def with_steps(self) -> tuple[Real, Real, Real]:
        """t, q and u of all states, those at ends of steps last."""
        more, nq = self.fastest, self.system.nq
        if not len(more):
            return self.t, self.q, self.u
        return (
            np.concatenate([self.t, more[:, 0]]),
            np.concatenate([self.q, more[:, 1 : 1 + nq]]),
            np.concatenate([self.u, more[:, 1 + nq :]]),
        )


class AccuracyFinding(Protocol):
    """What a watch says of a body, and the remedy, with the number to set."""

    @property
    def body(self) -> str: ...

    @property
    def size(self) -> float:
        """How bad it is, beside other findings of one watch."""
        ...

    @property
    def what(self) -> str: ...

    @property
    def remedy(self) -> str: ...


class Said(NamedTuple):
    """A finding of a watch, with the word that waives it."""

    finding: AccuracyFinding
    waiver: Waiver

    def __str__(self) -> str:
        return f"{self.finding.what}; {self.finding.remedy}"

    def doubt(self, place: Place) -> Doubt:
        """As a doubt about the body's place in a scene."""
        return Doubt(str(place), self.finding.what, self.finding.remedy, self.waiver)


def _level_range(seen: WatchedStates) -> Iterator[AccuracyFinding]:
    if seen.turned is not None:
        return iter(seen.turned)
    from flexmb.system.level_range import too_fast  # imported here because many scenes have no flexible bodies

    (t, q, u), system = seen.with_steps(), seen.system

    def turns(n: int) -> Real:
        return seen.turns(n) if n < len(seen.t) else system.turns(float(t[n]), q[n], u[n])

    return too_fast(system, t, u, turns)


def _few_points(seen: WatchedStates) -> Iterator[AccuracyFinding]:
    from flexmb.system.enough_points import unfollowed  # imported here because few scenes have such beams

    t, q, _ = seen.with_steps()
    return unfollowed(seen.system, t, q)


def _few_polynomials(seen: WatchedStates) -> Iterator[AccuracyFinding]:
    from flexmb.system.enough_polynomials import unresolved  # imported here because few scenes have such beams

    t, q, _ = seen.with_steps()
    return unresolved(seen.system, t, q)


def _held_stretch(seen: WatchedStates) -> Iterator[AccuracyFinding]:
    from flexmb.system.held_stretch import unstretched  # imported here because few scenes have such beams

    at = seen.exerted
    return unstretched(seen.system, seen.t, seen.q, seen.u, at.loads) if at is not None else iter(())


def _few_modes(seen: WatchedStates) -> Iterator[AccuracyFinding]:
    from flexmb.system.few_modes import left_out  # imported here because many scenes have no flexible bodies

    return left_out(seen.system, seen.t, seen.q, seen.u, seen.exerted)


class _Watch(NamedTuple):
    waiver: Waiver
    look: Callable[[WatchedStates], Iterator[AccuracyFinding]]
    strains: bool = False  # whether it looks at strains of level exact, which say nothing once a run has diverged


WATCHES = (
    _Watch("level_range", _level_range),
    _Watch("few_modes", _few_modes),
    _Watch("few_points", _few_points, strains=True),
    _Watch("few_polynomials", _few_polynomials, strains=True),
    _Watch("held_stretch", _held_stretch, strains=True),
)

WAIVERS: tuple[Waiver, ...] = tuple(watch.waiver for watch in WATCHES)
"""For scenes whose levels, points and polynomials are compared with one another."""


class StatesToKeep(NamedTuple):
    """Weights (G,nq+nu) of the sizes of coordinates and speeds in a sum of turns and, where there are beams of level
    exact, one of strains; where a sum is below `slow` (G,), there is nothing to say of its kind."""

    weights: Real
    slow: Real


def states_to_keep(system: System) -> StatesToKeep | None:
    """By which states at ends of steps the watches look at a run; None if at none."""
    if all(link.is_rigid for link in system.links):
        return None
    sums = 2 if len(system.constants.section) else 1
    found = StatesToKeep(np.zeros((sums, system.nq + system.nu)), np.full(sums, np.inf))
    if "level_range" not in system.scene.allow:
        from flexmb.system.level_range import weights  # imported here because many scenes have no flexible bodies

        found.weights[0, system.nq :] = weights(system)
    if sums == 2 and not {"few_points", "few_polynomials"} <= set(system.scene.allow):
        found.weights[1] = _of_strains(system)
    found.slow[found.weights.any(axis=1)] = 1.0
    return found if found.weights.any() else None


def _of_strains(system: System) -> Real:
    """The weights (nq+nu,) of strains; kept."""
    from flexmb.system import enough_points, enough_polynomials  # imported here because few scenes have such beams

    found: Real | None = system.kept.get("weights of strains")
    if found is None:
        bodies = {body.name: body for body in system.scene.bodies if isinstance(body, BeamBody)}
        found = np.zeros(system.nq + system.nu)
        for link in system.links:
            if link.name in bodies and not link.is_rigid and (field := link.model.field) is not None:
                own = enough_points.weights(field)
                if field.columns is not None:
                    own = np.maximum(own, enough_polynomials.weights(bodies[link.name], field))
                found[system.coordinate(f"{link.name}.modes")] = own
        found = system.kept.setdefault("weights of strains", found)
    return found


def said(seen: WatchedStates) -> list[Said]:
    """What all watches say that the scene does not waive."""
    system = seen.system
    if not len(seen.t) or system.is_rigid:
        return []
    skipped = seen.failed or not len(system.constants.section)
    return [
        Said(finding, watch.waiver)
        for watch in WATCHES
        if watch.waiver not in system.scene.allow and not (watch.strains and skipped)
        for finding in watch.look(seen)
    ]


def of_states(system: System, states: Sequence[State], turns: Callable[[int], Real] | None = None) -> WatchedStates:
    """States of a system that are no samples of a run; turns: see `WatchedStates`, by the functions of time of the
    system if left out. None are looked at where all bodies are rigid."""
    states = () if system.is_rigid else states
    t, q, u = (np.array([getattr(state, key) for state in states]) for key in ("t", "q", "u")) if states else _NOTHING
    loads = _exerted(system, states) if len(system.constants.section) and not system.scene.controllers else None
    return WatchedStates(system, t, q, u, turns or (lambda n: system.turns(float(t[n]), q[n], u[n])), exerted=loads)


def _exerted(system: System, states: Sequence[State]) -> LoadsByName:
    """Loads (T,6) in the states."""
    at = [system.evaluate(state.t, state.q, state.u) for state in states]
    kinds = [[getattr(each, kind) for each in at] for kind in LoadsByName._fields]
    return LoadsByName(*({name: np.array([loads[name] for loads in each]) for name in each[0]} for each in kinds))


def warn(seen: WatchedStates, stacklevel: int = 3) -> None:
    """A SceneWarning for each finding, for the caller of the calling function."""
    for finding in said(seen):
        warnings.warn(f'scene "{seen.system.scene.name}": {finding}', SceneWarning, stacklevel=stacklevel)
