"""The record of an event that happened in a run."""

from __future__ import annotations

from dataclasses import dataclass, field

from flexmb.tables.brief import brief
from flexmb.tables.state import State
from flexmb.typing import Real


@dataclass(frozen=True)
class EventRecord:
    """An event that happened at t (s).

    impulses: by coordinate, the impulse of its hinge or wheel along it (N s or N m s), also of coordinates that are
    held. energy_change (J) is included in the work of the trajectory. before, after: the states. closures: by closure,
    its impulse (6,) [N m s; N s] on body_b about frame B, World axes. Impulses that redundant closures leave
    undetermined are NaN. early (s): how long before its instant the event happened; it is not zero only if the instant
    lies near a singular position of a closed chain.
    """

    name: str
    t: float
    impulses: dict[str, float]
    energy_change: float
    before: State
    after: State
    closures: dict[str, Real] = field(default_factory=dict)
    early: float = 0.0

    __repr__ = brief
