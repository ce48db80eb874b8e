"""Raw modal bodies: inertia points and modes given inline or in an `.npz`, checked for consistent shapes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from flexmb.modal.model import FlexibleModel, ModalNode
from flexmb.scene.bodies import InertiaPoint, ModalBody

Array = NDArray[np.float64]

# Arrays of an `.npz`: which must be there, and the trailing shape of each ("m" is the number of modes).
_REQUIRED = {"mass": (), "position": (3,), "translation_modes": (3, "m")}
_OPTIONAL = {"rotation_modes": (3, "m"), "inertia": (3, 3), "com_offset": (3,)}


def raw_model(body: ModalBody, folder: Path | None = None) -> FlexibleModel:
    """The model of a raw modal body; `folder` is where its `.npz` lies.

    Raises ValueError naming the body and the array for missing data, wrong shapes, or matrices given twice.
    """
    if body.file is not None and body.points:
        raise ValueError(f"modal body '{body.name}': give either points or file, not both")
    if body.file is not None:
        data = _read(body, (folder or Path()) / body.file)
    elif body.points:
        data = _inline(body, body.points)
    else:
        raise ValueError(f"modal body '{body.name}': give points or file")
    modes = data["translation_modes"].shape[2]
    return FlexibleModel(
        mass=data["mass"],
        position=data["position"],
        com_offset=data["com_offset"],
        inertia=data["inertia"],
        translation=data["translation_modes"],
        rotation=data["rotation_modes"],
        stiffness=_matrix(body, "stiffness", body.stiffness, data, modes),
        damping=_matrix(body, "damping", body.damping, data, modes),
        nodes=_nodes(body, modes),
        clamped=body.boundary == "clamped-free",
    )


def _read(body: ModalBody, path: Path) -> dict[str, Array]:
    """Arrays of the `.npz`, optional ones filled with zeros."""
    place = f"modal body '{body.name}', file '{body.file}'"
    if not path.is_file():
        raise ValueError(f"{place}: not found; the path is relative to the scene file")
    with np.load(path, allow_pickle=False) as archive:
        data = {key: np.array(archive[key], dtype=float) for key in archive.files}
    unknown = set(data) - set(_REQUIRED) - set(_OPTIONAL) - {"stiffness", "damping"}
    missing = set(_REQUIRED) - set(data)
    if unknown or missing:
        raise ValueError(f"{place}: missing arrays {sorted(missing)}, unknown arrays {sorted(unknown)}")
    if data["translation_modes"].ndim != 3:
        raise ValueError(f"{place}: translation_modes must have the shape (points, 3, modes)")
    count, _, modes = data["translation_modes"].shape
    for key, trailing in (_REQUIRED | _OPTIONAL).items():
        shape = (count, *(modes if n == "m" else n for n in trailing))
        array = data.setdefault(key, np.zeros(shape))
        if array.shape != shape:
            raise ValueError(f"{place}: {key} has the shape {array.shape}, expected {shape}")
    return data


def _inline(body: ModalBody, points: tuple[InertiaPoint, ...]) -> dict[str, Array]:
    """Arrays of the inline points; `rotation_modes` may be left out where a point does not turn."""
    modes = len(points[0].translation_modes)
    for n, point in enumerate(points):
        if len(point.translation_modes) != modes or len(point.rotation_modes) not in (0, modes):
            raise ValueError(
                f"modal body '{body.name}': points[{n}] has {len(point.translation_modes)} translation and "
                f"{len(point.rotation_modes)} rotation modes, expected {modes} (rotation: {modes} or none)"
            )
    return {
        "mass": np.array([p.mass_kg for p in points], dtype=float),
        "position": np.array([p.position_m for p in points], dtype=float),
        "com_offset": np.array([p.com_offset_m for p in points], dtype=float),
        "inertia": np.array([p.inertia_kg_m2 for p in points], dtype=float),
        "translation_modes": np.stack([_shape(p.translation_modes, modes) for p in points]),
        "rotation_modes": np.stack([_shape(p.rotation_modes, modes) for p in points]),
    }


def _shape(vectors: tuple[tuple[float, float, float], ...], modes: int) -> Array:
    """Mode vectors (m of 3) as columns (3, m); none given means zero."""
    return np.array(vectors, dtype=float).T if vectors else np.zeros((3, modes))


def _matrix(
    body: ModalBody, key: str, inline: tuple[tuple[float, ...], ...], data: dict[str, Array], modes: int
) -> Array:
    """Stiffness or damping (m,m): inline or from the file; damping may be left out, stiffness may not."""
    if inline and key in data:
        raise ValueError(f"modal body '{body.name}': {key} is given inline and in the file; drop one")
    if inline:
        try:
            matrix = np.array(inline, dtype=float)
        except ValueError as error:
            raise ValueError(f"modal body '{body.name}': rows of {key} differ in length") from error
    elif key in data:
        matrix = data[key]
    elif key == "damping" or modes == 0:
        return np.zeros((modes, modes))
    else:
        raise ValueError(f"modal body '{body.name}': {key} is missing; give a {modes} x {modes} matrix")
    if matrix.shape != (modes, modes):
        raise ValueError(f"modal body '{body.name}': {key} has the shape {matrix.shape}, expected {(modes, modes)}")
    return matrix


def _nodes(body: ModalBody, modes: int) -> dict[str, ModalNode]:
    """Nodes by name, with "origin": the body frame, which does not deform."""
    nodes = {"origin": ModalNode(np.zeros(3), np.eye(3), np.zeros((3, modes)), np.zeros((3, modes)))}
    for node in body.nodes:
        if len(node.translation_modes) != modes or len(node.rotation_modes) != modes:
            raise ValueError(
                f"modal body '{body.name}': node '{node.name}' has {len(node.translation_modes)} translation and "
                f"{len(node.rotation_modes)} rotation modes, expected {modes}"
            )
        nodes[node.name] = ModalNode(
            np.array(node.position_m, dtype=float),
            Rotation.from_quat(node.quaternion, scalar_first=True).as_matrix(),
            _shape(node.translation_modes, modes),
            _shape(node.rotation_modes, modes),
        )
    return nodes
