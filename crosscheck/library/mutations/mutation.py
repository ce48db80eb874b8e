"""What a mutation is: a deliberate fault of a scene, where it applies, and which slip it stands for."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple

from crosscheck.library.case import MutationKind
from flexmb.scene.schema import Scene

FACTOR = 1.01
LESS = 2.0 - FACTOR  # where more is not possible
HUNDREDTH = 0.01
DROPPED, OPPOSITE = 0.0, -1.0


class MutationTarget(NamedTuple):
    """Something of a scene that a mutation may change: its name, "" for the scene, and what kind of thing it is.

    Two targets of one kind are changed by the same lines of a code: a campaign tries one of each kind.
    """

    name: str
    kind: str


def _never(scene: Scene, target: str) -> str:
    return ""


@dataclass(frozen=True)
class Mutation:
    """One deliberate fault.

    `what` it does and the `slip` that it stands for are shown to readers. `targets` are the candidates of a scene, of
    which `change` refuses by CaseError those that cannot have the fault. `idle` says by which physics a change of the
    data is no change of the motion, loads and energies, "" where it is one: such a mutant is none.
    """

    name: MutationKind
    what: str
    slip: str
    targets: Callable[[Scene], Iterable[MutationTarget]]
    change: Callable[[Scene, str], Scene]
    idle: Callable[[Scene, str], str] = _never
