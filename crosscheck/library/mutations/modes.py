"""Mutations of flexible bodies: their modes, their sections and the terms of their level."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from msgspec.structs import replace

from crosscheck.library.case import CaseError
from crosscheck.library.mutations.edits import bodies, of_body, whole
from crosscheck.library.mutations.mirror import along, mirrors, within
from crosscheck.library.mutations.mutation import Mutation, SceneChange
from crosscheck.library.mutations.resting import rests, twists_only
from flexmb.scene.bodies import BeamBody, BeamStation, Body, Level, ModalBody, ModalNode
from flexmb.scene.rest_curve import is_curved
from flexmb.scene.schema import Scene
from flexmb.scene.sections import ABOUT_Y, ABOUT_Z, matrix
from flexmb.scene.strains import polynomials
from flexmb.surrogate import modal_points

ROUNDING = 1e-9  # of an eigenproblem and of sums over its modes


def _unstiffened(scene: Scene, target: str) -> Scene:
    """Levels stiffened and exact become full (of body `target`, or of all)."""

    def changed(body: Body) -> Body:
        wanted = target in ("", body.name) and body.level in ("stiffened", "exact")
        return _of_small_deflection(body, "full") if wanted else body

    return replace(scene, bodies=tuple(map(changed, scene.bodies)))


@of_body
def _undeformed(body: Body) -> Body:
    """Any level above ruthless becomes ruthless: inertia of the undeformed body."""
    wanted = body.level in ("full", "stiffened", "linear", "exact")
    return _of_small_deflection(body, "ruthless") if wanted else body


def _of_small_deflection(body: Body, level: Level) -> Body:
    """The body at a level of modes; a beam of level exact gets as many of them as it has polynomials of a strain."""
    if not isinstance(body, BeamBody) or body.level != "exact":
        return replace(body, level=level)
    if is_curved(body):
        raise CaseError(f'beam "{body.name}" is curved at rest, which only level "exact" can express')
    count = max(polynomials(body).values())
    modes = replace(body.modes, count=count, polynomials=None, pieces=1, cuts=None, points=None)
    return replace(body, level=level, modes=modes, elements=max(body.elements, 2 * count))


def _twists_in_place(scene: Scene, target: str) -> str:
    """Of a clamped bar that only twists, the frame is at rest and every section stays balanced on its axis."""
    body = next(body for body in scene.bodies if body.name == target)
    if twists_only(body) and rests(scene, target):
        return "the bar is clamped and only twists, which moves no mass centre"
    return ""


def _of_modes(name: str, change: Callable[[ModalBody], ModalBody]) -> SceneChange:
    """A change of the modes of one body; a beam is made the points and modes that it stands for."""

    def changed(scene: Scene, target: str) -> Scene:
        alone = _in_modes(scene, target)
        if not isinstance(alone, ModalBody) or not alone.points:
            raise CaseError(f'control "{name}" changes beams and inline modal bodies, not "{target}"')
        spoilt = change(alone)
        return of_body(lambda body: spoilt)(scene, target)

    return changed


def _in_modes(scene: Scene, target: str) -> Body | None:
    """The body called `target`, a beam as the points and modes that it stands for."""
    alone = next((body for body in scene.bodies if body.name == target), None)
    if isinstance(alone, BeamBody) and alone.level == "exact":
        raise CaseError(f'beam "{alone.name}" is of level "exact": it has strains, and its points have no modes')
    if isinstance(alone, BeamBody):
        return modal_points(replace(scene, bodies=(alone,))).bodies[0]
    return alone


def _out_of_the_plane(scene: Scene, target: str) -> str:
    """Of a scene that is its own image in a mirror, modes along the mirror's normal are never excited."""
    body = _in_modes(scene, target)
    first = [node for node in body.nodes if node.translation_modes] if isinstance(body, ModalBody) else []
    for axis in mirrors(scene):
        moves = all(along(node.translation_modes[0], axis) for node in first)
        turns = all(within(node.rotation_modes[0], axis) for node in first if node.rotation_modes)
        if first and moves and turns:
            return "the first mode is normal to the plane in which everything moves, by symmetry"
    return ""


def _sign(body: ModalBody) -> ModalBody:
    """The first mode with opposite sign in the nodes, as it was in the points."""

    def spoilt(node: ModalNode) -> ModalNode:
        return replace(
            node,
            translation_modes=_first_opposite(node.translation_modes),
            rotation_modes=_first_opposite(node.rotation_modes),
        )

    return replace(body, nodes=tuple(map(spoilt, body.nodes)))


