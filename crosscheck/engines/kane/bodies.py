"""What the equations need to know of each body, from the scene's data alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from crosscheck.engines.conventions import axes_with, rotation_matrix
from crosscheck.engines.kane.beam import BendingBeam
from crosscheck.engines.kane.frames import ShapedNode
from crosscheck.engines.kane.moments import moments_of_points, rigid_moments
from flexmb.scene.modal_data import modal_arrays
from flexmb.scene.schema import BeamBody, Body, ModalBody, RigidBody, Wheel
from flexmb.scene.tree import rest_frames
from flexmb.typing import Real


class KaneBody(NamedTuple):
    """Second moments of its mass (`kane.moments`), stiffness and damping (m, m), and its nodes."""

    moments: Real
    stiffness: Real
    damping: Real
    nodes: dict[str, ShapedNode]


def body_data(body: Body) -> KaneBody:
    """Of a body that `obstacle` of the engine has not refused; TypeError for another."""
    frames = {
        name: (np.array(frame.position), rotation_matrix(frame.quaternion)) for name, frame in rest_frames(body).items()
    }
    none = np.zeros((0, 0))
    if isinstance(body, RigidBody):
        moments = rigid_moments(body.mass_kg, np.array(body.com_m), np.array(body.inertia_kg_m2))
        return KaneBody(moments, none, none, {name: _still(*frame, 0) for name, frame in frames.items()})
    if isinstance(body, BeamBody):
        beam = BendingBeam(body)
        nodes = {
            name: ShapedNode(r, axes, *(shapes[0] for shapes in beam.deflections(r[:1])))
            for name, (r, axes) in frames.items()
        }
        return KaneBody(beam.moments(), beam.stiffness, np.zeros_like(beam.stiffness), nodes)
    if isinstance(body, ModalBody):
        arrays = modal_arrays(body)
        kept = 0 if body.level == "rigid" else arrays.translation_modes.shape[2]
        nodes = {name: _still(*frame, kept) for name, frame in frames.items()}
        for node in body.nodes:
            shapes = (
                np.array(shape, dtype=float).T[:, :kept] for shape in (node.translation_modes, node.rotation_modes)
            )
            nodes[node.name] = ShapedNode(*frames[node.name], *shapes)
        moments = moments_of_points(arrays.mass, arrays.position, arrays.translation_modes[:, :, :kept])
        return KaneBody(moments, arrays.stiffness[:kept, :kept], arrays.damping[:kept, :kept], nodes)
    raise TypeError(f'body "{body.name}" is of a kind that the engine refuses')


def wheel_data(wheel: Wheel) -> KaneBody:
    """A wheel as a body of its own: its origin at the centre, z along its axis."""
    a, t = wheel.axial_inertia_kg_m2, wheel.transverse_inertia_kg_m2
    moments = rigid_moments(wheel.mass_kg, np.zeros(3), np.diag([t, t, a]))
    none = np.zeros((0, 0))
    return KaneBody(moments, none, none, {"origin": _still(np.zeros(3), np.eye(3), 0)})


def about_z(axis: Real) -> Real:
    """Axes (3, 3) with z along a unit vector."""
    return axes_with(axis, 2)


def _still(position: Real, axes: Real, modes: int) -> ShapedNode:
    return ShapedNode(position, axes, np.zeros((3, modes)), np.zeros((3, modes)))
