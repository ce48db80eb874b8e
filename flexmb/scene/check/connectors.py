"""Checks of connectors: laws, matrices that are symmetric and not negative, ends and coordinates that can move."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf, sqrt
from operator import itemgetter
from typing import assert_never

import numpy as np
from msgspec.structs import replace

from flexmb.scene import schema as s
from flexmb.scene.check.numbers import in_range
from flexmb.scene.check.walk import entries, sound
from flexmb.scene.connectors import AlongHinge, HingeFriction, HingeSpring, by_stem, sticks
from flexmb.scene.problems import Defect, Doubt, Place
from flexmb.scene.sticking import any_sticks, holding_sensor, names_of, sticking
from flexmb.scene.tree import GROUND, coordinate_of, scalar_paths
from flexmb.scene.values import values_at

HIGHEST = 4  # coefficients of `stiffening`: a law is a polynomial of degree five at most
SYMMETRIC = 1e-9  # tolerance of matrices printed to ten digits, relative to the largest element
LOST = 0.01  # fraction of static friction that may be lost by smoothing without a doubt


def connectors(scene: s.Scene) -> Iterator[Defect]:
    """Every connector by itself, and that it acts on something that moves."""
    for place, item in sound(scene, "connectors"):
        connector: s.Connector = item
        match connector:
            case s.SpringDamper():
                yield from _law(place, connector)
                yield from _one_sided(place, connector)
                yield from _ends(place, connector)
            case s.Bushing():
                yield from _matrix(place.key("stiffness"), connector.stiffness)
                yield from _matrix(place.key("damping"), connector.damping)
                yield from _ends(place, connector)
            case s.AngularSpring() | s.LinearSpring():
                yield from _law(place, connector)
                yield from _stops(place, connector)
            case s.AngularFriction() | s.LinearFriction():
                yield from _friction(place, connector)
            case _:
                assert_never(connector)
        if isinstance(connector, AlongHinge):
            try:
                coordinate_of(scene, connector)
            except ValueError as error:
                yield Defect(str(place.key("hinge")), str(error), "name a hinge, and its coordinate as the hinge does")


def _law(place: Place, connector: s.SpringDamper | HingeSpring) -> Iterator[Defect]:
    """A polynomial, or a table of one load for each of several increasing places, not both."""
    law = by_stem(connector)
    table, loads, stiffening = law["table"], law["loads"], law["stiffening"]
    if len(stiffening) > HIGHEST:
        what = f"{len(stiffening)} coefficients beside the stiffness make a polynomial of degree {len(stiffening) + 1}"
        yield Defect(str(place.key("stiffening")), what, f"give {HIGHEST} at most, or a table")
    if law["stiffness"] < 0.0 and not stiffening:
        what = f"negative stiffness: {law['stiffness']:g}"
        yield Defect(str(place), what, "give a stiffness of at least zero, or stiffening to hold it together")
    if not (table or loads):
        return
    if law["stiffness"] or law["preload"] or stiffening:
        yield Defect(str(place), "the law is given twice, by coefficients and by a table", "leave one of them out")
    if len(table) != len(loads) or len(table) < 2:
        what = f"the table has {len(table)} places and {len(loads)} loads"
        yield Defect(str(place), what, "give one load for each place, and two places at least")
    elif np.any(np.diff(table) <= 0.0):
        yield Defect(str(place), "the table's places do not increase", "sort the samples and drop repeated places")


def _one_sided(place: Place, connector: s.SpringDamper) -> Iterator[Defect]:
    if connector.acts == "both":
        return
    if connector.table_m or connector.stiffening or connector.stiffness_N_m <= 0.0:
        what = f"a spring that acts in {connector.acts} only has a constant, positive stiffness"
        remedy = "write other one-sided laws as a table with loads of zero where the spring is slack"
        yield Defect(str(place.key("acts")), what, remedy)


def _ends(place: Place, connector: s.SpringDamper | s.Bushing) -> Iterator[Defect]:
    if connector.body_a == connector.body_b == GROUND:
        yield Defect(str(place), "both ends are on the ground", "name a body that moves")
    a = connector.body_a, connector.node_a, connector.position_a_m
    if isinstance(connector, s.SpringDamper) and a == (connector.body_b, connector.node_b, connector.position_b_m):
        yield Defect(str(place), "both ends are one point, and no line leads from one to the other", "move an end")


def _matrix(place: Place, rows: tuple[tuple[float, ...], ...]) -> Iterator[Defect]:
    matrix = np.array(rows)
    largest = float(np.max(np.abs(matrix)))
    if np.max(np.abs(matrix - matrix.T)) > SYMMETRIC * largest:
        yield Defect(str(place), "the matrix is not symmetric", "give a symmetric one: [rotation; translation]")
    elif np.min(np.linalg.eigvalsh(matrix)) < -SYMMETRIC * largest:
        yield Defect(str(place), "the matrix is negative along some displacement", "give one that is not")


def _stops(place: Place, connector: HingeSpring) -> Iterator[Defect]:
    law = by_stem(connector)
    lower, upper = law["lower"], law["upper"]
    if lower is not None and upper is not None and not lower < upper:
        yield Defect(str(place), f"the stops leave nothing between {lower:g} and {upper:g}", "put lower below upper")
    if (lower is not None or upper is not None) and law["stop_stiffness"] == 0.0:
        yield Defect(str(place), "the stops have no stiffness", "give one, or leave lower and upper out")
    if lower is None and upper is None and law["stop_stiffness"] > 0.0:
        yield Defect(str(place), "there is a stop stiffness, but no stop", "give lower or upper, or leave it out")


def _friction(place: Place, connector: HingeFriction) -> Iterator[Defect]:
    law = by_stem(connector)
    if sticks(connector):
        yield from _sticking(place, law)
        return
    if law["phase"] != "undecided":
        what = f'its phase is "{law["phase"]}", but smooth friction has none'
        yield Defect(str(place.key("phase")), what, "leave it out: it belongs to a smoothing of 0")
    if (law["static"] is None) != (law["stribeck"] is None):
        yield Defect(str(place), "static friction and the Stribeck speed belong together", "give both, or neither")
    elif law["static"] is not None:
        if law["static"] < law["sliding"]:
            what = f"static friction {law['static']:g} is below sliding friction {law['sliding']:g}"
            yield Defect(str(place), what, "give at least as much")
        elif law["static"] > law["sliding"] and in_range(connector):
            yield from _peak(place, law)


def _sticking(place: Place, law: Mapping[str, float]) -> Iterator[Defect]:
    """Friction that sticks may be static without a Stribeck speed: it then falls to its sliding value at once."""
    static = law["sliding"] if law["static"] is None else law["static"]
    if law["static"] is None and law["stribeck"] is not None:
        yield Defect(str(place), "there is a Stribeck speed, but no static friction", "give both, or leave it out")
    elif static < law["sliding"]:
        what = f"static friction {static:g} is below sliding friction {law['sliding']:g}"
        yield Defect(str(place), what, "give at least as much")
    elif static == 0.0:
        yield Defect(str(place), "there is no friction", "give sliding or static friction, or leave the connector out")


def friction_that_sticks(scene: s.Scene) -> Iterator[Defect]:
    """One at most along a coordinate, which nothing prescribes, and names that a run gives to what it adds."""
    if not any_sticks(scene):
        return
    along, paths, added = dict[str, str](), scalar_paths(scene), dict[str, str]()
    for place, item in sound(scene, "connectors"):
        if not (isinstance(item, HingeFriction) and sticks(item)):
            continue
        try:
            [friction] = sticking(replace(scene, connectors=(item,)))
        except ValueError:
            continue  # another check says so
        coordinate = friction.coordinate
        if coordinate in along:
            what = f'"{along[coordinate]}" sticks along {coordinate} too: how they share a load is undetermined'
            yield Defect(str(place), what, "add them up in one connector")
        along.setdefault(coordinate, item.name)
        [moved] = values_at(scene, paths[coordinate])
        if item.phase != "sticking" and getattr(moved, moved.KEYS.prescribed) is not None:
            what = f"{coordinate} is prescribed, so that friction that sticks holds nothing along it"
            yield Defect(str(place), what, "give it a smoothing speed, or a motor in place of the prescribed motion")
        sensor = holding_sensor(friction)
        for spot, other in (*entries(scene, "sensors"), *entries(scene, "controllers")):
            if other.name == sensor.name and other != sensor:
                what = f'"{other.name}" is the load by which friction "{item.name}" holds, which a run adds'
                yield Defect(str(spot.key("name")), what, "rename one of the two")
        added |= dict.fromkeys(names_of(item.name), item.name)
    for place, event in entries(scene, "events"):
        if event.name in added:
            what = f'"{event.name}" is what a run says of friction "{added[event.name]}"'
            yield Defect(str(place.key("name")), what, "rename one of the two")


def _peak(place: Place, law: Mapping[str, float]) -> Iterator[Doubt]:
    """Smoothing reduces the peak of friction, because friction falls to its sliding value before it has built up."""
    static, sliding, stribeck = law["static"], law["sliding"], law["stribeck"]
    at, peak = friction_peak(sliding, static, stribeck, law["smoothing"])
    if peak < (1.0 - LOST) * static:
        most = LOST * stribeck / sqrt(2.0 * (1.0 - sliding / static))
        what = (
            f"smoothed by {law['smoothing']:g} beside a Stribeck speed of {stribeck:g}, friction rises to {peak:.4g} "
            f"at most (at {at:.3g}), {peak / static:.1%} of the static {static:g}: a load between them, which would be "
            "held, does not creep but runs away"
        )
        remedy = f"take a smoothing of {most:.2g} at most, which comes within {LOST:.0%} of it"
        yield Doubt(str(place), what, remedy, "friction_peak")


def friction_peak(sliding: float, static: float, stribeck: float, smoothing: float) -> tuple[float, float]:
    """Speed at which smoothed friction is largest, and the load there; (inf, sliding) where it only rises.

    With x = (v/vs)^2 and r = (vr/vs)^2 the derivative of the law vanishes where
    (r Fc - 2 (Fs - Fc)) x^2 + r (3 Fc - Fs) x + r Fs = 0.
    """
    r = (smoothing / stribeck) ** 2
    roots = np.roots([r * sliding - 2.0 * (static - sliding), r * (3.0 * sliding - static), r * static])
    extremes = [(inf, sliding)]
    for x in roots[np.isreal(roots) & (roots.real > 0.0)].real.tolist():
        extremes.append((stribeck * sqrt(x), (sliding + (static - sliding) / (1.0 + x)) * sqrt(x / (x + r))))
    return max(extremes, key=itemgetter(1))
