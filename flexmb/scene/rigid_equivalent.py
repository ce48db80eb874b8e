"""The inertia of a body at rest, and the rigid body with the same inertia points and nodes as a flexible body.

It is independent of the native modal preprocessing, and repeats only its documented choice of inertia points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import assert_never

import numpy as np
from msgspec.structs import replace

from flexmb.scene.collocation import gauss_rule
from flexmb.scene.modal_data import modal_arrays
from flexmb.scene.rest_curve import is_curved, rest_sections
from flexmb.scene.schema import BeamBody, Body, ModalBody, Node, RigidBody, Scene, SidBody, TipMass, Vector, Wheel
from flexmb.scene.sections import between_stations, inertia_on_axis, mass_centres
from flexmb.scene.tree import rest_frames
from flexmb.typing import Real

_GAUSS_POINTS = 3
"""Exact to degree 5: the second moment of a linearly varying section has degree 3."""
_CURVED_PARTS = 64
"""Of a curved beam: half a turn leaves rounding errors of its inertia, five turns 2e-10 of it."""


@dataclass(frozen=True)
class Inertia:
    """Mass kg, mass centre (3,) m and inertia (3,3) kg m^2 about it, in one frame."""

    mass: float
    com: Real
    inertia: Real


def combine(parts: Sequence[Inertia]) -> Inertia:
    """Several rigid bodies as one."""
    return combined(
        np.array([part.mass for part in parts], float), np.array([part.com for part in parts], float).reshape(-1, 3),
        np.array([part.inertia for part in parts], float).reshape(-1, 3, 3),
    )  # fmt: skip


def combined(mass: Real, com: Real, inertia: Real) -> Inertia:
    """Bodies of masses (n,), mass centres (n,3) and inertias (n,3,3) about these as one, by Steiner's theorem."""
    total = float(sum(mass.tolist()))
    centre: Real = np.sum(mass[:, None] * com, axis=0) / (total or 1.0)  # one after the other, as whoever adds by hand
    return Inertia(total, centre, np.sum(inertia + steiner(mass, com - centre), axis=0))


def steiner(mass: float | Real, offset: Real) -> Real:
    """Inertias (...,3,3) of point masses (...) at offsets (...,3) about the origin."""
    squares = np.sum(offset**2, axis=-1)[..., None, None] * np.eye(3)
    return np.asarray(mass)[..., None, None] * (squares - offset[..., :, None] * offset[..., None, :])


def section_properties(body: BeamBody, x: Real, *keys: str) -> tuple[Real, ...]:
    """Station properties (keys of `BeamStation`) at x (n,): piecewise linear, constant beyond the outer stations."""
    stations = sorted(body.stations, key=lambda station: station.x_m)
    at = [station.x_m for station in stations]
    return tuple(np.interp(x, at, [getattr(station, key) for station in stations]) for key in keys)


def _sections(body: BeamBody, x: Real) -> tuple[Real, Real, Real]:
    """Masses per length (n,), mass centres (n,3) from the axis and inertias (n,3,3) about these at x (n,)."""
    mass, com, inertia = mass_centres(between_stations(body, inertia_on_axis, x))
    return mass, com, np.zeros_like(inertia) if body.points == "line" else inertia


def quadrature(body: BeamBody, cuts: Sequence[float] | Real) -> tuple[Real, Real]:
    """Gauss points and weights (n,) between the cuts (ascending) and stations, where the sections have kinks."""
    inside = [station.x_m for station in body.stations if cuts[0] < station.x_m < cuts[-1]]
    ends = np.unique([*cuts, *inside])
    s, w = gauss_rule(_GAUSS_POINTS)
    half = np.diff(ends)[:, None] / 2.0
    return (ends[:-1, None] + half * (1.0 + s)).ravel(), (half * w).ravel()


def beam_piece(body: BeamBody, start: float, end: float) -> Inertia:
    """The piece start <= x <= end of a beam in the beam's frame, with the tip masses on it.

    A tip mass exactly at `end` belongs to the next piece, except at the end of the beam.
    """
    x, weight = quadrature(body, np.linspace(start, end, 1 + _CURVED_PARTS) if is_curved(body) else (start, end))
    position, rotation = rest_sections(body, x)
    m, com, J = _sections(body, x)
    turned = rotation @ (weight[:, None, None] * J) @ np.swapaxes(rotation, 1, 2)
    along = combined(weight * m, position + np.einsum("nij,nj->ni", rotation, com), turned)
    here = [lump for lump in body.tip_masses if start <= lump.x_m < end or lump.x_m == end == body.length_m]
    return combine([along, *_lumps(body, here)]) if here else along


