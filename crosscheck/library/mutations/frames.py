"""Mutations of frames: positions and rotations of nodes, of hinges and of closures."""

from __future__ import annotations

from msgspec.structs import replace

from crosscheck.library.case import CaseError
from crosscheck.library.mutations.edits import (
    AnyNode,
    closures,
    conjugated,
    hinges,
    more,
    nodes,
    of_closure,
    of_hinge,
    of_node,
    scaled,
)
from crosscheck.library.mutations.mutation import LESS, Mutation
from flexmb.scene.bodies import BeamNode, Quaternion
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.hinges import Closure, Hinge
from flexmb.scene.schema import Load, Marker, PointMass, Scene, TotalLoad, Wheel
from flexmb.scene.tree import ends

Mounted = Wheel | PointMass | Load | Marker | TotalLoad
EPS = 1e-15


@of_hinge
def _hinge_rotation(hinge: Hinge) -> Hinge:
    return conjugated(hinge, "parent_quaternion", "child_quaternion")


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


@of_node
def _node_rotation(node: AnyNode) -> AnyNode:
    return conjugated(node, "quaternion")


@of_node
def _node_position(node: AnyNode) -> AnyNode:
    if isinstance(node, BeamNode):
        return replace(node, x_m=LESS * node.x_m)  # inwards, where the beam is
    return replace(node, position_m=scaled(node.position_m))


def _node_idle(scene: Scene, target: str) -> str:
    """Nothing is at the node: no hinge, closure, connector, wheel, mass, load or marker, nor any sum of loads."""
    body, _, node = target.rpartition(".")
    shown: tuple[Mounted, ...] = (*scene.markers, *scene.total_loads)
    mounted: tuple[Mounted, ...] = (*scene.wheels, *scene.point_masses, *scene.loads, *shown)
    used = [(item.body, item.node) for item in mounted]
    used += [
        end for hinge in scene.hinges for end in ((hinge.parent, hinge.parent_node), (hinge.child, hinge.child_node))
    ]
    between = [*scene.closures, *(connector for connector in scene.connectors if isinstance(connector, BetweenNodes))]
    used += [(end.body, end.node) for connector in between for end in ends(connector)]
    return "" if (body, node) in used else "nothing is mounted at the node, and no marker shows it"


@of_closure
def _closure_frame(closure: Closure) -> Closure:
    if closure.type == "spherical":
        raise CaseError(f'closure "{closure.name}" is spherical: its frames have no directions')
    return conjugated(closure, "quaternion_a", "quaternion_b")


MUTATIONS = (
    Mutation(
        "hinge_rotation",
        "transposed rotations between the hinge's frames and its nodes",
        "a matrix from A to B taken for that from B to A",
        hinges,
        _hinge_rotation,
        _hinge_idle,
    ),
    Mutation(
        "hinge_position",
        "+1 % offsets of the hinge from its nodes",
        "a wrong figure",
        hinges,
        more(of_hinge, "parent_position_m", "child_position_m"),
    ),
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
        "closure_position",
        "+1 % offsets of a closure from its nodes",
        "a wrong figure",
        closures,
        more(of_closure, "position_a_m", "position_b_m"),
    ),
)
