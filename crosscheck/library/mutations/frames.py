"""Mutations of frames: positions and rotations of nodes, of hinges and of closures."""

from __future__ import annotations

import msgspec

from crosscheck.library.case import CaseError
from crosscheck.library.mutations.edits import (
    AnyNode,
    closures,
    conjugate,
    hinges,
    nodes,
    on_closure,
    on_hinge,
    on_node,
    scaled,
)
from crosscheck.library.mutations.mutation import LESS, Mutation
from flexmb.scene.bodies import BeamNode, Quaternion
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.hinges import Closure, Hinge
from flexmb.scene.schema import Load, Marker, PointMass, Scene, Wheel

Mounted = Wheel | PointMass | Load | Marker
EPS = 1e-15


def _hinge_rotation(scene: Scene, target: str) -> Scene:
    def transposed(hinge: Hinge) -> Hinge:
        return msgspec.structs.replace(
            hinge,
            parent_quaternion=conjugate(hinge.parent_quaternion),
            child_quaternion=conjugate(hinge.child_quaternion),
        )

    return on_hinge(scene, target, transposed)


def _half_turn(*quaternions: Quaternion) -> str:
    """A half-turn is its own inverse."""
    if all(abs(q[0]) <= EPS or max(map(abs, q[1:])) <= EPS for q in quaternions):
        return "a half-turn transposed is itself"
    return ""


def _hinge_idle(scene: Scene, target: str) -> str:
    hinge = next(hinge for hinge in scene.hinges if hinge.name == target)
    return _half_turn(hinge.parent_quaternion, hinge.child_quaternion)


def _closure_idle(scene: Scene, target: str) -> str:
    closure = next(closure for closure in scene.closures if closure.name == target)
    return _half_turn(closure.quaternion_a, closure.quaternion_b)


def _hinge_position(scene: Scene, target: str) -> Scene:
    def farther(hinge: Hinge) -> Hinge:
        return msgspec.structs.replace(
            hinge,
            parent_position_m=scaled(hinge.parent_position_m),
            child_position_m=scaled(hinge.child_position_m),
        )

    return on_hinge(scene, target, farther)


def _node_rotation(scene: Scene, target: str) -> Scene:
    def transposed(node: AnyNode) -> AnyNode:
        return msgspec.structs.replace(node, quaternion=conjugate(node.quaternion))

    return on_node(scene, target, transposed)


def _node_position(scene: Scene, target: str) -> Scene:
    def moved(node: AnyNode) -> AnyNode:
        if isinstance(node, BeamNode):
            return msgspec.structs.replace(node, x_m=LESS * node.x_m)  # inwards, where the beam is
        return msgspec.structs.replace(node, position_m=scaled(node.position_m))

    return on_node(scene, target, moved)


def _node_idle(scene: Scene, target: str) -> str:
    """Nothing is mounted at the node: neither a hinge, a closure, a connector, a wheel, a mass, a load nor a marker."""
    body, _, node = target.rpartition(".")
    mounted: tuple[Mounted, ...] = (*scene.wheels, *scene.point_masses, *scene.loads, *scene.markers)
    used = [(item.body, item.node) for item in mounted]
    used += [end for each in scene.hinges for end in ((each.parent, each.parent_node), (each.child, each.child_node))]
    between = [*scene.closures, *(each for each in scene.connectors if isinstance(each, BetweenNodes))]
    used += [end for each in between for end in ((each.body_a, each.node_a), (each.body_b, each.node_b))]
    return "" if (body, node) in used else "nothing is mounted at the node, and no marker shows it"


def _closure_frame(scene: Scene, target: str) -> Scene:
    def transposed(closure: Closure) -> Closure:
        if closure.type == "spherical":
            raise CaseError(f'closure "{closure.name}" is spherical: its frames have no directions')
        return msgspec.structs.replace(
            closure, quaternion_a=conjugate(closure.quaternion_a), quaternion_b=conjugate(closure.quaternion_b)
        )

    return on_closure(scene, target, transposed)


def _closure_position(scene: Scene, target: str) -> Scene:
    def moved(closure: Closure) -> Closure:
        return msgspec.structs.replace(
            closure, position_a_m=scaled(closure.position_a_m), position_b_m=scaled(closure.position_b_m)
        )

    return on_closure(scene, target, moved)


MUTATIONS = (
    Mutation(
        "hinge_rotation",
        "transposed rotations between the hinge's frames and its nodes",
        "a matrix from A to B taken for that from B to A",
        hinges,
        _hinge_rotation,
        _hinge_idle,
    ),
    Mutation("hinge_position", "+1 % offsets of the hinge from its nodes", "a wrong figure", hinges, _hinge_position),
    Mutation(
        "node_rotation",
        "transposed rotation of a node",
        "a matrix from A to B taken for that from B to A",
        nodes,
        _node_rotation,
        _node_idle,
    ),
    Mutation(
        "node_position",
        "+1 % distance of a node from the body's origin (-1 % along a beam)",
        "a wrong figure, or the wrong node",
        nodes,
        _node_position,
        _node_idle,
    ),
    Mutation(
        "closure_rotation",
        "transposed rotations between a closure's frames and its nodes",
        "a matrix from A to B taken for that from B to A",
        closures,
        _closure_frame,
        _closure_idle,
    ),
    Mutation(
        "closure_position", "+1 % offsets of a closure from its nodes", "a wrong figure", closures, _closure_position
    ),
)
