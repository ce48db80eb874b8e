"""What is recorded of an event that happened in a run."""

from __future__ import annotations

from dataclasses import dataclass, field

from flexmb.tables.state import State
from flexmb.typing import Real


@dataclass(frozen=True)
class EventRecord:
    """An event that happened at t (s).

    impulses: by coordinate, what its hinge or wheel exerted along it (N s or N m s), of held ones too; energy_change
    (J), which the work of the trajectory counts; before, after: the states. closures: by closure, what it exerted,
    (6,) [N m s; N s] on body_b about frame B, World axes. NaN what redundant closures leave open. early (s):
    by how much it happened before its instant, not zero only where that is at a singular position of a closed chain.
    """

    name: str
    t: float
    impulses: dict[str, float]
    energy_change: float
    before: State
    after: State
    closures: dict[str, Real] = field(default_factory=dict)
    early: float = 0.0
