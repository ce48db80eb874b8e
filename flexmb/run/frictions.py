"""Which friction sticks and which slips at an instant of a run, and in which direction.

At an instant the speeds are known. Friction along a coordinate that moves slides in its direction. Of the coordinates
Z that are at rest, the loads f of friction and the accelerations a follow from each other,

    a = a0 + W f,    W = E M^-1 E' with what holds other coordinates and closures,

where a0 are the accelerations without friction along Z, E picks Z from the speeds and M is the mass matrix. Either a
coordinate sticks, a_i = 0 with |f_i| <= Fs_i, or it slips, f_i = -sign(a_i) Fc_i. All stick at first, except what an
event has found beyond its static friction. Then the one whose holding load is the furthest beyond is released in the
direction in which it is pushed, the loads are determined again, and what would slip against its direction is held
again, until nothing changes. If a set of phases comes up twice, the phases cannot be decided: DynamicsError.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flexmb.run.event_record import EventRecord
from flexmb.run.impulses import mobility
from flexmb.run.propagate import Raw
from flexmb.run.situation import Situation
from flexmb.scene.connectors import Phase
from flexmb.scene.sticking import DIRECTIONS, SLIPS, Sticking, sticking
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real

AT_REST = 2.0**-40  # fraction of the kinetic energy's root: what moves by less is at rest to rounding
IMMOVABLE = 2.0**-40  # relative: a coordinate with less mobility is held by others, and carries no friction
SIGNS: dict[Phase, int] = {phase: sign for sign, phase in DIRECTIONS.items()}


class Settled(NamedTuple):
    """What happened, and the names of friction whose phase is another one."""

    records: list[EventRecord]
    changed: set[str]


class Frictions:
    """The phases of all friction that sticks in a run."""

    def __init__(self, situation: Situation) -> None:
        self._situation = situation
        self._known: dict[str, Phase] = {each.name: each.connector.phase for each in sticking(situation.system.scene)}

    def settle(self, raw: Raw, y: Real, found: Collection[str]) -> Settled:
        """Decide all phases at the end of an integration, with y = [q, u, work], which changes in place only where a
        speed is at rest but for rounding. found: names of the events of friction that happened. DynamicsError if they
        cannot be decided."""
        situation, before, instant = self._situation, self._known, self._situation.instant(raw.t, y)
        frictions = [each for each in sticking(situation.system.scene) if not situation.holds_otherwise(each)]
        phases: dict[str, Phase] = dict.fromkeys(before, "idle")
        places = [situation.speed_place(each.coordinate) for each in frictions]
        speeds = y[places]
        phases |= {each.name: DIRECTIONS[int(np.sign(v))] for each, v in zip(frictions, speeds, strict=True) if v}
        situation.with_friction(phases, (), instant)
        resting: list[int] = []
        if frictions:
            W = mobility(situation.system, instant.t, y, [place - situation.system.nq for place in places])
            movable = np.diag(W.constrained) > IMMOVABLE * np.diag(W.free)
            at_rest = speeds**2 <= AT_REST**2 * np.diag(W.constrained) * W.energy
            phases |= {frictions[i].name: "idle" for i in np.flatnonzero(~movable)}
            resting = np.flatnonzero(movable & ((speeds == 0.0) | at_rest)).tolist()
        if resting:
            own = [frictions[i] for i in resting]
            phases |= dict.fromkeys((each.name for each in own), "idle")
            situation.with_friction(phases, (), instant)
            gained = situation.accelerations(raw, y)[[places[i] - situation.system.nq for i in resting]]
            forced = {i: way for i, each in enumerate(own) if (way := _forced(each.name, found))}
            decided = _decided(own, gained, W.constrained[np.ix_(resting, resting)], forced, instant.t)
            phases |= {each.name: phase for each, phase in zip(own, decided, strict=True)}
        held = [each for each in frictions if phases[each.name] == "sticking"]
        situation.with_friction(phases, held, instant)
        self._known = phases
        happened = [f"{name}: {_what(name, before[name], phases[name], found)}" for name in phases
                    if _what(name, before[name], phases[name], found)]  # fmt: skip
        changed = {name for name in phases if phases[name] != before[name]}
        return Settled(situation.recorded_of_friction(happened, instant), changed)


def _what(name: str, before: Phase, now: Phase, found: Collection[str]) -> str:
    """What happened to friction, in a word; "" if nothing that is an event."""
    if before in SIGNS and now == "sticking":
        return "sticks"
    if before == "sticking" and now in SIGNS:
        return "slips"
    return "reverses" if before in SIGNS and now in SIGNS and f"{name}: sticks" in found else ""


def _forced(name: str, found: Collection[str]) -> int:
    """The direction in which an event lets a coordinate slip; 0 if none does."""
    return sum(-sign for sign, what in SLIPS.items() if f"{name}: {what}" in found)


def _decided(own: Sequence[Sticking], a0: Real, W: Real, forced: Mapping[int, int], t: float) -> list[Phase]:
    """The phases of coordinates at rest, by the rule above. a0 (k,), W (k,k)."""
    scale = np.sqrt(np.diag(W))
    if np.linalg.eigvalsh(W / np.outer(scale, scale))[0] < IMMOVABLE:
        raise DynamicsError(
            f"at t = {t:g} s friction {_listed(own)} is at rest on coordinates that move together only: how they share "
            "the load is undetermined; let one of them stick, or give the others a smoothing speed"
        )
    most = np.array([each.breaks_at for each in own])
    sliding = np.array([each.at_zero for each in own])
    way, seen = np.zeros(len(own), int), set[tuple[int, ...]]()
    for i, sign in forced.items():
        way[i] = sign
    while tuple(way.tolist()) not in seen:
        seen.add(tuple(way.tolist()))
        load, stuck = -way * sliding, way == 0
        rest = a0 + W[:, ~stuck] @ load[~stuck]
        load[stuck] = -np.linalg.solve(W[np.ix_(stuck, stuck)], rest[stuck])
        accelerations = rest + W[:, stuck] @ load[stuck]
        back = np.where(stuck, 0.0, -way * accelerations / scale)
        beyond = np.where(stuck, np.abs(load) - most, -np.inf)
        if np.max(back) > 0.0:
            way[np.argmax(back)] = 0
        elif np.max(beyond) > 0.0:
            worst = int(np.argmax(beyond / np.where(most > 0.0, most, 1.0)))
            way[worst] = -int(np.sign(load[worst]))
        else:
            return [DIRECTIONS[int(sign)] if sign else "sticking" for sign in way]
    raise DynamicsError(
        f"at t = {t:g} s it cannot be decided which of the frictions {_listed(own)} stick and which slip, as their "
        "sliding friction is below the static one and no choice agrees with its loads: raise the sliding friction, or "
        "give one of them a smoothing speed"
    )


def _listed(own: Sequence[Sticking]) -> str:
    return " and ".join(f'"{each.name}"' for each in own)
