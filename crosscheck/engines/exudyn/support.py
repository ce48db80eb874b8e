"""Which scenes Exudyn can represent, and how exactly."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import assert_never

from crosscheck.engines.exudyn.assembly import deforming, flexible
from crosscheck.engines.links import first_armature, first_screw
from flexmb.scene.hinges import Free
from flexmb.scene.modal_data import modal_arrays
from flexmb.scene.schema import BeamBody, Body, ModalBody, RigidBody, Scene, SidBody
from flexmb.scene.tree import GROUND, ends

NOT_WORKLESS = (
    "it hangs on a deforming node: Exudyn's marker averages mesh points there, and its joint is not workless "
    "(2e-5 to 8e-4 of the energy)"
)


def refusals(scene: Scene, floating: Sequence[Body]) -> Iterator[str]:
    """Why Exudyn cannot run a scene whose bodies `floating` are rigid or have floating frames."""
    for closure in scene.closures:
        if closure.body_b == GROUND:
            yield f'closure "{closure.name}": its load is read on body_b, which is the ground here: exchange a and b'
    for coupling in scene.couplings:
        yield f'coupling "{coupling.name}": bodies have coordinates of their own here, and hinges none to relate'
    screw = first_screw(scene)
    if screw:
        yield f'hinge "{screw}" is a screw: the adapter of Exudyn offers no such joint'
    armed = first_armature(scene)
    if armed:
        yield f'coordinate "{armed}" has an armature: the adapter of Exudyn offers none'
    bodies = {body.name: body for body in scene.bodies}
    for body in floating:
        yield from _body_refusals(body)
    for hinge in scene.hinges:
        if not isinstance(hinge, Free) and deforming(bodies[hinge.child], hinge.child_node):
            yield (
                f'hinge "{hinge.name}" holds body "{hinge.child}" at a node that deforms: a floating frame must not be '
                "clamped through its mesh; use modes clamped at the hinge"
            )


def _body_refusals(body: Body) -> Iterator[str]:
    match body:
        case SidBody():
            yield f'body "{body.name}": its SID file is read by flexmb alone: convert it by flexmb import'
        case RigidBody():
            return
        case BeamBody():
            if body.level == "exact":
                yield f'body "{body.name}" is of level "exact", and a floating frame has modes instead: use exudyn-beam'
            elif body.level != "rigid":
                yield f'body "{body.name}": expand the beam to raw points and modes first'
        case ModalBody() if body.level not in ("rigid", "full"):
            yield f'body "{body.name}": Exudyn\'s floating frame is of level "full", not "{body.level}"'
        case ModalBody(level="full"):
            arrays = modal_arrays(body)
            if arrays.inertia.any() or (arrays.com_offset.any() and arrays.rotation_modes.any()):
                yield (
                    f'body "{body.name}": its points have rotary inertia, which Exudyn\'s floating frame cannot turn; '
                    'use massy section points (points = "section")'
                )
            elif arrays.com_offset.any():
                yield f'body "{body.name}": put the points at their mass centres (com_offset_m = 0)'
        case ModalBody():
            return  # its modes are left out
        case _:
            assert_never(body)


def approximations(scene: Scene) -> Iterator[str]:
    """What Exudyn represents to a finite order only."""
    bodies = {body.name: body for body in scene.bodies}
    for hinge in scene.hinges:
        outboard_free = isinstance(hinge, Free)
        if hinge.parent != GROUND and not outboard_free and deforming(bodies[hinge.parent], hinge.parent_node):
            yield f'hinge "{hinge.name}": {NOT_WORKLESS}'
    for item in (*scene.wheels, *scene.point_masses):
        if deforming(bodies[item.body], item.node):
            yield f'"{item.name}": {NOT_WORKLESS}'
    for closure in scene.closures:
        if any(end.body != GROUND and deforming(bodies[end.body], end.node) for end in ends(closure)):
            yield f'closure "{closure.name}": {NOT_WORKLESS}'
    for load in scene.loads:
        turning = load.type == "torque" or load.frame == "node"
        if turning and flexible(bodies[load.body]) and deforming(bodies[load.body], load.node):
            yield f'load "{load.name}": Exudyn averages the rotation of a deforming node, to second order'
