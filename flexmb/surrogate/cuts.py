"""Beams of level "exact" whose pieces end where their strains jump."""

from __future__ import annotations

from msgspec.structs import replace

from flexmb.scene.pieces import across
from flexmb.scene.schema import BeamBody, BeamNode, Scene
from flexmb.surrogate.chain import beams_named


def cut_where_loaded(scene: Scene, body: str | None = None) -> Scene:
    """The scene with the beam `body` (all beams of level "exact" if None) cut where its strains jump.

    That is at nodes with a hinge, a closure, a connector, a load, a wheel or a point mass, at lumps, and where the
    section steps. A place without a node gets one, "cut_1" and so on. Each piece has as many polynomials as before,
    and `pieces` divides each of the new parts. `substructured` welds bodies instead, which costs less for many pieces.

    Raises ValueError for a body that is not a beam of level "exact", and for an initial modal state of a beam that is
    cut, whose coordinates are others then.
    """
    for beam in beams_named(scene, body):
        if beam.level == "exact":
            scene = _cut(scene, beam)
        elif body is not None:
            raise ValueError(f'beam "{body}" has level "{beam.level}", which has no pieces: make it "exact"')
    return scene


def _cut(scene: Scene, beam: BeamBody) -> Scene:
    nodes, cuts, found = list(beam.nodes), list(beam.modes.cuts or ()), across(scene, beam)
    for x in found:
        node = next((node for node in nodes if node.x_m == x), None)
        if node is None:
            taken = {node.name for node in nodes}
            name = next(name for i in range(1, len(nodes) + 2) if (name := f"cut_{i}") not in taken)
            node = BeamNode(name=name, x_m=x)
            nodes.append(node)
        cuts.append(node.name)
    if not found:
        return scene
    if any(state.body == beam.name for state in scene.modal_states):
        raise ValueError(f'beam "{beam.name}": its modal state is for other strains; cut it first, or leave that out')
    new = replace(beam, nodes=tuple(nodes), modes=replace(beam.modes, cuts=tuple(cuts)))
    return replace(scene, bodies=tuple(new if body is beam else body for body in scene.bodies))