def _lumps(body: BeamBody, lumps: Sequence[TipMass]) -> list[Inertia]:
    position, rotation = rest_sections(body, np.array([lump.x_m for lump in lumps]))
    return [
        Inertia(lump.mass_kg, at + R @ lump.com_m, R @ np.array(lump.inertia_kg_m2) @ R.T)
        for lump, at, R in zip(lumps, position, rotation, strict=True)
    ]


def _lumped_beam(body: BeamBody) -> Inertia:
    """A beam with lumped masses: each element node receives the inertia weighted by its hat function."""
    nodes = np.linspace(0.0, body.length_m, body.elements + 1)
    x, weight = quadrature(body, tuple(nodes))
    hats = np.maximum(0.0, 1.0 - np.abs(x[:, None] - nodes) * body.elements / body.length_m)
    m, com, J = _sections(body, x)
    share = weight[:, None] * hats
    places = com[:, None] + np.column_stack([nodes, np.zeros((len(nodes), 2))])
    inertias = (share[..., None, None] * J[:, None]).reshape(-1, 3, 3)
    along = combined((share * m[:, None]).ravel(), places.reshape(-1, 3), inertias)
    return combine([along, *_lumps(body, body.tip_masses)])


def rest_inertia(body: Body) -> Inertia:
    """The inertia of a body at rest, in its own frame; ValueError for a SID body."""
    match body:
        case RigidBody():
            return inertia_of(body)
        case BeamBody(mass="lumped"):
            return _lumped_beam(body)
        case BeamBody():
            return beam_piece(body, 0.0, body.length_m)
        case ModalBody():
            arrays = modal_arrays(body)
            return combined(arrays.mass, arrays.position + arrays.com_offset, arrays.inertia)
        case SidBody():
            raise ValueError(f'the mass of body "{body.name}" is in its SID file: convert it by flexmb import')
        case _:
            assert_never(body)


def total_mass(scene: Scene) -> float:
    """Of all bodies and what they carry, in kg; ValueError if one is a SID body."""
    carried = sum(wheel.mass_kg for wheel in scene.wheels) + sum(point.mass_kg for point in scene.point_masses)
    return carried + sum(rest_inertia(body).mass for body in scene.bodies)


def wheel_inertia(wheel: Wheel) -> Real:
    """Inertia (3,3) about the mass centre, in the axes of its node."""
    along = np.outer(wheel.axis, wheel.axis)
    return wheel.transverse_inertia_kg_m2 * (np.eye(3) - along) + wheel.axial_inertia_kg_m2 * along


def rigid_equivalent(body: Body) -> RigidBody:
    """The body without its modes. A rigid body is returned unchanged; a SID body raises ValueError."""
    if isinstance(body, RigidBody):
        return body
    inertia = rest_inertia(body)
    frames = {name: frame for name, frame in rest_frames(body).items() if name != "origin"}
    nodes = tuple(Node(name=name, position_m=at.position, quaternion=at.quaternion) for name, at in frames.items())
    return rigid_body(body.name, inertia, nodes)


def rigid_body(name: str, inertia: Inertia, nodes: tuple[Node, ...]) -> RigidBody:
    """A `RigidBody` from arrays."""
    x, y, z = inertia.inertia
    return RigidBody(
        name=name, mass_kg=float(inertia.mass), com_m=vector(inertia.com),
        inertia_kg_m2=(vector(x), vector(y), vector(z)), nodes=nodes,
    )  # fmt: skip


def inertia_of(body: RigidBody) -> Inertia:
    """The inertia of a rigid body as arrays, in its body frame."""
    return Inertia(body.mass_kg, np.array(body.com_m), np.array(body.inertia_kg_m2))


def vector(values: Real) -> Vector:
    """Three numbers of an array as a scene has them."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def rigidify(scene: Scene) -> Scene:
    """The scene with rigid bodies of the same inertia and nodes in place of flexible ones, without modal states."""
    bodies = tuple(body if isinstance(body, SidBody) else rigid_equivalent(body) for body in scene.bodies)
    return replace(scene, bodies=bodies, modal_states=())
