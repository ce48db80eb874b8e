"""The catalogue of mutations: deliberate faults of a scene that a comparison must notice.

Each represents an error of convention or a slip in the data; files group them by what they change. A mutation that
does not change the scene is refused, since it cannot be noticed.
"""

from __future__ import annotations

from crosscheck.library.case import CaseError, MutationKind
from crosscheck.library.mutations import (
    connectors,
    couplings,
    events,
    feedback,
    frames,
    gravity,
    hinges,
    inertia,
    loads,
    modes,
    time_courses,
    wheels,
)
from crosscheck.library.mutations.mutation import Mutation, MutationTarget
from flexmb.scene.schema import Scene

ROOMS = (
    inertia, frames, couplings, hinges, connectors, wheels, gravity, loads, modes, time_courses, feedback, events,
)  # fmt: skip
CATALOGUE: dict[MutationKind, Mutation] = {mutation.name: mutation for room in ROOMS for mutation in room.MUTATIONS}


def mutate(scene: Scene, mutation: MutationKind, target: str) -> Scene:
    """The scene with one deliberate fault; CaseError if there is no such target or nothing would change."""
    changed = CATALOGUE[mutation].change(scene, target)
    if changed == scene:
        raise CaseError(f'control "{mutation}" of "{target}" changes nothing in scene "{scene.name}": choose another')
    return changed


def applicable(scene: Scene, mutation: Mutation) -> list[MutationTarget]:
    """The targets of a scene that the mutation can change, including those without physical effect."""
    targets = []
    for target in mutation.targets(scene):
        try:
            mutate(scene, mutation.name, target.name)
        except CaseError:
            continue
        targets.append(target)
    return targets


__all__ = ["CATALOGUE", "Mutation", "MutationTarget", "applicable", "mutate"]
