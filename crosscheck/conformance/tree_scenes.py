"""Scenes of the clauses on trees: an inner body with a child of a child, branches, turned and shifted hinge frames.

Nothing is where it would go unnoticed: mass centres are off the hinges, inertias have products, axes are oblique, every
hinge has an offset and a turn on both sides, and all bodies differ.
"""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from flexmb.scene.build import SceneBuilder, angular
from flexmb.scene.collecting import make
from flexmb.scene.functions import Constant, Sine
from flexmb.scene.modal_data import inertia_points
from flexmb.scene.schema import ModalNode, Node, Scene

FIELD = (3.0, -4.0, -7.0)  # m/s^2
AXES = ((2 / 3, -1 / 3, 2 / 3), (0.6, 0.0, 0.8), (-2 / 7, 3 / 7, 6 / 7))
PARTS = ("base", "middle", "end", "twig")
"""The bodies of the tree: the end hangs on the middle, the middle and the twig on the base."""
_TURNS = ((0.8, 0.0, 0.6, 0.0), (0.5, 0.5, -0.5, 0.5), (0.6, 0.8, 0.0, 0.0), (2 / 3, -1 / 3, 0.0, 2 / 3))
_MASSES = (2.0, 1.3, 0.7, 0.9)
_CENTRES = ((0.2, -0.1, 0.3), (-0.15, 0.25, 0.1), (0.3, 0.1, -0.2), (0.1, 0.2, 0.15))
_MOMENTS = (
    ((0.30, 0.02, -0.03), (0.02, 0.40, 0.05), (-0.03, 0.05, 0.35)),
    ((0.12, -0.01, 0.02), (-0.01, 0.15, 0.03), (0.02, 0.03, 0.20)),
    ((0.08, 0.01, 0.015), (0.01, 0.05, -0.01), (0.015, -0.01, 0.07)),
    ((0.10, 0.02, 0.01), (0.02, 0.09, -0.02), (0.01, -0.02, 0.06)),
)
_PORT: Any = {"position": (0.4, -0.3, 0.2), "quaternion": (0.6, 0.0, 0.0, 0.8)}


def body(tree: SceneBuilder, name: str) -> SceneBuilder:
    """One of the bodies: with a turned node "port" for what hangs on it, and a marker off the node."""
    n = PARTS.index(name)
    port = make(Node, name="port", **_PORT)
    tree.rigid_body(name, mass=_MASSES[n], com=_CENTRES[n], inertia=_MOMENTS[n], nodes=[port])
    return tree.marker(name, name, node="port", offset=(0.1, 0.2, -0.15))


def placed(name: str, parent: str) -> dict[str, Any]:
    """The frames of a hinge: offset and turned on both sides, on the parent's port unless it is the ground."""
    n = PARTS.index(name)
    placement: dict[str, Any] = {
        "parent_position": (0.1 * n - 0.2, 0.3, -0.1 * n), "parent_quaternion": _TURNS[n],
        "child_position": (-0.1, 0.05 * n + 0.1, 0.2), "child_quaternion": _TURNS[3 - n],
    }  # fmt: skip
    return placement | ({} if parent == "ground" else {"parent_node": "port"})


def revolute(tree: SceneBuilder, name: str, parent: str, **more: Any) -> SceneBuilder:
    """A hinge of its own kind for each body: axis, angle and rate differ."""
    n = PARTS.index(name)
    motion = {"angle": (0.4, -0.7, 1.1, 0.6)[n], "rate": (1.5, -2.0, 2.5, 0.8)[n]} | more
    return tree.revolute(f"to {name}", parent, name, axis=AXES[n % 3], **motion, **placed(name, parent))


def chain(last: bool = True, gravity: tuple[float, float, float] = FIELD) -> SceneBuilder:
    """Three bodies in a row on revolute hinges, or two if the `last` is to hang on something else."""
    tree = body(SceneBuilder("chain", gravity=gravity), "base")
    tree = revolute(revolute(body(tree, "middle"), "base", "ground"), "middle", "base")
    return revolute(body(tree, "end"), "end", "middle") if last else body(tree, "end")


