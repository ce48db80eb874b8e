"""Where a beam is at t = 0, how it moves, what holds it, and what its elements are made of: no Kratos in it.

Kratos holds components of displacements and rotations. All is therefore in *model axes*: those of the inboard hinge
frame, turned so that z is what the hinge turns about; their origin is the hinge point at its rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

import numpy as np
from numpy.typing import ArrayLike

from crosscheck.engines.beam_elements import element_ends, shears
from crosscheck.engines.conventions import Frame, axes_with, cross, frame, rotation_matrix
from crosscheck.engines.functions_of_time import initial
from flexmb.scene.freedoms import ScalarFreedom
from flexmb.scene.hinges import Hinge, Planar, Revolute, Weld
from flexmb.scene.rest_curve import rest_sections
from flexmb.scene.schema import BeamBody, Scene
from flexmb.scene.sections import between_stations, inertia_on_axis, stiffness_on_axis
from flexmb.scene.tree import node_frame, nodes_along
from flexmb.typing import Real

HELD: dict[type[Hinge], tuple[int, ...]] = {Weld: (0, 1, 2, 3, 4, 5), Revolute: (0, 1, 2, 3, 4), Planar: (2, 3, 4)}
"""Of the displacements x, y, z and the rotations x, y, z of the node at the hinge, those that the hinge holds."""


@dataclass(frozen=True)
class Section:
    """Of one element: EA (N), GAy and GAz (N, 0 for a beam that does not shear), GJ, EIy, EIz (N m²), mass (kg/m) and
    rotary inertias about x, y and z (kg m)."""

    EA: float
    GAy: float
    GAz: float
    GJ: float
    EIy: float
    EIz: float
    mass: float
    rotary: tuple[float, float, float]


@dataclass(frozen=True)
class BeamLayout:
    """`world`: the model axes in World. `position` (n,3) m of the nodes, `velocity` (n,3) m/s and `spin` (3,) rad/s of
    the rigid motion at t = 0, `axes` (n-1,3,3) of the elements and `sections` (n-1) of them. `root` is the node at the
    hinge; `held` its held components, with the one of a prescribed rotation. `prescribed`: whether there is one.
    `body`: the beam's frame."""

    scene: Scene
    world: Frame
    body: Frame
    along: Real
    position: Real
    velocity: Real
    spin: Real
    axes: Real
    sections: tuple[Section, ...]
    root: int
    held: tuple[int, ...]
    prescribed: bool

    def node_at(self, name: str) -> int:
        """The number of the mesh's node at a node of the beam."""
        return int(np.argmin(np.abs(self.along - nodes_along(_beam(self.scene))[name])))

    def rest(self, name: str) -> Real:
        """Rotation (3,3) of a node of the beam at t = 0, node to model axes."""
        return self.body.rotation @ rotation_matrix(node_frame(_beam(self.scene), name).quaternion)

    def to_model(self, vector: ArrayLike) -> Real:
        """A vector (3,) in World axes."""
        return self.world.rotation.T @ np.asarray(vector, dtype=float)


def layout(scene: Scene) -> BeamLayout:
    """The beam of a scene that the engine takes."""
    beam, hinge = _beam(scene), scene.hinges[0]
    inboard = frame(hinge.parent_position_m, hinge.parent_quaternion)
    turning = [each.axis for each in hinge.freedoms if isinstance(each, ScalarFreedom) and each.turns]
    axis = np.array(turning[0] if turning else (0.0, 0.0, 1.0))
    turn = np.eye(3) if axis[2] == 1.0 else axes_with(axis, 2)
    moved, velocity, rate = _hinge_motion(hinge)
    outboard = frame(*node_frame(beam, hinge.child_node)) @ frame(hinge.child_position_m, hinge.child_quaternion)
    body = moved @ Frame(np.zeros(3), turn.T) @ outboard.inverse()
    x = element_ends(beam)
    middles = (x[1:] + x[:-1]) / 2.0
    position, _ = rest_sections(beam, x)
    position = body.position + position @ body.rotation.T
    spin = np.array([0.0, 0.0, rate])
    root = int(np.argmin(np.abs(x - nodes_along(beam)[hinge.child_node])))
    prescribed = isinstance(hinge, Revolute) and hinge.rotation.prescribed_rad is not None
    return BeamLayout(
        scene=scene, world=inboard @ Frame(np.zeros(3), turn), body=body, along=x, position=position,
        velocity=velocity + cross(spin, position - moved.position), spin=spin,
        axes=_axes(np.diff(position, axis=0), body.rotation @ rest_sections(beam, middles)[1]),
        sections=_sections(beam, middles), root=root, held=(*HELD[type(hinge)], *((5,) if prescribed else ())),
        prescribed=prescribed,
    )  # fmt: skip


def _beam(scene: Scene) -> BeamBody:
    beam = scene.bodies[0]
    assert isinstance(beam, BeamBody)
    return beam


def _hinge_motion(hinge: Hinge) -> tuple[Frame, Real, float]:
    """The outboard hinge frame at t = 0 in model axes, the velocity (3,) m/s of its origin and its rate about z."""
    place, velocity, angle, rate = np.zeros(3), np.zeros(3), 0.0, 0.0
    if isinstance(hinge, Revolute | Planar):
        angle, rate = initial(hinge.rotation)
    if isinstance(hinge, Planar):
        (place[0], velocity[0]), (place[1], velocity[1]) = initial(hinge.x), initial(hinge.y)
    c, s = cos(angle), sin(angle)
    return Frame(place, np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])), velocity, rate


def _axes(chords: Real, rotations: Real) -> Real:
    """Axes (n,3,3) of straight elements along chords (n,3), with y as near as can be to that of the sections."""
    x = chords / np.linalg.norm(chords, axis=1)[:, None]
    y = rotations[:, :, 1] - np.sum(rotations[:, :, 1] * x, axis=1)[:, None] * x
    y /= np.linalg.norm(y, axis=1)[:, None]
    return np.stack([x, y, cross(x, y)], axis=2)


def _sections(beam: BeamBody, middles: Real) -> tuple[Section, ...]:
    stiffness = between_stations(beam, stiffness_on_axis, middles)
    inertia = between_stations(beam, inertia_on_axis, middles)
    sections = []
    for K, M in zip(np.diagonal(stiffness, axis1=1, axis2=2), np.diagonal(inertia, axis1=1, axis2=2), strict=True):
        EA, GAy, GAz, GJ, EIy, EIz = K.tolist()
        GAy, GAz = (GAy, GAz) if shears(beam) else (0.0, 0.0)
        rotary = (0.0, 0.0, 0.0) if beam.points == "line" else tuple(M[3:].tolist())
        sections.append(Section(EA, GAy, GAz, GJ, EIy, EIz, float(M[0]), rotary))
    return tuple(sections)
