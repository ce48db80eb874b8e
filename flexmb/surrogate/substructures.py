"""A beam as a chain of flexible pieces welded to one another: finite deflection from modes of small deflection.

The deformation of each piece is small in its own frame, which turns with the section at its root. The chain converges
to the geometrically exact beam as the pieces become short, provided that they have attachment modes: neighbours load a
piece with forces and moments at its tip, and eigenmodes with a free tip do not span the resulting deflections.

Pieces of level "exact" may turn by any angle, so that few of them suffice. Their strains are polynomials, of which the
two lowest of each curvature are those under forces and moments at the tip.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from typing import Any

import numpy as np
from msgspec.structs import replace

from flexmb.modal import flexible_model
from flexmb.scene.problems import closest
from flexmb.scene.rest_curve import is_curved
from flexmb.scene.schema import BeamBody, BeamStation, Hinge, Level, Modes, Scene, StrainPolynomials, Weld
from flexmb.scene.sections import (
    INERTIA_KEYS,
    SHEAR_KEYS,
    STIFFNESS_KEYS,
    inertia_on_axis,
    is_plain,
    matrix,
    stiffness_on_axis,
)
from flexmb.scene.strains import as_fine, families
from flexmb.scene.tree import nodes_along
from flexmb.surrogate.chain import (
    NodePlace,
    beams_named,
    in_pieces,
    inboard_hinge,
    outward,
    piece_at,
    stiffness_damping,
)

CURVATURES = 3
"""Polynomials of each curvature of a piece of level "exact": as costly as the two under loads at the tip and one
eigenmode, with errors of the sixth power of the length."""
_NUMBERS = (*STIFFNESS_KEYS, *SHEAR_KEYS, *INERTIA_KEYS, "curvature_1_m")


def substructured(
    scene: Scene,
    body: str | None,
    pieces: int | Sequence[str | float],
    *,
    level: Level | None = None,
    eigenmodes: int = 0,
    polynomials: int | StrainPolynomials | None = None,
) -> Scene:
    """The beam `body` (all beams if None) as `pieces` flexible pieces, welded section to section: as many equal ones,
    or those between the given nodes (names) and places (m) inside the beam.

    A piece is clamped at its own root. It has the attachment modes of its beam's mode families (unit forces and moments
    at its tip: one mode for axial motion, one for torsion, two for each plane of bending) and, in addition,
    `eigenmodes` eigenmodes. Its level is the beam's unless `level` is given. The chain converges to the geometrically
    exact beam with the square of the length of a piece at level "full", and with its third power at "stiffened"; where
    the twist varies along the beam, the third power requires an eigenmode of torsion in each piece.

    A piece of level "exact" has `polynomials` of each curvature of the beam instead of modes, and of its stretch and
    shears as many as belong to these; or those of each strain. By default it has those that one piece of the beam has
    if it is of level "exact" itself, otherwise `CURVATURES`. With p of them the chain converges with the power 2 p of
    the length of a piece. A beam of that level whose axis is curved has pieces of that level only.

    Sections, theory, tip masses and the choice of inertia points are those of the beam; modal damping becomes
    proportional to stiffness, exact for the beam's first mode.

    Pieces are named `<beam>.p00` ... and welds `<beam>.w01` ... from the root; a node or a tip mass at a cut belongs to
    the outer piece. Raises ValueError for a body that is not a beam or is rigid, for fewer than one piece, for a place
    that is not inside the beam, for an initial modal state, and for `eigenmodes` or `polynomials` that pieces of the
    level do not have.
    """
    if isinstance(pieces, int) and pieces < 1:
        raise ValueError(f"a beam is divided into at least one piece, got {pieces}")
    if eigenmodes < 0:
        raise ValueError(f"the number of eigenmodes of a piece is {eigenmodes}: give zero or more")
    for beam in beams_named(scene, body):
        of_piece = level or beam.level
        _refuse(beam, of_piece, eigenmodes, polynomials)
        modes = _strains(beam, polynomials) if of_piece == "exact" else _eigenmodes(beam, eigenmodes)
        scene = _split(scene, beam, _ends(beam, pieces), of_piece, modes)
    return scene


def _refuse(beam: BeamBody, level: Level, eigenmodes: int, polynomials: int | StrainPolynomials | None) -> None:
    if level == "rigid":
        raise ValueError(f'beam "{beam.name}" is rigid: pieces need a level at which they deform, such as "full"')
    if level == "exact" and eigenmodes:
        remedy = f"give polynomials={eigenmodes + CURVATURES}"
        raise ValueError(f'beam "{beam.name}": pieces of level "exact" have no eigenmodes; {remedy}')
    if level != "exact" and polynomials is not None:
        raise ValueError(f'beam "{beam.name}": only pieces of level "exact" have polynomials; give eigenmodes')
    if level != "exact" and is_curved(beam):
        raise ValueError(f'beam "{beam.name}" is curved at rest: its pieces need level "exact"')


def _eigenmodes(beam: BeamBody, count: int) -> Modes:
    return Modes(count=count, families=families(beam), static=True)


def _strains(beam: BeamBody, polynomials: int | StrainPolynomials | None) -> Modes:
    """The strains of a piece of level exact; they have its damping, which is that of a material."""
    own = beam.modes
    if polynomials is None and beam.level == "exact":
        return Modes(count=own.count, families=own.families, polynomials=own.polynomials, points=own.points)
    if not isinstance(polynomials, StrainPolynomials):
        polynomials = as_fine(replace(beam, level="exact"), CURVATURES if polynomials is None else polynomials)
    return Modes(count=0, families=own.families, polynomials=polynomials)


def _ends(beam: BeamBody, pieces: int | Sequence[str | float]) -> list[float]:
    """The ends (m) of the pieces, ascending. ValueError for a place that is not inside the beam."""
    if isinstance(pieces, int):
        return [float(x) for x in np.linspace(0.0, beam.length_m, pieces + 1)]
    along, inside = nodes_along(beam), set()
    for piece in pieces:
        if isinstance(piece, str) and piece not in along:
            raise ValueError(f'beam "{beam.name}" has no node "{piece}": {closest(piece, along)}')
        x = along[piece] if isinstance(piece, str) else float(piece)
        if not 0.0 < x < beam.length_m:
            raise ValueError(f'beam "{beam.name}" cannot be cut at x = {x:g} m: give places inside its length')
        inside.add(x)
    return [0.0, *sorted(inside), beam.length_m]


def _split(scene: Scene, beam: BeamBody, ends: list[float], level: Level, modes: Modes) -> Scene:
    count = len(ends) - 1
    places = {}
    for name, x in nodes_along(beam).items():
        piece = piece_at(ends, x)
        # Nodes keep their names: the beam's root is the root of the first piece, its tip the tip of the last one.
        places[name] = NodePlace(piece, _piece_name(beam, piece), name)
    lag = stiffness_damping(beam)
    parts = [_piece(beam, i, ends, places, modes, level, lag) for i in range(count)]
    root = places[inboard_hinge(scene, beam).child_node].piece
    return in_pieces(scene, beam, parts, outward(_welds(beam, count, root), root), places)


def _piece(
    beam: BeamBody, number: int, ends: list[float], places: dict[str, NodePlace], modes: Modes, level: Level, lag: float
) -> BeamBody:
    """Piece `number` between two of the `ends` (m); `lag` (s) is the ratio of its damping and its stiffness."""
    start, end = ends[number], ends[number + 1]
    last = end == beam.length_m
    piece = replace(
        beam,
        name=_piece_name(beam, number),
        length_m=end - start,
        # Two elements resolve the attachment modes, even with lumped masses; each further eigenmode adds half a wave.
        elements=max(-(-beam.elements // (len(ends) - 1)), 2 + modes.count),
        stations=_sections(beam, start, end),
        modes=replace(modes, viscosity_s=lag) if level == "exact" else modes,
        level=level,
        tip_masses=tuple(
            replace(lump, x_m=lump.x_m - start)
            for lump in beam.tip_masses
            if start <= lump.x_m < end or (last and lump.x_m == end)
        ),
        nodes=tuple(replace(node, x_m=node.x_m - start) for node in beam.nodes if places[node.name].piece == number),
    )
    if lag == 0.0 or level == "exact":
        return piece
    frequencies = np.sqrt(np.diag(flexible_model(piece).stiffness))
    ratios = tuple(float(0.5 * lag * omega) for omega in frequencies)
    return replace(piece, modes=replace(piece.modes, damping_ratio=ratios))


def _sections(beam: BeamBody, start: float, end: float) -> tuple[BeamStation, ...]:
    """Stations from `start` to `end` (m), measured from `start`; at a jump, the piece gets the station on its side."""
    stations = sorted(beam.stations, key=lambda station: station.x_m)
    xs = [station.x_m for station in stations]
    inside = [station for station in stations if start < station.x_m < end]
    first = _between(stations, bisect_right(xs, start), start)
    last = _between(stations, bisect_left(xs, end), end)
    return tuple(replace(station, x_m=station.x_m - start) for station in (first, *inside, last))


def _between(stations: list[BeamStation], right: int, x: float) -> BeamStation:
    """The section at x between the stations `right` - 1 and `right`, constant beyond the outer ones."""
    a, b = stations[max(right - 1, 0)], stations[min(right, len(stations) - 1)]
    share = (x - a.x_m) / (b.x_m - a.x_m) if b.x_m > a.x_m else 0.0
    if not (is_plain(a) and is_plain(b)):
        return replace(a, x_m=x) if share == 0.0 else _mixed_matrices(a, b, share, x)
    values = {}
    for key in _NUMBERS:
        values[key] = _mixed(getattr(a, key), getattr(b, key), share)
    return replace(a, x_m=x, **values)


def _mixed_matrices(a: BeamStation, b: BeamStation, share: float, x: float) -> BeamStation:
    """The section at x between two, one of which at least is a matrix or off the axis: matrices about the axis."""
    stiffness = (1.0 - share) * stiffness_on_axis(a) + share * stiffness_on_axis(b)
    inertia = (1.0 - share) * inertia_on_axis(a) + share * inertia_on_axis(b)
    curvature = _mixed(a.curvature_1_m, b.curvature_1_m, share)
    return BeamStation(x_m=x, stiffness=matrix(stiffness), inertia=matrix(inertia), curvature_1_m=curvature)


def _mixed(a: Any, b: Any, share: float) -> Any:
    """A property of a station, or its components, between those of two stations."""
    if share == 0.0 or a is None or b is None:
        return a
    if isinstance(a, tuple):
        return tuple(_mixed(*pair, share) for pair in zip(a, b, strict=True))
    return a + share * (b - a)


def _welds(beam: BeamBody, count: int, root: int) -> list[Hinge]:
    """The welds along the beam, each from the piece nearer to piece `root`."""
    welds: list[Hinge] = []
    for i in range(count - 1):
        name, near, far = f"{beam.name}.w{i + 1:02d}", _piece_name(beam, i), _piece_name(beam, i + 1)
        if i < root:
            welds.append(Weld(name=name, parent=far, parent_node="root", child=near, child_node="tip"))
        else:
            welds.append(Weld(name=name, parent=near, parent_node="tip", child=far, child_node="root"))
    return welds


def _piece_name(beam: BeamBody, piece: int) -> str:
    return f"{beam.name}.p{piece:02d}"
