"""The pieces of a beam of level "exact", each with polynomials of its own, and where its strains have kinks and jumps.

Strains jump at a force or a moment, at a lump, and where the section does. Polynomials across the place converge with a
low power of their number, those of two pieces that meet there as fast as along a smooth beam. Beams are therefore cut
there by themselves: at lumps and steps, which a body knows, and at nodes that carry something, which a scene knows.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from itertools import pairwise
from math import inf
from typing import Any, Protocol

import numpy as np
from msgspec.structs import replace

from flexmb.scene.bodies import BeamBody
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.sections import WITHOUT_SHEAR, stiffness_on_axis
from flexmb.typing import Real

AT_END = 1e-9
"""Distance from the end of a piece, over the beam's length, within which a place is taken to be there."""
MOST_BY_THEMSELVES = 8
"""Pieces into which a beam is cut without being asked: one evaluation costs the square of their number and more."""
SHARP = 4.0
"""Change of the slope of a stiffness along the beam, over the stiffness and times the length, that is told. It leaves
1.4e-3 of the length with 4 polynomials, and 1 leaves 1.5e-4 (tests/flexmb/surrogate/test_cuts.py)."""


Places = Iterable[tuple[float, str]]
Held = dict[str, list[tuple[str, str]]]


class ByThemselves(tuple[str, ...]):
    """Cuts that a scene has chosen, and chooses anew with whatever it is made from; equal to the same cuts given."""


class Joined(Protocol):
    """What may hold nodes of beams: a scene."""

    @property
    def bodies(self) -> tuple[Any, ...]: ...

    @property
    def hinges(self) -> tuple[Any, ...]: ...

    @property
    def closures(self) -> tuple[Any, ...]: ...

    @property
    def connectors(self) -> tuple[Any, ...]: ...

    @property
    def loads(self) -> tuple[Any, ...]: ...

    @property
    def wheels(self) -> tuple[Any, ...]: ...

    @property
    def point_masses(self) -> tuple[Any, ...]: ...


def cut_by_themselves(scene: Joined) -> tuple[Any, ...]:
    """The bodies, of which beams of level exact are cut at their nodes that carry something; others, and beams whose
    modes say where they are cut or in how many pieces they are, as they are."""
    open_ones = [body for body in scene.bodies if isinstance(body, BeamBody) and _chosen(body.modes.cuts)]
    exact = {
        body.name for body in open_ones
        if body.level == "exact" and body.modes.pieces == 1 and (body.nodes or body.tip_masses or body.stations[2:])
    }  # fmt: skip
    held = _held(scene) if exact else {}
    new = {id(body): _cuts_of_ports(body, held) if body.name in exact else None for body in open_ones}
    return tuple(
        replace(body, modes=replace(body.modes, cuts=new[id(body)]))
        if id(body) in new and new[id(body)] != body.modes.cuts else body
        for body in scene.bodies
    )  # fmt: skip


def _chosen(cuts: tuple[str, ...] | None) -> bool:
    """Whether a scene chooses the cuts."""
    return cuts is None or isinstance(cuts, ByThemselves)


def _cuts_of_ports(body: BeamBody, held: Held) -> ByThemselves | None:
    """The nodes, one of each place; None if the beam is cut nowhere else than it would be without them, no node where
    that would be too many pieces."""
    whole = replace(body, modes=replace(body.modes, cuts=()))
    ports = list(_ports(held, whole))
    if not 0.0 < body.length_m < inf or len(_inside(whole, (*ports, *_lumps_and_steps(whole)))) >= MOST_BY_THEMSELVES:
        return ByThemselves()
    return ByThemselves(next(node.name for node in body.nodes if node.x_m == x) for x in _inside(whole, ports)) or None


def cuts(body: BeamBody) -> tuple[float, ...]:
    """The places (m) inside the beam, ascending, where it is cut; without those that `check_scene` refuses.

    They are those of its modes, and lumps and steps of the section unless these leave the beam whole.
    """
    at, modes = {node.name: node.x_m for node in body.nodes}, body.modes
    own = [x for x, _ in _lumps_and_steps(body)] if modes.cuts or (modes.cuts is None and modes.pieces == 1) else []
    places: list[float] = []
    for x in (*(at[name] for name in modes.cuts or () if name in at), *own):
        if 0.0 < x < body.length_m and all(abs(x - other) > AT_END * body.length_m for other in places):
            places.append(x)
    return tuple(sorted(places))


