"""Checks of masses and inertia tensors, whose rounding is measured by how far a scene's bodies reach."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from flexmb.scene.bodies import BeamBody, RigidBody
from flexmb.scene.check.walk import sound
from flexmb.scene.columns import column
from flexmb.scene.problems import Defect, Place
from flexmb.scene.quantities import LARGEST
from flexmb.scene.rounding import PRINTED, tensor_dust
from flexmb.scene.schema import Scene
from flexmb.scene.tree import GROUND
from flexmb.typing import Real


def reach(scene: Scene) -> float:
    """The largest distance (m) from the origin of a body to its mass centre, its nodes and hinges, and along a beam.

    Where bodies are, an orbit for instance, does not count: no inertia is computed from that.
    """
    return max((float(np.max(np.linalg.norm(arm, axis=1), initial=0.0)) for arm in _arms(scene)), default=0.0)


def _arms(scene: Scene) -> Iterator[Real]:
    rigid = [body for body in scene.bodies if isinstance(body, RigidBody)]
    yield column(rigid, "com_m", 3)
    yield column([node for body in rigid for node in body.nodes], "position_m", 3)
    yield np.array([[body.length_m] for body in scene.bodies if isinstance(body, BeamBody)]).reshape(-1, 1)
    yield column(scene.hinges, "child_position_m", 3)
    yield column([hinge for hinge in scene.hinges if hinge.parent != GROUND], "parent_position_m", 3)


def rigid_bodies(scene: Scene) -> Iterator[Defect]:
    """Every rigid body has an inertia tensor that a distribution of its mass can have."""
    rigid = {i: body for i, body in enumerate(scene.bodies) if isinstance(body, RigidBody)}
    doubtful = _doubtful(list(rigid.values()))
    size = reach(scene) if any(doubtful) else 0.0
    whole = sum(body.mass_kg for body in rigid.values() if body.mass_kg > 0.0)
    for place, body in sound(scene, "bodies", [i for i, doubt in zip(rigid, doubtful, strict=True) if doubt]):
        dust = tensor_dust(body.mass_kg if body.mass_kg > 0.0 else whole, size)
        yield from tensor(place.key("inertia_kg_m2"), body.inertia_kg_m2, dust)
        if body.mass_kg == 0.0 and np.max(np.abs(body.inertia_kg_m2)) > dust:
            what = "a body without mass cannot have inertia"
            yield Defect(str(place.key("mass_kg")), what, "give its mass, or set its inertia to zero too")


def _doubtful(bodies: Sequence[RigidBody]) -> list[bool]:
    """Whether the mass or the tensor of each body may be wrong, with half of the tolerance of `tensor`."""
    m, J = column(bodies, "mass_kg"), column(bodies, "inertia_kg_m2", 3, 3)
    J[~np.all(np.abs(J) <= LARGEST, axis=(1, 2))] = 0.0  # reported by `numbers`
    slack = 0.5 * PRINTED * np.max(np.abs(J), axis=(1, 2), initial=0.0)
    skew = np.max(np.abs(J - np.swapaxes(J, 1, 2)), axis=(1, 2), initial=0.0) > slack
    low, middle, high = np.linalg.eigvalsh(J).T
    impossible = (low < -slack) | (low + middle < high - slack)
    doubtful: list[bool] = ((m <= 0.0) | skew | impossible).tolist()
    return doubtful


def tensor(place: Place, value: ArrayLike, dust: float) -> Iterator[Defect]:
    """An inertia tensor is symmetric, positive semidefinite, and its moments fulfil J1 + J2 >= J3.

    `dust` (kg m²): what rounding leaves of terms m r² that cancel, where r is a length of the problem.
    """
    inertia = np.asarray(value, dtype=np.float64)
    slack = PRINTED * float(np.max(np.abs(inertia), initial=0.0)) + dust
    gap = np.abs(inertia - inertia.T)
    if np.any(gap > slack):
        i, j = np.unravel_index(int(np.argmax(gap)), gap.shape)
        what = f"the inertia is not symmetric: [{i}][{j}] is {inertia[i, j]:g}, [{j}][{i}] is {inertia[j, i]:g}"
        yield Defect(str(place), what, "give the same value on both sides of the diagonal")
        return
    low, middle, high = np.linalg.eigvalsh(inertia)
    moments = f"its principal moments are {low:.6g}, {middle:.6g}, {high:.6g} kg m²"
    if low < -slack:
        remedy = "check the signs of the products: the tensor's off-diagonal elements are -∫ x y dm"
        yield Defect(str(place), f"the inertia is not positive semidefinite: {moments}", remedy)
    elif low + middle < high - slack:
        remedy = "no mass distribution has this tensor: the two smaller moments must add up to the largest at least"
        yield Defect(str(place), f"the inertia breaks the triangle inequality: {moments}", remedy)