def branched() -> SceneBuilder:
    """The chain, and a fourth body on its first."""
    return revolute(body(chain(), "twig"), "twig", "base")


def out_of_order() -> Scene:
    """The branched tree with bodies from the tips to the base, and hinges and markers in other orders than those."""
    tree = branched().scene()
    bodies, hinges, markers = tree.bodies, tree.hinges, tree.markers
    return replace(
        tree, bodies=tuple(bodies[n] for n in (2, 3, 1, 0)), hinges=tuple(hinges[n] for n in (1, 3, 2, 0)),
        markers=tuple(markers[n] for n in (3, 0, 2, 1)),
    )  # fmt: skip


def driven(tree: SceneBuilder) -> Scene:
    """A chain with its second hinge prescribed, beside a spring."""
    wave = Sine(amplitude=0.5, angular_frequency_rad_s=3.0, phase_rad=0.8)
    moved, scene = angular(prescribed=wave, stiffness=2.0), tree.scene()
    hinges = [replace(hinge, rotation=moved) if hinge.name == "to middle" else hinge for hinge in scene.hinges]
    return replace(scene, hinges=tuple(hinges))


def loaded(tree: SceneBuilder) -> SceneBuilder:
    """A force in World axes on the inner body, one in node axes on the last, torques on the first and the inner one."""
    wave = Sine(amplitude=5.0, angular_frequency_rad_s=4.0, phase_rad=0.9)
    return (
        tree.force("push", "middle", node="port", direction=(0.0, 0.6, 0.8), function=Constant(value=5.0))
        .force("jet", "end", node="port", direction=(0.6, 0.8, 0.0), function=wave, frame="node")
        .torque("turn", "base", node="port", direction=(1.0, 0.0, 0.0), function=Constant(value=-3.0))
        .torque("twist", "middle", direction=(0.0, 1.0, 0.0), function=Constant(value=1.7), frame="node")
    )


def sprung() -> SceneBuilder:
    """The chain with a spring, a damper and a motor that changes with time at its last hinge."""
    turn = Sine(amplitude=3.0, angular_frequency_rad_s=4.0, phase_rad=0.3)
    own: dict[str, Any] = {"stiffness": 6.0, "damping": 0.4, "rest": 0.3, "torque": turn}
    return chain(last=False).revolute(
        "to end", "middle", "end", axis=AXES[2], angle=1.1, rate=2.5, **own, **placed("end", "middle")
    )


def working() -> Scene:
    """All that does work: loads at nodes and a prescribed hinge beside a spring, a damper and a motor."""
    return driven(loaded(sprung()))


def bending() -> SceneBuilder:
    """The chain with a flexible body in its middle: two modes that bend it in its x-y plane, deformed and in motion.

    The end hangs on a node that shifts and turns with both modes; the stiffness couples them.
    """
    x = (0.2, 0.5, 0.8, 1.0)
    shapes = [[[0.0, 0.0], [0.3 * a * a, a - 0.6 * a * a], [0.0, 0.0]] for a in x]  # by component, then by mode
    # Off a line, about which the body would have no inertia where it is straight.
    points = inertia_points([0.3, 0.5, 0.4, 0.2], [(a, 0.1 - 0.4 * a * (1.0 - a), -0.2 * a) for a in x], shapes)
    port = make(
        ModalNode, name="port", position=(1.0, 0.0, 0.1), quaternion=_PORT["quaternion"],
        translation_modes=[[-0.05, 0.3, 0.0], [0.02, 0.4, 0.0]], rotation_modes=[[0.0, 0.0, 0.6], [0.0, 0.0, -0.2]],
    )  # fmt: skip
    tree = body(SceneBuilder("bending", gravity=FIELD), "base").modal_body(
        "middle", points=points, nodes=[port], stiffness=[[30.0, 4.0], [4.0, 90.0]], damping=[[0.2, 0.05], [0.05, 0.3]]
    )
    tree.marker("middle", "middle", node="port", offset=(0.1, 0.2, -0.15))
    tree.modal_state("middle", coordinates=(0.15, -0.1), rates=(0.4, 0.9))
    return revolute(revolute(revolute(body(tree, "end"), "base", "ground"), "middle", "base"), "end", "middle")
