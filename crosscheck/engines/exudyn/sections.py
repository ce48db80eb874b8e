"""A beam in space: Exudyn's geometrically exact elements, massless springs of six strains, between rigid sections.

An element (ObjectBeamGeometricallyExact) keeps its strains constant: its axis is a helix, and its strain is the
logarithm of the relative motion of its ends, so that the stiffest shear does not lock it. It is straight at rest, takes
the diagonal of the stiffness alone, and its own weight is not implemented (Exudyn 1.13.6). A section that is curved at
rest is therefore two ends of elements that are welded at an angle, and mass is on the sections. That is where Exudyn
lumps the mass of an element too, half at each end, but as bodies they have weight, mass centres and any inertia.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.engines.conventions import cross, rotation_matrix
from crosscheck.engines.exudyn.carriers import Carrier, Workshop
from crosscheck.engines.exudyn.motion import FrameMotion
from flexmb.scene.rest_curve import is_curved, rest_sections
from flexmb.scene.schema import BeamBody
from flexmb.scene.sections import inertia_on_axis, mass_centres, stiffness_on_axis
from flexmb.scene.strains import polynomials
from flexmb.scene.tree import nodes_along, rest_frames
from flexmb.surrogate.lumping import Inertia, combine
from flexmb.typing import Real


@dataclass(frozen=True)
class BeamElement:
    """One element between two carriers whose axes are its axes: length (m), diagonal (6,) of the stiffness."""

    left: Carrier
    right: Carrier
    length: float
    stiffness: Real


@dataclass(frozen=True)
class BeamSection:
    """The rigid section at a node: its carrier, the motion of that at t = 0, rotation (3,3) node -> carrier."""

    carrier: Carrier
    motion: FrameMotion
    rotation: Real


@dataclass(frozen=True)
class SpatialBeam:
    """A beam of elements: its sections by the names of nodes, all carriers that have mass, its elements."""

    sections: dict[str, BeamSection]
    carriers: tuple[Carrier, ...]
    elements: tuple[BeamElement, ...]


def spatial_beam(shop: Workshop, body: BeamBody, motion: FrameMotion) -> SpatialBeam:
    """The beam at rest in its own frame, which moves by `motion` at t = 0."""
    x = _stations(body)
    position, rotation = rest_sections(body, x)
    ends = _element_frames(position, rotation)
    lumps = _lumps(body, x, rotation)
    carriers: list[Carrier] = []
    elements: list[BeamElement] = []
    starts: list[Carrier] = []
    curved = is_curved(body)
    for k, turn in enumerate((ends[0], *ends)):  # the axes of section k are those of the element before it
        carriers.append(shop.rigid(motion.offset(position[k], turn), np.eye(3), _turned(lumps[k], turn)))
        last = k == len(x) - 1
        starts.append(carriers[k])
        if curved and k > 0 and not last:
            starts[k] = _kink(shop, carriers[k], turn, motion.offset(position[k], ends[k]), ends[k])
    stiffness = _stiffness(body, (x[1:] + x[:-1]) / 2.0)
    for k, diagonal in enumerate(stiffness):
        length = float(np.linalg.norm(position[k + 1] - position[k]))
        elements.append(BeamElement(starts[k], carriers[k + 1], length, diagonal))
        _add(shop, elements[k])
    found = {}
    for name, rest in rest_frames(body).items():
        k = int(np.argmin(np.abs(x - nodes_along(body)[name])))
        axes = ends[max(k - 1, 0)]
        found[name] = BeamSection(
            carriers[k], motion.offset(position[k], axes), axes.T @ rotation_matrix(rest.quaternion)
        )
    return SpatialBeam(found, tuple(carriers), tuple(elements))


def _add(shop: Workshop, element: BeamElement) -> None:
    data = shop.exu.BeamSection()
    data.stiffnessMatrix = np.diag(element.stiffness)
    shop.mbs.AddObject(
        shop.items.ObjectBeamGeometricallyExact(
            nodeNumbers=[element.left.node, element.right.node], physicsLength=element.length, sectionData=data
        )
    )


def _kink(shop: Workshop, carrier: Carrier, axes: Real, motion: FrameMotion, next_axes: Real) -> Carrier:
    """The massless start of an element, welded to the section where the one before it ends."""
    start = shop.rigid(motion, np.eye(3), None)
    markers = [shop.marker(carrier, np.zeros(3), axes.T @ next_axes), shop.marker(start, np.zeros(3))]
    shop.mbs.AddObject(shop.items.GenericJoint(markerNumbers=markers, constrainedAxes=[1] * 6))
    return start


def _stations(body: BeamBody) -> Real:
    """Ends of the elements: nodes, stations and tip masses, and between them as many as make the scene's number."""
    L = body.length_m
    wanted = [0.0, L, *(each.x_m for each in (*body.nodes, *body.stations, *body.tip_masses))]
    fixed = np.unique(np.round(np.array(wanted) / L, 12)) * L
    parts = [
        np.linspace(left, right, max(1, round(body.elements * (right - left) / L)), endpoint=False)
        for left, right in zip(fixed, fixed[1:], strict=False)
    ]
    return np.concatenate([*parts, [L]])


