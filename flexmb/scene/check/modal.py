"""Checks of raw modal bodies (complete arrays, possible stiffness and modes; at level stiffened a second-order field,
or the stiffness from which it follows), and of initial modal states.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from math import pi, sqrt
from typing import assert_never

import numpy as np
from numpy.typing import ArrayLike

from flexmb.scene.bodies import BeamBody, ModalBody, RigidBody, SidBody
from flexmb.scene.check import inertia
from flexmb.scene.check.beams import mode_count
from flexmb.scene.check.exact_beams import or_whole
from flexmb.scene.check.walk import entries, sound
from flexmb.scene.modal_data import ModalArrays, modal_arrays, node_arrays
from flexmb.scene.problems import Defect, Doubt, Place
from flexmb.scene.quantities import LARGEST
from flexmb.scene.rounding import PRINTED, ROUNDING, tensor_dust
from flexmb.scene.schema import Scene
from flexmb.scene.sizes import MOST_BYTES, modes_memory
from flexmb.typing import Real

FULL = 'or use level "full", which no load stiffens'


def second_order(place: Place, body: ModalBody, arrays: ModalArrays) -> Iterator[Defect]:
    """Second-order data of a body and its nodes is consistent, and at level stiffened complete."""
    for i, node in enumerate(body.nodes):
        spot = place.key("nodes", i).named(f'node "{node.name}"')
        try:
            given = node_arrays(node)
        except ValueError as error:
            yield Defect(str(spot), str(error), "give three m x m matrices, or m x m vectors")
            continue
        moves = _largest(node.translation_modes, node.rotation_modes) > ROUNDING * _largest(arrays.translation_modes)
        if "force_stiffness" in given and len(given) > 1:
            what = "second-order field and force_stiffness are given"
            yield Defect(str(spot), what, "give one of them: each follows from the other")
        elif not given and moves and body.level == "stiffened":
            remedy = f"give its second_translation (zeros, if it has none) or force_stiffness, {FULL}"
            yield Defect(str(spot), "nothing says how a load at this node stiffens the body", remedy)
    yield from _second_order_of_points(place, body, arrays)


def _second_order_of_points(place: Place, body: ModalBody, arrays: ModalArrays) -> Iterator[Defect]:
    field = [name for name in ("second_translation", "second_rotation") if name in arrays.given]
    loads = [name for name in ("gravity_stiffness", "gradient_stiffness") if name in arrays.given]
    if field and loads:
        what = f"both {field[0]} and {loads[0]} are given"
        yield Defect(str(place), what, "give one of them: the stiffness follows from the field")
    elif field == ["second_rotation"]:
        remedy = "give second_translation too (zeros, if there is none)"
        yield Defect(str(place), "second_rotation is given without second_translation", remedy)
    elif len(loads) == 1:
        what = f"of gravity_stiffness and gradient_stiffness, only {loads[0]} is given"
        yield Defect(str(place), what, "give both")
    elif body.level == "stiffened" and not field and not loads:
        what = 'level "stiffened" needs a second-order field, and the body has none'
        remedy = "give second_translation of its points, or gravity_stiffness and gradient_stiffness"
        yield Defect(str(place.key("level")), what, f"{remedy}, {FULL}")


def _largest(*shapes: ArrayLike) -> float:
    return max(float(np.max(np.abs(shape), initial=0.0)) for shape in shapes)


# Lowest frequency times size (m/s). The upper limit is the wave speed in the stiffest materials, which no body's first
# mode reaches; the lower limit is a membrane of a kilometre at a microhertz.
SPEED = (1e-3, 20_000.0)


def modal_bodies(scene: Scene) -> Iterator[Defect]:
    """Problems of every raw modal body."""
    given = [i for i, body in enumerate(scene.bodies) if isinstance(body, ModalBody | SidBody)]
    for place, body in sound(scene, "bodies", given):
        if body.level == "exact":
            what = 'level "exact" is that of strains along a beam, which modes of a body do not have'
            yield Defect(str(place.key("level")), what, 'use "full" or "stiffened", or give a beam by its sections')
    modal = [i for i, body in enumerate(scene.bodies) if isinstance(body, ModalBody)]
    for place, body in sound(scene, "bodies", modal):
        arrays = yield from _read(place, body)
        if arrays is not None:
            yield from _points(place, body, arrays)
            yield from _matrices(place, body, arrays)
            yield from _shapes(place, body, arrays)
            yield from second_order(place, body, arrays)


def modal_states(scene: Scene) -> Iterator[Defect]:
    """Initial modal coordinates belong to a flexible body and number as many as its modes."""
    bodies = {body.name: body for body in scene.bodies}
    for place, state in entries(scene, "modal_states"):
        body = bodies.get(state.body)
        if body is None or isinstance(body, SidBody):
            continue
        if isinstance(body, RigidBody) or body.level == "rigid":
            yield Defect(str(place.key("body")), f'body "{body.name}" is rigid: it has no modes', "leave it out")
            continue
        count = _count(body)
        for key, given, required in (("coordinates", state.coordinates, True), ("rates", state.rates, False)):
            if count is not None and len(given) != count and (given or required):
                what = f'{len(given)} modal {key} for the {count} modes of body "{body.name}"'
                yield Defect(str(place.key(key)), what, f"give {count} values{or_whole(body)}")


def _count(body: BeamBody | ModalBody) -> int | None:
    """Number of modes of a body; None if it is unknown because of a defect that is reported with the body."""
    match body:
        case BeamBody():
            return mode_count(body)
        case ModalBody():
            try:
                return modal_arrays(body).translation_modes.shape[2]
            except (OSError, ValueError):
                return None
        case _:
            assert_never(body)


def _read(place: Place, body: ModalBody) -> Generator[Defect, None, ModalArrays | None]:
    """Yields what is wrong with the data and returns its arrays, or None."""
    if bool(body.points) == (body.file is not None):
        what = "both points and file are given" if body.points else "neither points nor file is given"
        yield Defect(str(place), what, "give the points inline, or the name of an .npz file")
        return None
    spot = place.key("file" if body.file is not None else "points")
    try:
        arrays = modal_arrays(body)
    except OSError as error:
        remedy = "put the file beside the scene file, or correct its name"
        yield Defect(str(spot), f'cannot read "{body.file}": {error.strerror or error}', remedy)
    except ValueError as error:
        yield Defect(str(spot), str(error), "give arrays of the shapes that the reference of ModalBody lists")
    else:
        huge = (name for name, array in arrays.given.items() if not np.all(np.abs(array) <= LARGEST))
        broken = next(huge, None)
        if broken is None:
            return arrays
        remedy = f"give finite numbers, of at most {LARGEST:g}"
        yield Defect(str(spot), f'"{broken}" holds a NaN, or a number beyond {LARGEST:g}', remedy)
    return None


def _points(place: Place, body: ModalBody, arrays: ModalArrays) -> Iterator[Defect]:
    spot = place.key("file" if body.file is not None else "points")
    size = float(np.max(np.linalg.norm(arrays.position, axis=1)))
    for j, (mass, tensor) in enumerate(zip(arrays.mass, arrays.inertia, strict=True)):
        point = spot.key(j) if body.file is None else spot.named(f"point {j}")
        if body.file is not None and mass < 0.0:  # of points in the scene, `numbers` sees it
            yield Defect(str(point), f"negative mass: {mass:g} kg", "give a mass of at least zero")
        if np.any(tensor):
            yield from inertia.tensor(point, tensor, tensor_dust(mass, size))
    if not np.any(arrays.mass > 0.0):
        yield Defect(str(spot), "the body has no mass", "give its points mass")


def _matrices(place: Place, body: ModalBody, arrays: ModalArrays) -> Iterator[Defect]:
    n, _, m = arrays.translation_modes.shape
    if (memory := modes_memory(body.level, n, m)) > MOST_BYTES:
        what = f"{m} modes of {n} points would take {memory / 2**30:.2g} GiB at level \"{body.level}\""
        yield Defect(str(place), what, "leave modes out, join points, or choose another level")
    if m == 0:
        if body.level != "rigid":
            yield Defect(str(place), "the body has no modes", 'make it a rigid body, or its level "rigid"')
        return
    if not np.any(arrays.stiffness):
        yield Defect(str(place.key("stiffness")), "the modes have no stiffness", f"give the {m} x {m} modal stiffness")
        return
    for name, matrix in (("stiffness", arrays.stiffness), ("damping", arrays.damping)):
        slack = PRINTED * float(np.max(np.abs(matrix)))
        gap = np.abs(matrix - matrix.T)
        if np.any(gap > slack):
            i, j = np.unravel_index(int(np.argmax(gap)), gap.shape)
            what = f"the {name} is not symmetric: [{i}][{j}] is {matrix[i, j]:g}, [{j}][{i}] is {matrix[j, i]:g}"
            yield Defect(str(place.key(name)), what, "give a symmetric matrix")
        elif (lowest := float(np.linalg.eigvalsh(matrix)[0])) < -slack:
            what = f"the {name} is indefinite: its lowest eigenvalue is {lowest:.3g}"
            remedy = "give a positive semidefinite matrix: check its signs"
            yield Doubt(str(place.key(name)), what, remedy, "negative_" + name)


def _shapes(place: Place, body: ModalBody, arrays: ModalArrays) -> Iterator[Defect]:
    m = arrays.translation_modes.shape[2]
    for i, node in enumerate(body.nodes):
        for key in ("translation_modes", "rotation_modes"):
            if len(getattr(node, key)) != m:
                what = f"{len(getattr(node, key))} shapes for {m} modes"
                spot = place.key("nodes", i, key).named(f'node "{node.name}"')
                yield Defect(str(spot), what, "give one vector for each mode")
    if m == 0:
        return
    if body.boundary == "clamped-free":
        yield from _clamp(place, body, arrays)
    M, coupling, rigid = _mass_blocks(arrays)
    d = np.diag(M)
    # Gram matrices of n points and m modes are known to m n round-offs once scaled to unit diagonal.
    slack = max(m * len(arrays.mass) * np.finfo(float).eps, ROUNDING)
    if np.any(d <= ROUNDING**2 * np.max(d)):
        n = int(np.argmin(d))
        yield Defect(str(place), f"mode {n} moves no mass", "leave the mode out, or give the points it moves mass")
        return
    scale = 1.0 / np.sqrt(np.outer(d, d))
    if np.linalg.eigvalsh(M * scale)[0] < slack:
        yield Defect(str(place), "the modes are not independent: their mass matrix is singular", "drop one of them")
        return
    floating = M - coupling.T @ np.linalg.pinv(rigid, rcond=ROUNDING, hermitian=True) @ coupling
    if body.boundary == "free-free" and np.linalg.eigvalsh(floating * scale)[0] < slack:
        remedy = "the body frame carries the rigid-body motion: remove it from the modes"
        yield Defect(str(place), "a combination of the free-free modes is a rigid-body motion", remedy)
        return
    if body.boundary == "clamped-free" and _is_loose(arrays, floating, scale, slack):
        what = "a combination of the clamped modes is a rigid-body motion without strain energy"
        yield Defect(str(place), what, "the hinge carries the rigid-body motion: remove it from the modes")
        return
    yield from _frequency(place, arrays, M)


def _is_loose(arrays: ModalArrays, floating: Real, scale: Real, slack: float) -> bool:
    """Whether a combination of the modes is a rigid-body motion of the points without strain energy.

    Modes that move all points as a rigid body are no defect by themselves: a lump at the tip of a beam has such modes.
    """
    stiffness = arrays.stiffness * scale
    values, vectors = np.linalg.eigh(floating * scale)
    rigid = vectors[:, values < slack]
    held = np.linalg.eigvalsh(rigid.T @ stiffness @ rigid)
    return bool(np.any(held <= slack * float(np.max(np.abs(stiffness), initial=0.0))))


def _clamp(place: Place, body: ModalBody, arrays: ModalArrays) -> Iterator[Defect]:
    """Clamped modes must vanish at the body origin: at the node listed there, and at a point that sits there."""
    remedy = 'subtract the rigid-body part from the mode, or make the boundary "free-free"'
    size = float(np.max(np.linalg.norm(arrays.position, axis=1)))
    largest = float(np.max(np.abs(arrays.translation_modes)))
    shapes = [
        (place.key("nodes", i), np.array(node.translation_modes).T, np.array(node.rotation_modes).T)
        for i, node in enumerate(body.nodes)
        if node.name == "origin" and node.translation_modes and node.rotation_modes
    ]
    shapes += [
        (place.key("points", int(j)), arrays.translation_modes[j], np.zeros((3, 1)))
        for j in np.flatnonzero(np.linalg.norm(arrays.position, axis=1) <= PRINTED * size)
        if size > 0.0
    ]
    for spot, translation, rotation in shapes:
        moved = np.max(np.abs(translation), axis=0) > PRINTED * largest
        turned = size * np.max(np.abs(rotation), axis=0) > PRINTED * largest
        if np.any(moved) or np.any(turned):
            n = int(np.argmax(moved if np.any(moved) else turned))
            yield Defect(str(spot), f"mode {n} moves the clamp: it has rigid-body content", remedy)


def _mass_blocks(arrays: ModalArrays) -> tuple[Real, Real, Real]:
    """Mass matrices at rest: modes (m,m), rigid motion [rotation; translation] against modes (6,m), rigid (6,6)."""
    n, _, m = arrays.translation_modes.shape
    centre = arrays.position + arrays.com_offset
    modes = arrays.translation_modes - np.cross(arrays.com_offset[:, :, None], arrays.rotation_modes, axis=1)
    one = np.broadcast_to(np.eye(3), (n, 3, 3))
    arm = -np.cross(centre[:, :, None], one, axis=1)  # w x r, column by column
    velocity = np.concatenate([arm, one, modes], axis=2)
    turn = np.concatenate([one, np.zeros_like(one), arrays.rotation_modes], axis=2)
    M = np.einsum("nia,n,nib->ab", velocity, arrays.mass, velocity)
    M += np.einsum("nia,nij,njb->ab", turn, arrays.inertia, turn)
    return M[6:, 6:], M[:6, 6:], M[:6, :6]


def _frequency(place: Place, arrays: ModalArrays, M: Real) -> Iterator[Doubt]:
    """An error of units of stiffness or mass shows in the product of the lowest frequency and the body's size."""
    stiffness = (arrays.stiffness + arrays.stiffness.T) / 2.0
    from scipy.linalg import eigh  # SciPy is slow to import, and few scenes have raw modes

    lowest = float(eigh(stiffness, M, eigvals_only=True, subset_by_index=[0, 0])[0])
    size = float(np.max(np.linalg.norm(arrays.position, axis=1)))
    if lowest <= 0.0 or size == 0.0:
        return
    frequency = sqrt(lowest) / (2.0 * pi)
    if not SPEED[0] <= frequency * size <= SPEED[1]:
        what = f"the lowest frequency is {frequency:.3g} Hz for a body of {size:.3g} m: no usual structure does that"
        remedy = "check the units of stiffness (N/m for modes without unit) against mass (kg): a factor of 1000, say?"
        yield Doubt(str(place.key("stiffness")), what, remedy, "modal_frequency")
