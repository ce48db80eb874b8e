"""A flexible body with other modes: fewer or more for a beam, the lowest for a raw body; with its initial state."""

from __future__ import annotations

from typing import Any

import numpy as np
from msgspec.structs import replace
from scipy.linalg import eigh

from flexmb.advisor.modal_response import mass_shapes
from flexmb.modal import flexible_model
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import modal_integrals
from flexmb.scene.bodies import BeamBody, Level, ModalBody, ModalNode
from flexmb.scene.modal_data import inertia_points, modal_arrays, node_arrays
from flexmb.scene.schema import ModalState, Scene
from flexmb.surrogate.lumping import vector
from flexmb.typing import Real


def with_modes(scene: Scene, name: str, count: int, level: Level, static: bool, families: tuple[str, ...]) -> Scene:
    """The scene with `count` modes of the body `name`, at `level`.

    A beam gets its `count` lowest modes of `families` (its own if empty), and attachment modes if `static`; a raw body
    gets the `count` lowest eigenmodes in the span of its modes, or these modes themselves if `count` is their number.
    An initial modal state is projected onto the modes in the norm of kinetic energy. Raises ValueError if there are
    fewer modes.
    """
    body = next(each for each in scene.bodies if each.name == name)
    if isinstance(body, BeamBody):
        new: BeamBody | ModalBody = _beam(body, count, level, static, families)
    elif isinstance(body, ModalBody):
        new = _raw(body, count, level)
    else:
        raise ValueError(f'body "{name}" has no modes')
    bodies = tuple(new if each.name == name else each for each in scene.bodies)
    states = tuple(_projected(body, new, each) if each.body == name else each for each in scene.modal_states)
    return replace(scene, bodies=bodies, modal_states=states)


def mode_count(body: BeamBody | ModalBody) -> int:
    """The number of modes of the body, attachment modes included."""
    return flexible_model(body).mode_count


def _beam(beam: BeamBody, count: int, level: Level, static: bool, families: tuple[str, ...]) -> BeamBody:
    modes = replace(beam.modes, count=count, static=static, families=families or beam.modes.families)
    ratio = beam.modes.damping_ratio
    if isinstance(ratio, tuple):  # modes beyond those listed have the damping of the last
        total = mode_count(replace(beam, modes=replace(modes, damping_ratio=0.0)))
        modes = replace(modes, damping_ratio=(*ratio, *[ratio[-1]] * total)[:total])
    return replace(beam, modes=modes, level=level)


def _raw(body: ModalBody, count: int, level: Level) -> ModalBody:
    arrays = modal_arrays(body)
    every = arrays.translation_modes.shape[2]
    if count > every:
        raise ValueError(f'body "{body.name}" has {every} modes, not {count}')
    if count == every:
        return replace(body, level=level)
    mass = modal_integrals(flexible_model(body)).spatial_mass[:every, :every]
    X = eigh(arrays.stiffness, mass)[1][:, :count]
    X = X * np.sign(X[np.argmax(np.abs(X), axis=0), np.arange(count)])  # the largest component is positive
    nodes = tuple(
        ModalNode(
            name=node.name, position_m=node.position_m, quaternion=node.quaternion,
            translation_modes=_combined(node.translation_modes, X), rotation_modes=_combined(node.rotation_modes, X),
            **_second_order(node, X),
        )
        for node in body.nodes
    )  # fmt: skip
    points = inertia_points(
        arrays.mass, arrays.position, arrays.translation_modes @ X, arrays.rotation_modes @ X, arrays.inertia,
        arrays.com_offset, _square(arrays.second_translation, X), _square(arrays.second_rotation, X),
    )  # fmt: skip
    geometric = {
        name: _nested(_square(value, X))
        for name in ("gravity_stiffness", "gradient_stiffness")
        if (value := getattr(arrays, name)) is not None
    }
    return replace(
        body, file=None, points=points, nodes=nodes, level=level,
        stiffness=_nested(_symmetric(arrays.stiffness, X)), damping=_nested(_symmetric(arrays.damping, X)), **geometric,
    )  # fmt: skip


def _second_order(node: ModalNode, X: Real) -> dict[str, Any]:
    """The second-order data of a node in the modes X (m,k), by the keys of the scene."""
    found = {}
    for name, array in node_arrays(node).items():
        turned = _square(array, X)
        found[name] = _nested(turned if name == "force_stiffness" else np.moveaxis(turned, 0, -1))
    return found


def _nested(array: Real) -> tuple[Any, ...]:
    """An array as a scene has it."""
    return tuple(map(_nested, array)) if array.ndim > 1 else tuple(array.tolist())


def _square(array: Real | None, X: Real) -> Any:
    """Values for pairs of modes (...,m,m) transformed to the modes X (m,k): (...,k,k)."""
    return None if array is None else X.T @ array @ X


def _symmetric(matrix: Real, X: Real) -> Real:
    """`_square` of a symmetric matrix, without the asymmetry of rounding."""
    turned = X.T @ matrix @ X
    return (turned + turned.T) / 2.0


def _combined(shapes: tuple[tuple[float, float, float], ...], X: Real) -> tuple[tuple[float, float, float], ...]:
    return tuple(vector(shape) for shape in X.T @ np.array(shapes))


def _projected(old: BeamBody | ModalBody, new: BeamBody | ModalBody, state: ModalState) -> ModalState:
    """The initial state in the new modes that is nearest in the norm of kinetic energy."""
    # At level full both models have the same inertia points; at stiffened each has its own equivalent masses.
    before, after = (flexible_model(replace(each, level="full")) for each in (old, new))
    onto = np.linalg.solve(_products(after, after), _products(after, before))
    rates = np.array(state.rates or [0.0] * before.mode_count)
    return ModalState(
        body=state.body,
        coordinates=tuple((onto @ np.array(state.coordinates)).tolist()),
        rates=tuple((onto @ rates).tolist()) if np.any(rates) else (),
    )


def _products(a: FlexibleModel, b: FlexibleModel) -> Real:
    """Inner products (m_a, m_b), in the norm of kinetic energy, of the modes of two models with the same points."""
    moved_a, moved_b = mass_shapes(a), mass_shapes(b)
    turning = np.einsum("pim,pij,pjn->mn", a.rotation, a.inertia, b.rotation, optimize=True)
    return np.einsum("p,pim,pin->mn", a.mass, moved_a, moved_b, optimize=True) + turning

