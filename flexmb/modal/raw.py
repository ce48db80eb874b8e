"""Raw modal bodies, whose inertia points and modes are given in the scene or in an `.npz` file."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np

from flexmb.modal.flexible_model import FlexibleModel, FlexibleNode, undeforming_node
from flexmb.modal.raw_second_order import node_second_order, second_order
from flexmb.scene.bodies import ModalBody, Vector
from flexmb.scene.modal_data import modal_arrays
from flexmb.scene.quaternions import rotation_matrix
from flexmb.typing import Real


def raw_model(body: ModalBody, folder: Path | None = None) -> FlexibleModel:
    """The model of a raw modal body; a relative `file` is looked up in `folder`.

    Raises ValueError, which names the body, for arrays that are missing or have a wrong shape, OSError if the file
    cannot be read.
    """
    if body.file is not None and folder is not None:
        body = msgspec.structs.replace(body, file=str(folder / body.file))
    try:
        arrays = modal_arrays(body)
        second = second_order(arrays) if body.level == "stiffened" else None
    except ValueError as error:
        raise ValueError(f"modal body '{body.name}': {error}") from error
    return FlexibleModel(
        mass=arrays.mass,
        position=arrays.position,
        com_offset=arrays.com_offset,
        inertia=arrays.inertia,
        translation=arrays.translation_modes,
        rotation=arrays.rotation_modes,
        stiffness=arrays.stiffness,
        damping=arrays.damping,
        nodes=_nodes(body, arrays.translation_modes.shape[2]),
        clamped=body.boundary == "clamped-free",
        second=second,
    )


def _nodes(body: ModalBody, modes: int) -> dict[str, FlexibleNode]:
    """Nodes by name, with "origin": the body frame, which does not deform."""
    nodes = {"origin": undeforming_node(modes)}
    for node in body.nodes:
        if len(node.translation_modes) != modes or len(node.rotation_modes) != modes:
            raise ValueError(
                f"modal body '{body.name}': node '{node.name}' has {len(node.translation_modes)} translation and "
                f"{len(node.rotation_modes)} rotation modes, expected {modes} of each"
            )
        nodes[node.name] = FlexibleNode(
            np.array(node.position_m, dtype=float),
            rotation_matrix(node.quaternion),
            _columns(node.translation_modes),
            _columns(node.rotation_modes),
            node_second_order(node) if body.level == "stiffened" else None,
        )
    return nodes


def _columns(vectors: tuple[Vector, ...]) -> Real:
    """Mode vectors (m of 3) as columns (3, m)."""
    return np.array(vectors, dtype=float).reshape(-1, 3).T
