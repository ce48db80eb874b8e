"""Raw modal bodies, whose inertia points and modes are given in the scene or in an `.npz` file.

Their second-order field is given too, or derived from geometric stiffness under unit loads. Loads F_j on the points do
the work sum F_j . u_2j = 1/2 eta' (sum F_j . G_j) eta on the second-order field; their geometric stiffness is therefore
K_g = -sum F_j . G_j. To the second order in eta, the kinetic energy contains only the integrals sum m G and
sum m r x' G of the field. They follow from the geometric stiffness under mass forces that are uniform and under mass
forces that are proportional to a coordinate. To that order all fields with these integrals are equivalent; the one that
is affine in the position is used.
"""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np

from flexmb.modal.flexible_model import FlexibleModel, FlexibleNode, SecondOrder, undeforming_node
from flexmb.scene.bodies import ModalBody, ModalNode, Vector
from flexmb.scene.modal_data import ModalArrays, modal_arrays, node_arrays
from flexmb.scene.quaternions import rotation_matrix
from flexmb.typing import Real

_FLAT = 1e-9  # points lie in a plane or on a line if their extent across it is below this fraction of their size


def second_order(arrays: ModalArrays) -> SecondOrder | None:
    """Field of the points (n,3,m,m), None without data.

    Raises ValueError if `gradient_stiffness` is not zero for a direction in which the points have no extent.
    """
    if arrays.second_translation is not None:
        G, H = arrays.second_translation, arrays.second_rotation
        return SecondOrder(G, np.zeros_like(G) if H is None else H).map(_symmetric)
    if arrays.gravity_stiffness is None or arrays.gradient_stiffness is None:
        return None
    G = _affine(arrays, _symmetric(-arrays.gravity_stiffness), _symmetric(-arrays.gradient_stiffness))
    return SecondOrder(G, np.zeros_like(G))


def node_second_order(node: ModalNode) -> SecondOrder | None:
    """Field of a node (3,m,m), None without data."""
    given = node_arrays(node)
    if not given:
        return None
    m = len(node.translation_modes)
    translation = given.get("second_translation", -given.get("force_stiffness", np.zeros((3, m, m))))
    return SecondOrder(translation, given.get("second_rotation", np.zeros((3, m, m)))).map(_symmetric)


def _affine(arrays: ModalArrays, Z: Real, X: Real) -> Real:
    """G (n,3,m,m), affine in the mass centres at rest p, with sum m G_a = Z_a and sum m p_b G_a = X_ab."""
    p = arrays.position + arrays.com_offset
    size = np.max(np.abs(p), initial=0.0) or 1.0  # lengths in this unit make 1 and p comparable in `moments`
    rows = np.column_stack([np.ones(len(p)), p / size])
    moments = (rows.T * arrays.mass) @ rows
    wanted = np.concatenate([Z[:, None], X / size], axis=1)
    # Points in a plane or on a line make `moments` singular: the pseudo-inverse leaves the slope across it at zero.
    parameters = np.einsum("bc,acnk->abnk", np.linalg.pinv(moments, rcond=_FLAT, hermitian=True), wanted)
    left = wanted - np.einsum("bc,acnk->abnk", moments, parameters)
    largest = np.max(np.abs(left[:, 1:]), axis=(2, 3))
    if np.max(largest) > np.sqrt(_FLAT) * np.max(np.abs(wanted)):
        along, axis = ("xyz"[i] for i in np.unravel_index(np.argmax(largest), largest.shape))
        raise ValueError(
            f'"gradient_stiffness" is not zero for mass forces along {along} that grow with {axis}, but the points '
            f"have no extent along {axis}; correct the matrices, or the points"
        )
    return np.einsum("pb,abnk->pank", rows, parameters)


def _symmetric(G: Real) -> Real:
    """The symmetric part; the other one has no effect."""
    return 0.5 * (G + np.swapaxes(G, -1, -2))


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
