"""A beam in space: Exudyn's geometrically exact elements, massless springs of six strains, between rigid sections.

An element (ObjectBeamGeometricallyExact of Exudyn 1.13.6) keeps its strains constant: its axis is a helix, its strains
are the logarithm of the relative motion of its ends less that at rest, over its length, and the stiffest shear does not
lock it. It takes the diagonal of the stiffness alone. Exudyn lumps its mass at the ends, half at each; here the lumps
are bodies at the same places, which may have mass centres off the axis, any inertia and the beam's own lumps.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import repeat

import numpy as np

from crosscheck.engines.beam_elements import element_ends, shears
from crosscheck.engines.conventions import rotation_matrix
from crosscheck.engines.exudyn.carriers import Carrier, Workshop
from crosscheck.engines.exudyn.motion import FrameMotion
from crosscheck.engines.exudyn.rotations import logarithm
from flexmb.scene.rest_curve import rest_sections
from flexmb.scene.rigid_equivalent import Inertia, combine
from flexmb.scene.schema import BeamBody
from flexmb.scene.sections import between_stations, inertia_on_axis, mass_centres, stiffness_on_axis
from flexmb.scene.tree import nodes_along, rest_frames
from flexmb.typing import Real


@dataclass(frozen=True)
class BeamElement:
    """One element between two sections: length (m), diagonal (6,) of the stiffness, and the logarithm (6,) of the
    motion from one end to the other at rest, [translation; rotation]."""

    left: Carrier
    right: Carrier
    length: float
    stiffness: Real
    rest: Real


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
    x = element_ends(body)
    position, rotation = rest_sections(body, x)
    motions = [motion.offset(*offset) for offset in zip(position, rotation, strict=True)]
    carriers = [shop.rigid(*part) for part in zip(motions, repeat(np.eye(3)), _lumps(body, x))]
    turn = np.swapaxes(rotation[:-1], 1, 2) @ rotation[1:]
    apart = np.einsum("kji,kj->ki", rotation[:-1], np.diff(position, axis=0))
    stiffness = _stiffness(body, (x[1:] + x[:-1]) / 2.0)
    columns = carriers[:-1], carriers[1:], np.diff(x).tolist(), stiffness, logarithm(turn, apart)
    elements = [BeamElement(*columns_of_element) for columns_of_element in zip(*columns, strict=True)]
    for element in elements:
        _add(shop, element)
    beams = {}
    for name, rest in rest_frames(body).items():
        k = int(np.argmin(np.abs(x - nodes_along(body)[name])))
        beams[name] = BeamSection(carriers[k], motions[k], rotation[k].T @ rotation_matrix(rest.quaternion))
    return SpatialBeam(beams, tuple(carriers), tuple(elements))


def _add(shop: Workshop, element: BeamElement) -> None:
    data = shop.exu.BeamSection()
    data.stiffnessMatrix = np.diag(element.stiffness)
    shop.mbs.AddObject(
        shop.items.ObjectBeamGeometricallyExact(
            nodeNumbers=[element.left.node, element.right.node], physicsLength=element.length, sectionData=data
        )
    )


def _stiffness(body: BeamBody, x: Real) -> Real:
    """Diagonals (n,6) of the stiffness. A beam without shear yields to shear as little as to stretch: stiffer springs
    would stop Newton's method at steps that follow the bending."""
    stiffness = between_stations(body, stiffness_on_axis, x)
    diagonals = np.array([np.diag(each) for each in stiffness])
    if not shears(body):
        diagonals[:, 1:3] = diagonals[:, :1]
    return diagonals


def _lumps(body: BeamBody, x: Real) -> list[Inertia]:
    """The inertia of every section in its axes: half of each element beside it, and tip masses."""
    middles, lengths = (x[1:] + x[:-1]) / 2.0, np.diff(x)
    per_length = between_stations(body, inertia_on_axis, middles)
    mass, com, inertia = mass_centres(per_length)
    parts: list[list[Inertia]] = [[] for _ in x]
    for k, half in enumerate(lengths / 2.0):
        for end in (k, k + 1):
            parts[end].append(Inertia(half * mass[k], com[k], half * inertia[k]))
    for lump in body.tip_masses:
        place = int(np.argmin(np.abs(x - lump.x_m)))
        parts[place].append(Inertia(lump.mass_kg, np.array(lump.com_m), np.array(lump.inertia_kg_m2)))
    return [combine(part) for part in parts]
