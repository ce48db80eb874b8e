"""Mutations of external loads."""

from __future__ import annotations

from msgspec.structs import replace

from crosscheck.library.case import CaseError
from crosscheck.library.mutations.edits import loads, of_load, opposite
from crosscheck.library.mutations.mirror import X, along, mirrors
from crosscheck.library.mutations.mutation import Mutation
from crosscheck.library.mutations.resting import is_clamped_along_world, twists_only
from flexmb.scene.bodies import SidBody
from flexmb.scene.schema import Load, Scene
from flexmb.scene.tree import rest_frames


@of_load
def _sign(load: Load) -> Load:
    return replace(load, direction=opposite(load.direction))


@of_load
def _frame(load: Load) -> Load:
    return replace(load, frame="node" if load.frame == "world" else "world")


def _point(scene: Scene, target: str) -> Scene:
    """At the first other place of the body: the origin, or one of its nodes where the load acts at the origin."""

    def moved(load: Load) -> Load:
        body = next(body for body in scene.bodies if body.name == load.body)
        if isinstance(body, SidBody):
            raise CaseError(f'body "{body.name}" keeps its nodes in a file: "load_point" needs them inline')
        frames = rest_frames(body)
        here = frames[load.node].position
        other = [name for name, frame in frames.items() if frame.position != here]
        if load.type == "torque" or not other:
            raise CaseError(f'load "{load.name}" is a torque or has no other place on "{body.name}"')
        return replace(load, node="origin" if "origin" in other else other[0])

    return of_load(moved)(scene, target)


def _turns_about_it(scene: Scene, target: str) -> str:
    """A torque about the only axis that its body turns about: by symmetry, or as a clamped bar that only twists."""
    load = next(load for load in scene.loads if load.name == target)
    body = next(body for body in scene.bodies if body.name == load.body)
    twisted = twists_only(body) and is_clamped_along_world(scene, body.name) and along(load.direction, X)
    mirrored = any(along(load.direction, axis) for axis in mirrors(scene))
    if load.type == "torque" and (mirrored or twisted):
        return "the body turns about the torque's axis only, which is the same in World and in the node's axes"
    return ""


MUTATIONS = (
    Mutation("load_sign", "opposite load", "action taken for reaction", loads, _sign),
    Mutation("load_point", "force at another point of its body", "another reference point", loads, _point),
    Mutation(
        "load_frame",
        "load in World axes instead of the node's, or the other way",
        "dead load taken for follower load",
        loads,
        _frame,
        _turns_about_it,
    ),
)