def _element_frames(position: Real, rotation: Real) -> Real:
    """Axes (n-1,3,3) of straight elements between sections: x along the chord, turned as the section midway is."""
    half = Rotation.from_matrix(np.swapaxes(rotation[:-1], 1, 2) @ rotation[1:]).as_rotvec() / 2.0
    middle = rotation[:-1] @ Rotation.from_rotvec(half).as_matrix()
    chord = np.diff(position, axis=0)
    chord /= np.linalg.norm(chord, axis=1)[:, None]
    y = middle[:, :, 1] - np.sum(middle[:, :, 1] * chord, axis=1)[:, None] * chord
    y /= np.linalg.norm(y, axis=1)[:, None]
    return np.stack([chord, y, cross(chord, y)], axis=2)


def _interpolated(body: BeamBody, matrices: list[Real], x: Real) -> Real:
    """Matrices (n,6,6) at x (n,), linear between stations."""
    at = [station.x_m for station in body.stations]
    stacked = np.array(matrices)
    found = np.empty((len(x), 6, 6))
    for i in range(6):
        for j in range(6):
            found[:, i, j] = np.interp(x, at, stacked[:, i, j])
    return found


def _stiffness(body: BeamBody, x: Real) -> Real:
    """Diagonals (n,6) of the stiffness. A beam without shear yields to shear as little as to stretch: stiffer springs
    would stop Newton's method at steps that follow the bending."""
    found = np.array([np.diag(each) for each in _interpolated(body, [*map(stiffness_on_axis, body.stations)], x)])
    if not shears(body):
        found[:, 1:3] = found[:, :1]
    return found


def shears(body: BeamBody) -> bool:
    """Whether the scene's beam shears."""
    if body.level == "exact":
        return bool({"shear_y", "shear_z"} & set(polynomials(body)))
    return body.theory == "timoshenko"


def _lumps(body: BeamBody, x: Real, rotation: Real) -> list[Inertia]:
    """The inertia of every section in the axes of the body, about it: half of each element beside it, and tip
    masses."""
    middles, lengths = (x[1:] + x[:-1]) / 2.0, np.diff(x)
    per_length = _interpolated(body, [*map(inertia_on_axis, body.stations)], middles)
    mass, com, inertia = mass_centres(per_length)
    parts: list[list[Inertia]] = [[] for _ in x]
    for k, length in enumerate(lengths):
        for end in (k, k + 1):
            R = rotation[end]
            share = length / 2.0
            parts[end].append(Inertia(share * mass[k], R @ com[k], share * R @ inertia[k] @ R.T))
    for lump in body.tip_masses:
        k = int(np.argmin(np.abs(x - lump.x_m)))
        R = rotation[k]
        parts[k].append(
            Inertia(lump.mass_kg, R @ np.array(lump.com_m), R @ np.array(lump.inertia_kg_m2) @ R.T)
        )
    return [combine(each) for each in parts]


def _turned(lump: Inertia, axes: Real) -> Inertia:
    """An inertia in the axes `axes` of the body."""
    return Inertia(lump.mass, axes.T @ lump.com, axes.T @ lump.inertia @ axes)
