"""Beams as raw modal bodies with the same inertia points and modes."""

from __future__ import annotations

import dataclasses

import numpy as np
from msgspec.structs import replace

from flexmb.modal import flexible_model
from flexmb.modal.flexible_model import SecondOrder
from flexmb.scene.bodies import VectorSquare
from flexmb.scene.modal_data import inertia_points
from flexmb.scene.rigid_equivalent import vector
from flexmb.scene.schema import BeamBody, ModalBody, ModalNode, Scene
from flexmb.scene.tree import rest_frames
from flexmb.typing import Real


def modal_points(scene: Scene) -> Scene:
    """The scene with every beam as raw inertia points and modes, so that other codes get exactly the same data.

    A beam of level "stiffened" also has the second-order field of its points and nodes. Raises ValueError for beams of
    level "exact", whose points do not move by modes.
    """
    return replace(scene, bodies=tuple(_modal(body) if isinstance(body, BeamBody) else body for body in scene.bodies))


def _modal(beam: BeamBody) -> ModalBody:
    if beam.level == "exact":
        raise ValueError(
            f'beam "{beam.name}" is of level "exact", and its points do not move by modes: make the level "stiffened"'
        )
    model = flexible_model(beam)
    quaternions = {name: frame.quaternion for name, frame in rest_frames(beam).items()}
    free = beam.modes.boundary == "free-free"
    nodes = tuple(
        ModalNode(
            name=name, position_m=vector(node.position), quaternion=quaternions[name],
            translation_modes=tuple(map(vector, node.translation.T)),
            rotation_modes=tuple(map(vector, node.rotation_modes.T)),
            **_field(node.second),
        )
        for name, node in model.nodes.items()
        if free or name != "origin"
    )  # fmt: skip
    second = {} if model.second is None else dataclasses.asdict(model.second)
    return ModalBody(
        name=beam.name, nodes=nodes, boundary=beam.modes.boundary, level=beam.level,
        points=inertia_points(
            model.mass, model.position, model.translation, model.rotation, model.inertia, model.com_offset,
            **{f"second_{name}": G for name, G in second.items()},
        ),
        stiffness=tuple(map(_floats, model.stiffness)), damping=tuple(map(_floats, model.damping)),
    )  # fmt: skip


def _field(second: SecondOrder | None) -> dict[str, VectorSquare]:
    """The second-order field (3,m,m) of a node by the keys of the scene."""
    if second is None:
        return {}
    return {
        f"second_{name}": tuple(tuple(map(vector, row)) for row in np.moveaxis(G, 0, -1))
        for name, G in dataclasses.asdict(second).items()
    }


def _floats(values: Real) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
