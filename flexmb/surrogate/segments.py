"""Beams as chains of rigid segments joined by sprung hinges."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Literal

import numpy as np

from flexmb.scene import schema as s
from flexmb.scene.rest_curve import is_curved
from flexmb.scene.rigid_equivalent import beam_piece, quadrature, rigid_body, section_properties
from flexmb.scene.sections import has_plain_sections
from flexmb.scene.strains import strains, twist_inertia
from flexmb.scene.tree import rest_frames
from flexmb.surrogate.chain import (
    NodePlace,
    beams_named,
    in_pieces,
    inboard_hinge,
    outward,
    piece_at,
    stiffness_damping,
)

_X: s.Vector = (1.0, 0.0, 0.0)
# Families of motion that turn sections: axis letter, axis, stiffness of a station; in the order of the rotations.
_TURNS = {
    "bending_y": ("z", (0.0, 0.0, 1.0), "EIz_Nm2"),
    "bending_z": ("y", (0.0, 1.0, 0.0), "EIy_Nm2"),
    "torsion": ("x", _X, "GJ_Nm2"),
}


@dataclass(frozen=True)
class _Cut:
    """A hinge between two segments at x (m), carrying the compliance of the beam from `start` to `end`."""

    x: float
    start: float
    end: float
    kind: Literal["turn", "axial"]


def finite_segments(scene: s.Scene, body: str | None, n: int) -> s.Scene:
    """The beam `body` (all beams if None) as rigid segments joined by sprung hinges.

    The beam is divided into n elements of length l with a hinge in the middle of each, so that half an element is rigid
    at the root and at the tip. The springs are EI/l for each bending plane and GJ/l for torsion, as far as these are
    among the beam's mode families; for varying sections, the inverse of the compliance integrated over the element. If
    "axial" is among the families, prismatic hinges at the element boundaries have springs EA/l. The error of the first
    frequency is O(n^-2), and so is that of finite deflection in a plane; in space it is O(n^-1), because the rotations
    of a hinge are successive. Segments are named `<beam>.seg00` ... and hinges `<beam>.h01` ... (prismatic ones
    `<beam>.a01` ...) from the root. Modal damping becomes proportional to stiffness, exact for the first mode. Raises
    ValueError for Timoshenko shear and initial modal states, which segments do not have, and for curved beams.
    """
    for beam in beams_named(scene, body):
        scene = _segmented(scene, beam, n)
    return scene


def _segmented(scene: s.Scene, beam: s.BeamBody, n: int) -> s.Scene:
    if is_curved(beam):
        raise ValueError(f'beam "{beam.name}" is curved: finite segments are for straight ones; join several by welds')
    if beam.theory == "timoshenko" or not set(strains(beam)) <= {*_TURNS, "axial"}:
        raise ValueError(f'beam "{beam.name}": finite segments have no shear; use theory "euler-bernoulli"')
    if not has_plain_sections(beam):
        raise ValueError(
            f'beam "{beam.name}": the hinges between finite segments have springs that nothing couples, and its '
            "sections are matrices or stated off its axis; divide it into flexible pieces (substructures), or keep "
            "its modes"
        )
    cuts = _cuts(beam, n)
    ends = [0.0, *(cut.x for cut in cuts), beam.length_m]
    places = {}
    for name, frame in rest_frames(beam).items():
        piece = piece_at(ends, frame.position[0])
        places[name] = NodePlace(piece, _segment_name(beam, piece), name)
    root = places[inboard_hinge(scene, beam).child_node].piece
    joints = outward(_hinges(beam, cuts, ends, root), root)
    return in_pieces(scene, beam, _segments(beam, ends, places), joints, places)


def _cuts(beam: s.BeamBody, n: int) -> list[_Cut]:
    """Hinges along the beam: rotations in the middles of the elements, translations at the boundaries between them.

    The outer translations include the compliance of the elements at the ends, so that the chain stretches like the beam
    under a tip load.
    """
    if n < 2:
        raise ValueError(f'beam "{beam.name}": finite segments need at least 2 elements, got {n}')
    length = beam.length_m / n
    cuts = []
    if any(strain in _TURNS for strain in strains(beam)):
        cuts += [_Cut((i + 0.5) * length, i * length, (i + 1) * length, "turn") for i in range(n)]
    if "axial" in strains(beam):
        for i in range(1, n):
            start = 0.0 if i == 1 else (i - 0.5) * length
            end = beam.length_m if i == n - 1 else (i + 0.5) * length
            cuts.append(_Cut(i * length, start, end, "axial"))
    return sorted(cuts, key=lambda cut: cut.x)


def _segments(beam: s.BeamBody, ends: list[float], places: dict[str, NodePlace]) -> list[s.RigidBody]:
    """Rigid pieces between the cuts; each frame at its root end with the beam's axes."""
    segments = []
    for piece, (start, end) in enumerate(zip(ends, ends[1:], strict=False)):
        inertia = beam_piece(beam, start, end)
        own = dataclasses.replace(inertia, com=inertia.com - [start, 0.0, 0.0])
        nodes = tuple(
            s.Node(name=name, position_m=(at.position[0] - start, 0.0, 0.0), quaternion=at.quaternion)
            for name, at in rest_frames(beam).items()
            if places[name].piece == piece and name != "origin"
        )
        segments.append(rigid_body(_segment_name(beam, piece), own, nodes))
    return segments


