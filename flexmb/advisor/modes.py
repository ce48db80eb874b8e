"""A flexible body with other modes: fewer or more for a beam, the lowest for a raw body; with its initial state.

A beam of level exact has strains in their place.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import ceil
from typing import Any

import numpy as np
from msgspec.structs import replace
from scipy.linalg import eigh

from flexmb.advisor.modal_response import mass_shapes
from flexmb.modal import flexible_model
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import modal_integrals
from flexmb.scene.bodies import FAMILIES, BeamBody, Family, Level, ModalBody, ModalNode, Modes, StrainPolynomials
from flexmb.scene.modal_data import inertia_points, modal_arrays, node_arrays
from flexmb.scene.pieces import AT_END, across
from flexmb.scene.rest_curve import is_curved
from flexmb.scene.rigid_equivalent import vector
from flexmb.scene.schema import ModalState, Scene
from flexmb.scene.strains import CURVATURES, SHEARED, Strain, points_of_piece, polynomials_of, strains
from flexmb.surrogate import cut_where_loaded, substructured
from flexmb.typing import Real


def with_modes(scene: Scene, name: str, count: int, level: Level, static: bool, families: tuple[str, ...]) -> Scene:
    """The scene with `count` modes of the body `name`, at `level`.

    A beam gets its `count` lowest modes of `families` (its own if empty), and attachment modes if `static`; a raw body
    gets the `count` lowest eigenmodes in the span of its modes, or these modes themselves if `count` is their number.
    An initial modal state is projected onto the modes in the norm of kinetic energy. Raises ValueError if there are
    fewer modes.
    """
    body = next(body for body in scene.bodies if body.name == name)
    if isinstance(body, BeamBody):
        new: BeamBody | ModalBody = _beam(body, count, level, static, families)
    elif isinstance(body, ModalBody):
        new = _raw(body, count, level)
    else:
        raise ValueError(f'body "{name}" has no modes')
    bodies = tuple(new if body.name == name else body for body in scene.bodies)
    states = tuple(_projected(body, new, state) if state.body == name else state for state in scene.modal_states)
    return replace(scene, bodies=bodies, modal_states=states)


def with_strains(
    scene: Scene, name: str, polynomials: int, pieces: int, stretching: bool, families: tuple[str, ...]
) -> Scene:
    """The scene with the beam `name` in `pieces` of level exact, welded to one another; where its strains jump, it is
    cut too.

    They have `polynomials` of each curvature of `families` (of the beam's own if empty); if `stretching` two fewer, but
    one at least, of the stretch and the shears that it has. An initial modal state is projected as by `with_modes`.
    A beam without curvatures has its stretch and shears instead. Raises ValueError for a beam that has no stretch
    beside its curvatures, and for several pieces of one that starts bent.
    """
    body = next(body for body in scene.bodies if body.name == name)
    if not isinstance(body, BeamBody):
        raise ValueError(f'body "{name}" is no beam, and has no strains')
    chosen = _strains(body, polynomials, stretching, families)
    bent = any(state.body == name for state in scene.modal_states)
    ends = _between(scene, body, pieces)
    if pieces > 1 or (ends != 1 and not bent):
        return substructured(scene, name, ends, level="exact", polynomials=chosen)
    modes = replace(
        body.modes, count=0, polynomials=chosen, static=False, boundary="clamped-free", pieces=1, points=None
    )
    new = _cut(scene, replace(body, level="exact", mass="consistent", modes=modes))
    new = _damped(new, new.modes)
    bodies = tuple(new if body.name == name else body for body in scene.bodies)
    states = tuple(_projected(body, new, state) if state.body == name else state for state in scene.modal_states)
    return replace(scene, bodies=bodies, modal_states=states)


def _cut(scene: Scene, beam: BeamBody) -> BeamBody:
    """The beam cut where its strains jump in this scene."""
    bodies = tuple(beam if body.name == beam.name else body for body in scene.bodies)
    cut_scene = cut_where_loaded(replace(scene, bodies=bodies, modal_states=()), beam.name)
    return next(body for body in cut_scene.bodies if isinstance(body, BeamBody) and body.name == beam.name)


def _between(scene: Scene, beam: BeamBody, pieces: int) -> int | list[float]:
    """`pieces`, or, if strains jump inside, the places (m) that cut the beam there and in parts as short as these."""
    jumps = across(scene, replace(beam, modes=replace(beam.modes, pieces=1, cuts=())))
    if not jumps:
        return pieces
    ends: list[float] = []
    for left, right in pairwise((0.0, *jumps, beam.length_m)):
        count = max(1, ceil(pieces * (right - left) / beam.length_m - AT_END))
        ends += np.linspace(left, right, count + 1)[1:].tolist()
    return ends[:-1]


def all_strains(beam: BeamBody) -> tuple[Strain, ...]:
    """The strains that a beam can have: those of its polynomials or families, else all of its theory, also the stretch
    that level exact leaves out by default."""
    return strains(beam if beam.modes.polynomials is not None else replace(beam, level="full"))


def all_families(beam: BeamBody) -> tuple[Family, ...]:
    """The families of `all_strains`."""
    return tuple(family for family in FAMILIES if family in all_strains(beam))


def _strains(beam: BeamBody, count: int, stretching: bool, families: tuple[str, ...]) -> StrainPolynomials:
    own = all_strains(beam)
    if families:
        own = tuple(family for family in own if family in families or dict(SHEARED).get(family) in families)
    curved = (
        tuple(family for family in own if family in CURVATURES) or own
    )  # a rod that only stretches has no other strain
    if stretching and own == curved:
        raise ValueError(f'beam "{beam.name}" has no stretch or shear: its families and its theory exclude them')
    return polynomials_of(own if stretching else curved, count)


def mode_count(body: BeamBody | ModalBody) -> int:
    """The number of modes of the body, attachment modes included."""
    return flexible_model(body).mode_count


def _beam(beam: BeamBody, count: int, level: Level, static: bool, families: tuple[str, ...]) -> BeamBody:
    if level == "exact" or is_curved(beam):
        raise ValueError(f'beam "{beam.name}": level "exact" has strains, and other levels have straight beams only')
    own = beam.modes.families if beam.modes.polynomials is None else all_families(beam)
    modes = replace(
        beam.modes, count=count, static=static, families=families or own,
        polynomials=None, pieces=1, cuts=None, points=None,
    )  # fmt: skip
    return _damped(replace(beam, level=level), modes)


def _damped(beam: BeamBody, modes: Modes) -> BeamBody:
    """The beam with these modes; where damping is listed, those beyond the list have the damping of the last."""
    ratio = modes.damping_ratio
    if isinstance(ratio, tuple):
        total = mode_count(replace(beam, modes=replace(modes, damping_ratio=0.0)))
        modes = replace(modes, damping_ratio=(*ratio, *[ratio[-1]] * total)[:total])
    return replace(beam, modes=modes)


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
        stiffness=_nested(_symmetric(arrays.stiffness, X)), stiffness_factor=1.0,
        damping=_nested(_symmetric(arrays.damping, X)), **geometric,
    )  # fmt: skip


def _second_order(node: ModalNode, X: Real) -> dict[str, Any]:
    """The second-order data of a node in the modes X (m,k), by the keys of the scene."""
    sizes = {}
    for name, array in node_arrays(node).items():
        turned = _square(array, X)
        sizes[name] = _nested(turned if name == "force_stiffness" else np.moveaxis(turned, 0, -1))
    return sizes


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
    if {old.level, new.level} > {"exact"}:
        raise ValueError(f'body "{new.name}" starts bent: a bend in strains is not one in modes')
    before, after = _on_equal_points(old, new)
    onto = np.linalg.solve(_products(after, after), _products(after, before))
    rates = np.array(state.rates or [0.0] * before.mode_count)
    return ModalState(
        body=state.body,
        coordinates=tuple((onto @ np.array(state.coordinates)).tolist()),
        rates=tuple((onto @ rates).tolist()) if np.any(rates) else (),
    )


def _on_equal_points(*bodies: BeamBody | ModalBody) -> Iterator[FlexibleModel]:
    """The models with equal inertia points: at stiffened each has its own equivalent masses, at exact Gauss points."""
    exact = [body for body in bodies if isinstance(body, BeamBody) and body.level == "exact"]
    for body in bodies:
        if isinstance(body, BeamBody) and body.level == "exact":
            points = max(map(points_of_piece, exact))
            yield flexible_model(replace(body, modes=replace(body.modes, points=points)))
        else:
            yield flexible_model(replace(body, level="full"))


def _products(a: FlexibleModel, b: FlexibleModel) -> Real:
    """Inner products (m_a, m_b), in the norm of kinetic energy, of the modes of two models with the same points."""
    moved_a, moved_b = mass_shapes(a), mass_shapes(b)
    turning = np.einsum("pim,pij,pjn->mn", a.rotation, a.inertia, b.rotation, optimize=True)
    return np.einsum("p,pim,pin->mn", a.mass, moved_a, moved_b, optimize=True) + turning
