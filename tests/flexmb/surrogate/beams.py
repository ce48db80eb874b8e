"""Beams with something on them, for whoever takes them apart."""

import numpy as np

from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant
from flexmb.scene.schema import BeamStation, Modes
from flexmb.scene.tree import node_frame, ordered

LENGTH = 2.0
SECTION = BeamStation(
    x_m=0.0, EA_N=1e5, EIy_Nm2=30.0, EIz_Nm2=12.0, GJ_Nm2=9.0, mass_per_length_kg_m=0.7,
    rotary_y_kg_m=1e-4, rotary_z_kg_m=2e-4,
)  # fmt: skip
LUMP = ((2e-3, 0.0, 0.0), (0.0, 3e-3, 0.0), (0.0, 0.0, 4e-3))
FIRST_ROOT = 1.8751040687119611  # of cos x cosh x = -1


def beam_scene(families=("bending_y",), child_node="root", boundary="clamped-free", damping=0.0, **beam):
    """A beam on a weld with a panel hinged to a node in the middle, a wheel, a load and a marker at the tip."""
    modes = Modes(count=2, families=families, boundary=boundary, damping_ratio=damping)
    section = {"section": SECTION} | beam
    return (
        SceneBuilder("beam", gravity=(0.0, -9.81, 0.0))
        .beam("boom", length=LENGTH, elements=8, modes=modes, nodes={"middle": 0.9}, **section)
        .rigid_body("panel", mass=0.4, com=(0.2, 0.0, 0.0), inertia=(0.01, 0.02, 0.02))
        .weld("root", "ground", "boom", child_node=child_node)
        .revolute("panel hinge", "boom", "panel", parent_node="middle", stiffness=2.0)
        .wheel("wheel", "boom", node="tip", axis=(0, 0, 1), mass=0.1, axial_inertia=0.01, transverse_inertia=0.006)
        .force("load", "boom", node="tip", direction=(0, 1, 0), function=Constant(value=1.0))
        .marker("tip", "boom", node="tip")
        .marker("middle", "boom", node="middle", offset=(0.0, 0.1, 0.0))
        .scene()
    )


def cantilever(families, points):
    """A uniform beam welded to the ground at its root."""
    modes = Modes(count=1, families=families)
    builder = SceneBuilder("cantilever")
    builder.beam("b", length=LENGTH, elements=8, section=SECTION, points=points, modes=modes)
    return builder.weld("w", "ground", "b")


def rest_positions(scene):
    """World position of every marker's node with all hinges at zero, by the tree's frames alone."""
    pose = {"ground": np.zeros(3)}
    for body, hinge in ordered(scene):
        inboard = pose[hinge.parent] + np.array(hinge.parent_position_m)
        if hinge.parent != "ground":
            parent = next(body for body in scene.bodies if body.name == hinge.parent)
            inboard = inboard + node_frame(parent, hinge.parent_node).position
        pose[body.name] = inboard - hinge.child_position_m - np.array(node_frame(body, hinge.child_node).position)
    bodies = {body.name: body for body in scene.bodies}
    return {
        marker.name: pose[marker.body] + node_frame(bodies[marker.body], marker.node).position + marker.offset_m
        for marker in scene.markers
    }
