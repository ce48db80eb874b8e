"""Mutations of couplings: of their ratios and offsets."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec.structs import replace

from crosscheck.library.mutations.edits import of_coupling
from crosscheck.library.mutations.mutation import FACTOR, OPPOSITE, Mutation, MutationTarget, SceneChange
from flexmb.scene.schema import Coupling, Scene
from flexmb.scene.tree import coupled


def couplings(scene: Scene) -> Iterator[MutationTarget]:
    """All couplings; those between angles, between displacements and of both are separate kinds."""
    for coupling in scene.couplings:
        angular = {related.named.coordinate.ANGULAR for related in coupled(scene, coupling)}
        what = "of both" if len(angular) > 1 else "of angles" if True in angular else "of displacements"
        yield MutationTarget(coupling.name, f"coupling {what}")


def _ratios(factor: float) -> SceneChange:
    @of_coupling
    def scaled(coupling: Coupling) -> Coupling:
        return replace(coupling, terms=tuple(replace(term, ratio=factor * term.ratio) for term in coupling.terms))

    return scaled


@of_coupling
def _offset(coupling: Coupling) -> Coupling:
    return replace(coupling, offset=FACTOR * coupling.offset)


MUTATIONS = (
    Mutation("coupling_ratio", "+1 % ratios of a coupling", "a wrong figure", couplings, _ratios(FACTOR)),
    Mutation(
        "coupling_sign",
        "opposite ratios of a coupling",
        "outer teeth for inner ones, a crossed belt for an open one",
        couplings,
        _ratios(OPPOSITE),
    ),
    Mutation("coupling_offset", "+1 % offset of a coupling", "a wrong figure", couplings, _offset),
)