def _first_opposite(modes: tuple) -> tuple:
    return tuple(tuple(-value for value in mode) if i == 0 else mode for i, mode in enumerate(modes))


def _order(body: ModalBody) -> ModalBody:
    """Rows and columns of the first two modes exchanged in the stiffness alone."""
    if len(body.stiffness) < 2:
        raise CaseError(f'body "{body.name}" has fewer than two modes to be exchanged')
    order = [1, 0, *range(2, len(body.stiffness))]
    stiffness = tuple(tuple(body.stiffness[i][j] for j in order) for i in order)
    return replace(body, stiffness=stiffness)


def _equally_stiff(scene: Scene, target: str) -> str:
    """Of two modes that are equally stiff and coupled alike the order is a name, say those of a round section."""
    body = _in_modes(scene, target)
    if not isinstance(body, ModalBody):
        return ""
    right, wrong = (np.asarray(matrix.stiffness) for matrix in (body, _order(body)))
    same = np.max(np.abs(wrong - right)) <= ROUNDING * np.max(np.abs(right[:2, :2]))
    return "the first two modes are equally stiff: exchanged, their stiffness is the same" if same else ""


def _no_rotation(body: ModalBody) -> ModalBody:
    """The body without slopes of modes at its nodes."""

    def flat(node: ModalNode) -> ModalNode:
        return replace(node, rotation_modes=tuple((0.0, 0.0, 0.0) for _ in node.rotation_modes))

    return replace(body, nodes=tuple(map(flat, body.nodes)))


@of_body
def _section(body: Body) -> Body:
    if not isinstance(body, BeamBody):
        raise CaseError(f'control "section_axes" changes beams, not "{body.name}"')
    return replace(body, stations=tuple(map(_bent_across, body.stations)))


def _bent_across(station: BeamStation) -> BeamStation:
    """The station with EIy and EIz exchanged."""
    if station.stiffness is None:
        return replace(station, EIy_Nm2=station.EIz_Nm2, EIz_Nm2=station.EIy_Nm2)
    exchanged = np.array(station.stiffness)
    exchanged[ABOUT_Y, ABOUT_Y], exchanged[ABOUT_Z, ABOUT_Z] = exchanged[ABOUT_Z, ABOUT_Z], exchanged[ABOUT_Y, ABOUT_Y]
    return replace(station, stiffness=matrix(exchanged))


@of_body
def _on_the_axis(body: Body) -> Body:
    if not isinstance(body, BeamBody) or not any(any(station.reference_point_m) for station in body.stations):
        raise CaseError(f'control "section_point" changes beams with a reference point off the axis, not "{body.name}"')
    return replace(body, stations=tuple(replace(station, reference_point_m=(0.0, 0.0)) for station in body.stations))


MUTATIONS = (
    Mutation(
        "dropped_stiffening",
        "level stiffened or exact becomes full",
        "geometric stiffening left out",
        whole,
        _unstiffened,
    ),
    Mutation(
        "dropped_deformation",
        "level full, stiffened or exact becomes ruthless",
        "Coriolis, centrifugal and inertia terms of the deformation left out",
        bodies,
        _undeformed,
        _twists_in_place,
    ),
    Mutation(
        "mode_sign",
        "sign of the first mode at the nodes, not in the inertia",
        "modes of two analyses mixed: the sign of an eigenvector is arbitrary",
        bodies,
        _of_modes("mode_sign", _sign),
        _out_of_the_plane,
    ),
    Mutation(
        "mode_order",
        "first two modes exchanged in the stiffness",
        "modes sorted in one file and not in the other",
        bodies,
        _of_modes("mode_order", _order),
        _equally_stiff,
    ),
    Mutation(
        "mode_rotation",
        "no rotation of the nodes by the modes",
        "slopes left out: what is mounted on the body does not turn with its bending",
        bodies,
        _of_modes("mode_rotation", _no_rotation),
    ),
    Mutation(
        "section_point",
        "sections stated on the axis, not at their reference point",
        "neutral axis and mass centre taken for the axis",
        bodies,
        _on_the_axis,
    ),
    Mutation("section_axes", "EIy and EIz exchanged", "bending about y taken for bending along y", bodies, _section),
)
