"""The `FlexibleModel` of a flexible body of a scene, beam or raw modal body."""

from __future__ import annotations

import dataclasses
from functools import lru_cache
from pathlib import Path
from typing import TypeVar, assert_never

import numpy as np
from msgspec.structs import replace

from flexmb.modal.beam import BeamElements, beam_elements
from flexmb.modal.element_points import (
    Points,
    axis_points,
    join,
    massy_lump,
    on_axis,
    section_points,
    turning_lump,
    twisting,
)
from flexmb.modal.equivalent import with_equivalent_masses
from flexmb.modal.exact import exact_model
from flexmb.modal.flexible_model import FlexibleModel, FlexibleNode, SecondOrder, undeforming_node
from flexmb.modal.following import followed
from flexmb.modal.raw import raw_model
from flexmb.modal.reduce import BeamModes, beam_modes, damping_matrix
from flexmb.modal.second_order import beam_second_order
from flexmb.modal.stations import Lump, Stations, inertia_stations, lumps
from flexmb.scene.bodies import IDENTITY, BeamBody, ModalBody, Quaternion
from flexmb.scene.quaternions import rotation_matrix
from flexmb.typing import Real


def flexible_model(
    body: BeamBody | ModalBody, folder: Path | None = None, like: BeamBody | ModalBody | None = None
) -> FlexibleModel:
    """Inertia points, modes, stiffness, damping and nodes of one flexible body.

    `folder` contains a modal body's `.npz` (the folder of the scene file). Node "origin" is the body frame, which does
    not deform; a beam also has "root" and "tip". At level "stiffened" few equivalent masses replace the inertia points
    (`flexmb.modal.equivalent`). Equal beams share one model: its arrays must not be written to. `like`: the same body
    with slightly other numbers; modes and equivalent masses are then chosen such that the model is a smooth function of
    the numbers of `body` around those of `like` (`flexmb.modal.following`). Raises ValueError for inconsistent data.
    """
    match body:
        case ModalBody():
            reference = None if like is None else raw_model(_of_kind(like, ModalBody), folder)
            return with_equivalent_masses(raw_model(body, folder), reference)
        case BeamBody():
            followed = None if like is None else replace(_of_kind(like, BeamBody), name="beam")
            try:
                return _beam(replace(body, name="beam"), followed)
            except ValueError:
                return _beam(body, followed)  # equal beams of any name share the cache; this raises again, by name
        case _:
            assert_never(body)


Body = TypeVar("Body", BeamBody, ModalBody)


def _of_kind(body: BeamBody | ModalBody, kind: type[Body]) -> Body:
    if not isinstance(body, kind):
        raise ValueError(f"body '{body.name}' cannot follow one of another kind")
    return body


@lru_cache(maxsize=128)
def _beam(body: BeamBody, like: BeamBody | None = None) -> FlexibleModel:
    if body.level == "exact":
        return exact_model(body, like)
    if body.level != "stiffened":
        return beam_model(body, like)
    return with_equivalent_masses(beam_model(body, like), None if like is None else beam_model(like))


def beam_model(body: BeamBody, like: BeamBody | None = None) -> FlexibleModel:
    """Finite elements, modes and inertia points of a beam; unit modal masses, stiffness diag(omega^2).

    `like`: see `flexible_model`; the stiffness of modes that had one frequency in it may have other elements too.
    """
    damping_ratio, viscosity = body.modes.damping_ratio, body.modes.viscosity_s
    try:
        undamped, modes = _undamped(_without_damping(body), None if like is None else _without_damping(like))
        damping = damping_matrix(modes.roots, damping_ratio) + viscosity * modes.stiffness
    except ValueError as error:
        raise ValueError(f"beam '{body.name}': {error}") from error
    return dataclasses.replace(undamped, damping=damping)


def _without_damping(body: BeamBody) -> BeamBody:
    return replace(body, modes=replace(body.modes, damping_ratio=0.0, viscosity_s=0.0))


@lru_cache(maxsize=32)
def _undamped(body: BeamBody, like: BeamBody | None) -> tuple[FlexibleModel, BeamModes]:
    """The model and the modes of a beam whatever its damping, by numbers of which scenes are varied too."""
    elements = beam_elements(body)
    stations = inertia_stations(body, elements.mesh, elements.table)
    rigid_lumps = lumps(body)
    M = elements.mass(stations, rigid_lumps)
    modes = beam_modes(elements, elements.stiffness(), M, body.modes)
    if like is not None:
        modes = followed(modes, M, _modes_of(like))
    points = points_of(body, elements, modes.columns, stations, rigid_lumps)
    return FlexibleModel(
        mass=points.mass,
        position=points.position,
        com_offset=points.com_offset,
        inertia=points.inertia,
        translation=points.translation,
        rotation=points.rotation,
        stiffness=modes.stiffness,
        damping=np.zeros_like(modes.stiffness),
        nodes=_nodes(body, elements, modes.columns),
        clamped=body.modes.boundary == "clamped-free",
        second=second_order_of(body, elements, modes.columns, points.x, points.position - on_axis(points.x)),
    ), modes


@lru_cache(maxsize=8)  # one body is followed at a time, by models for all of its numbers
def _modes_of(body: BeamBody) -> BeamModes:
    elements = beam_elements(body)
    M = elements.mass(inertia_stations(body, elements.mesh, elements.table), lumps(body))
    return beam_modes(elements, elements.stiffness(), M, body.modes)


def points_of(
    body: BeamBody, elements: BeamElements, columns: Real, stations: Stations, rigid_lumps: tuple[Lump, ...]
) -> Points:
    """Stations and lumps in the form of `body.points`."""
    along = axis_points if body.points == "rotary" else section_points  # sections without inertia are masses alone
    at_lump = massy_lump if body.points == "section" else turning_lump
    own = twisting(along(elements, columns, stations), stations.twist)
    return join([own, *(at_lump(elements, columns, lump) for lump in rigid_lumps)])


def second_order_of(body: BeamBody, elements: BeamElements, columns: Real, x: Real, offset: Real) -> SecondOrder | None:
    """Second-order field of points at `offset` (n,3) from the axis points x (n,); only level "stiffened" needs it."""
    return beam_second_order(elements, columns, x, offset) if body.level == "stiffened" else None


def _nodes(body: BeamBody, elements: BeamElements, columns: Real) -> dict[str, FlexibleNode]:
    """Nodes by name: origin, root, tip and the listed ones."""
    modes = columns.shape[1]
    nodes = {"origin": undeforming_node(modes)}
    listed: list[tuple[str, float, Quaternion]] = [("root", 0.0, IDENTITY), ("tip", body.length_m, IDENTITY)]
    listed += [(node.name, node.x_m, node.quaternion) for node in body.nodes]
    for name, x, quaternion in listed:
        if not 0.0 <= x <= body.length_m:
            raise ValueError(f"beam '{body.name}': node '{name}' at x = {x:g} m is not on [0, {body.length_m:g}] m")
        moved = elements.motion(np.array([x]), columns)[0]
        turn = rotation_matrix(quaternion)
        second = second_order_of(body, elements, columns, np.array([x]), np.zeros((1, 3)))
        of_node = None if second is None else second.map(lambda G: G[0])
        nodes[name] = FlexibleNode(np.array([x, 0.0, 0.0]), turn, moved[:3], moved[3:], of_node)
    return nodes