def cut_itself(body: BeamBody) -> bool:
    """Whether the beam has pieces that its modes do not ask for."""
    return _chosen(body.modes.cuts) and bool(cuts(body))


def edges(body: BeamBody) -> Real:
    """The ends (n+1,) m of the n pieces: each part between two cuts is divided into equal ones."""
    ends = (0.0, *cuts(body), body.length_m)
    parts = [np.linspace(left, right, body.modes.pieces + 1) for left, right in pairwise(ends)]
    return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])


def piece_count(body: BeamBody) -> int:
    """Number of pieces of a beam."""
    return (len(cuts(body)) + 1) * body.modes.pieces


def across(scene: Joined, body: BeamBody) -> dict[float, str]:
    """What is inside the pieces of a beam of the scene that makes its strains jump: place (m), ascending, and what is
    there."""
    return _inside(body, (*_ports(_held(scene), body), *_lumps_and_steps(body), *_kinks(body)))


def _inside(body: BeamBody, places: Places) -> dict[float, str]:
    """Those of the places (m) that are inside pieces, ascending; of several at one place the first."""
    ends, found = edges(body).tolist(), dict[float, str]()
    for x, what in places:
        if min(abs(end - x) for end in ends) > AT_END * body.length_m and 0.0 < x < body.length_m:
            found[x] = what
            ends.append(x)
    return dict(sorted(found.items()))


def _ports(held: Held, body: BeamBody) -> Places:
    """Nodes of the beam that carry something."""
    at = {node.name: node.x_m for node in body.nodes}
    return [(at[node], f'{what} at node "{node}"') for node, what in held.get(body.name, ()) if node in at]


def _held(scene: Joined) -> Held:
    """The nodes of each body with a hinge, a closure, a connector, a load, a wheel or a point mass, and these."""
    held: Held = defaultdict(list)
    connectors = [connector for connector in scene.connectors if isinstance(connector, BetweenNodes)]
    for hinge in scene.hinges:
        held[hinge.parent].append((hinge.parent_node, f'hinge "{hinge.name}"'))
        held[hinge.child].append((hinge.child_node, f'hinge "{hinge.name}"'))
    for what, between in (("closure", scene.closures), ("connector", connectors)):
        for item in between:
            held[item.body_a].append((item.node_a, f'{what} "{item.name}"'))
            held[item.body_b].append((item.node_b, f'{what} "{item.name}"'))
    for what, on_body in (("load", scene.loads), ("wheel", scene.wheels), ("point mass", scene.point_masses)):
        for item in on_body:
            held[item.body].append((item.node, f'{what} "{item.name}"'))
    return held


def _lumps_and_steps(body: BeamBody) -> Places:
    """Lumps of the beam, and places where two stations differ."""
    for i, lump in enumerate(body.tip_masses):
        yield lump.x_m, f"tip_masses[{i}]"
    stations = sorted(body.stations, key=lambda station: station.x_m)
    for left, right in pairwise(stations):
        if left.x_m == right.x_m and left != right and 0.0 < left.x_m < body.length_m:
            yield left.x_m, "a step of the section"


def _kinks(body: BeamBody) -> Places:
    """Stations at which the stiffness against a strain changes its slope by much."""
    stations = sorted(body.stations, key=lambda station: station.x_m)
    K = np.array([np.diag(stiffness_on_axis(station))[WITHOUT_SHEAR] for station in stations])
    for i in range(1, len(stations) - 1):
        before, after = np.diff([station.x_m for station in stations[i - 1 : i + 2]])
        if min(before, after) > 0.0:
            bend = (K[i + 1] - K[i]) / after - (K[i] - K[i - 1]) / before
            if np.max(np.abs(bend) / K[i]) * body.length_m >= SHARP:
                yield stations[i].x_m, "a kink of the stiffness"