def _hinges(beam: s.BeamBody, cuts: list[_Cut], ends: list[float], root: int) -> list[s.Hinge]:
    """The hinges along the beam; `root` is the segment that carries the beam's inboard hinge."""
    lag = stiffness_damping(beam)
    count = {"turn": 0, "axial": 0}
    hinges = []
    for piece, cut in enumerate(cuts):
        count[cut.kind] += 1
        inner, outer = _segment_name(beam, piece), _segment_name(beam, piece + 1)
        at_end: s.Vector = (ends[piece + 1] - ends[piece], 0.0, 0.0)
        name = f"{beam.name}.{'h' if cut.kind == 'turn' else 'a'}{count[cut.kind]:02d}"
        if piece >= root:
            placement = {"name": name, "parent": inner, "child": outer, "parent_position_m": at_end}
        else:
            placement = {"name": name, "parent": outer, "child": inner, "child_position_m": at_end}
        hinges.append(_slide(beam, cut, lag, placement) if cut.kind == "axial" else _turn(beam, cut, lag, placement))
    return hinges


def _slide(beam: s.BeamBody, cut: _Cut, lag: float, placement: dict) -> s.Hinge:
    k = _spring(beam, "EA_N", cut)
    return s.Prismatic(**placement, axis=_X, translation=s.LinearCoordinate(stiffness_N_m=k, damping_Ns_m=lag * k))


def _turn(beam: s.BeamBody, cut: _Cut, lag: float, placement: dict) -> s.Hinge:
    """A hinge with one rotation for each family that turns sections: revolute for one, else a gimbal."""
    letters, axes, turns = "", [], []
    for family, (letter, axis, key) in _TURNS.items():
        if family in strains(beam):
            k = _spring(beam, key, cut)
            letters += letter
            axes.append(axis)
            own = _twist_inertia(beam, cut) if family == "torsion" else 0.0
            turns.append(s.AngularCoordinate(stiffness_Nm_rad=k, damping_Nms_rad=lag * k, armature_kg_m2=own))
    if len(turns) == 1:
        return s.Revolute(**placement, axis=axes[0], rotation=turns[0])
    return s.Gimbal(**placement, sequence=letters, rotations=tuple(turns))


def _twist_inertia(beam: s.BeamBody, cut: _Cut) -> float:
    """The inertia (kg m^2) that the twist of the piece has where its sections have none about the axis."""
    stations = sorted(beam.stations, key=lambda station: station.x_m)
    x, weight = quadrature(beam, (cut.start, cut.end))
    return float(weight @ np.interp(x, [station.x_m for station in stations], twist_inertia(beam, stations)))


def _spring(beam: s.BeamBody, key: str, cut: _Cut) -> float:
    """Stiffness of the piece of beam that the cut represents: the inverse of its integrated compliance."""
    x, weight = quadrature(beam, (cut.start, cut.end))
    (section,) = section_properties(beam, x, key)
    return float(1.0 / np.sum(weight / section))


def _segment_name(beam: s.BeamBody, piece: int) -> str:
    return f"{beam.name}.seg{piece:02d}"
