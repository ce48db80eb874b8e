"""A mutation: a deliberate fault of a scene, its targets, and the slip that it represents."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple

from crosscheck.library.case import MutationKind
from flexmb.scene.schema import Scene

FACTOR = 1.01
LESS = 2.0 - FACTOR  # for numbers that cannot be increased
HUNDREDTH = 0.01
DROPPED, OPPOSITE = 0.0, -1.0

SceneChange = Callable[[Scene, str], Scene]
"""The scene with a fault in the item that has a name, \"\" for the scene itself."""


class MutationTarget(NamedTuple):
    """An item that a mutation may change: its name, "" for the scene, and its kind.

    Codes treat targets of one kind alike: a campaign tries one of each kind.
    """

    name: str
    kind: str


def _never(scene: Scene, target: str) -> str:
    return ""


@dataclass(frozen=True)
class Mutation:
    """One deliberate fault.

    `what` it does and the `slip` that it represents are shown to readers. `targets` are the candidates of a scene, of
    which `change` refuses by CaseError those that cannot have the fault. `idle` says why a change of the
    data does not change motion, loads and energies, "" if it does: such a mutant does not count.
    """

    name: MutationKind
    what: str
    slip: str
    targets: Callable[[Scene], Iterable[MutationTarget]]
    change: SceneChange
    idle: Callable[[Scene, str], str] = _never
