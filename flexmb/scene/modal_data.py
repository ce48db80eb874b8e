"""The arrays of a raw modal body, from the scene or from an `.npz` file."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexmb.scene.bodies import InertiaPoint, ModalBody, ModalNode
from flexmb.scene.convert import plain, to_struct
from flexmb.scene.reading import read_arrays
from flexmb.scene.sizes import MOST_MODES
from flexmb.typing import Real


class ModalArrays(NamedTuple):
    """n points, m modes: mass (n,) kg, position (n,3) m, translation_modes and rotation_modes (n,3,m), inertia (n,3,3)
    kg m² about the point's mass centre, com_offset (n,3) m, stiffness and damping (m,m).

    For level "stiffened", None where not given: second_translation and second_rotation (n,3,m,m), or geometric
    stiffness under unit loads, gravity_stiffness (3,m,m) and gradient_stiffness (3,3,m,m).
    """

    mass: Real
    position: Real
    translation_modes: Real
    rotation_modes: Real
    inertia: Real
    com_offset: Real
    stiffness: Real
    damping: Real
    second_translation: Real | None = None
    second_rotation: Real | None = None
    gravity_stiffness: Real | None = None
    gradient_stiffness: Real | None = None

    @property
    def given(self) -> dict[str, Real]:
        """The arrays that are not None, by name."""
        return {name: array for name, array in self._asdict().items() if array is not None}


OF_BODY = ("stiffness", "damping", "gravity_stiffness", "gradient_stiffness")
REQUIRED = ("mass", "position", "translation_modes")


def modal_arrays(body: ModalBody) -> ModalArrays:
    """Arrays of `body`, with zeros for optional ones that are not given, and the stiffness times its factor.

    Raises OSError if the file cannot be read, and ValueError, which names the array, if one is missing or has a wrong
    shape.
    """
    given = read_arrays(body.file, ModalArrays._fields) if body.file is not None else _from_points(body.points)
    for name in OF_BODY:
        if matrix := getattr(body, name):
            if name in given:
                raise ValueError(f'"{name}" is given in the scene and in "{body.file}"')
            given[name] = _array(name, matrix)
    arrays = _shaped(given)
    return arrays._replace(stiffness=body.stiffness_factor * arrays.stiffness)


def node_arrays(node: ModalNode) -> dict[str, Real]:
    """The second-order data of a node: second_translation, second_rotation (3,m,m), force_stiffness (3,m,m), if given.

    ValueError for a wrong shape.
    """
    m, given = len(node.translation_modes), {}
    for name in ("second_translation", "second_rotation", "force_stiffness"):
        if value := getattr(node, name):
            array = _array(name, value)
            array = np.moveaxis(array, -1, 0) if name != "force_stiffness" else array
            if array.shape != (3, m, m):
                raise ValueError(f'node "{node.name}": "{name}" has shape {array.shape}, expected {(3, m, m)}')
            given[name] = array
    return given


def inertia_points(
    mass: ArrayLike,
    position: ArrayLike,
    translation_modes: ArrayLike,
    rotation_modes: ArrayLike | None = None,
    inertia: ArrayLike | None = None,
    com_offset: ArrayLike | None = None,
    second_translation: ArrayLike | None = None,
    second_rotation: ArrayLike | None = None,
) -> tuple[InertiaPoint, ...]:
    """Inertia points of a scene from arrays in the layout of the `.npz` (see ModalArrays).

    ValueError for a wrong shape.
    """
    optional = {
        "rotation_modes": rotation_modes, "inertia": inertia, "com_offset": com_offset,
        "second_translation": second_translation, "second_rotation": second_rotation,
    }  # fmt: skip
    given = {"mass": mass, "position": position, "translation_modes": translation_modes}
    given |= {name: value for name, value in optional.items() if value is not None}
    arrays = _shaped({name: _array(name, value) for name, value in given.items()})
    points = []
    for j in range(len(arrays.mass)):
        point = {
            "mass_kg": arrays.mass[j],
            "position_m": arrays.position[j],
            "translation_modes": arrays.translation_modes[j].T,
            "rotation_modes": arrays.rotation_modes[j].T if rotation_modes is not None else (),
            "inertia_kg_m2": arrays.inertia[j],
            "com_offset_m": arrays.com_offset[j],
        }
        for name in ("second_translation", "second_rotation"):
            if name in given:
                point[name] = np.moveaxis(getattr(arrays, name)[j], 0, -1)
        points.append(to_struct(plain(point), InertiaPoint))
    return tuple(points)


def _from_points(points: tuple[InertiaPoint, ...]) -> dict[str, Real]:
    if not points:
        return {}
    given = {
        "mass": _array("mass_kg", [p.mass_kg for p in points]),
        "position": _array("position_m", [p.position_m for p in points]),
        "translation_modes": _modes("translation_modes", [p.translation_modes for p in points]),
        "inertia": _array("inertia_kg_m2", [p.inertia_kg_m2 for p in points]),
        "com_offset": _array("com_offset_m", [p.com_offset_m for p in points]),
    }
    if any(p.rotation_modes for p in points):
        none = ((0.0, 0.0, 0.0),) * given["translation_modes"].shape[2]
        given["rotation_modes"] = _modes("rotation_modes", [p.rotation_modes or none for p in points])
    for name in ("second_translation", "second_rotation"):
        fields = [getattr(p, name) for p in points]
        if any(fields):
            given[name] = np.moveaxis(_array(name, fields), -1, 1)
    return given


def _modes(name: str, listed: list[tuple[tuple[float, float, float], ...]]) -> Real:
    """Mode shapes listed by point and mode (n,m,3) as (n,3,m)."""
    counts = sorted({len(modes) for modes in listed})
    if len(counts) > 1:
        raise ValueError(f'"{name}" has {counts[0]} modes at one point and {counts[-1]} at another')
    return np.asarray(listed, dtype=np.float64).reshape(len(listed), counts[0], 3).transpose(0, 2, 1)


def _array(name: str, value: ArrayLike) -> Real:
    try:
        array = np.asarray(value)
        if not np.iscomplexobj(array):
            return array.astype(np.float64)
    except (TypeError, ValueError):
        raise ValueError(f'"{name}" is not a full array of numbers: its rows differ in length') from None
    raise ValueError(f'"{name}" is complex: give real numbers')


def _shaped(given: dict[str, Real]) -> ModalArrays:
    missing = [name for name in REQUIRED if name not in given]
    if missing:
        raise ValueError(f'"{missing[0]}" is missing')
    n = given["mass"].shape[0] if given["mass"].ndim else 0
    m = given["translation_modes"].shape[-1] if given["translation_modes"].ndim else 0
    if m > MOST_MODES:
        raise ValueError(f'"translation_modes" has {m} modes, and a body may have {MOST_MODES}: leave the others out')
    if n == 0:
        raise ValueError('"mass" has no points: give the body at least one')
    shapes = {
        "mass": (n,), "position": (n, 3), "translation_modes": (n, 3, m), "rotation_modes": (n, 3, m),
        "inertia": (n, 3, 3), "com_offset": (n, 3), "stiffness": (m, m), "damping": (m, m),
    }  # fmt: skip
    second = {
        "second_translation": (n, 3, m, m), "second_rotation": (n, 3, m, m), "gravity_stiffness": (3, m, m),
        "gradient_stiffness": (3, 3, m, m),
    }  # fmt: skip
    known = shapes | second
    unknown = sorted(given.keys() - known.keys())
    if unknown:
        raise ValueError(f'"{unknown[0]}" is not one of {", ".join(known)}')
    for name, array in given.items():
        if array.shape != known[name]:
            raise ValueError(f'"{name}" has shape {array.shape}, expected {known[name]} (n={n} points, m={m} modes)')
    return ModalArrays(**{name: np.zeros(shape) for name, shape in shapes.items()} | given)
