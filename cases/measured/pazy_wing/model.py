"""The Pazy wing: its tip under weights, equilibria of one beam of level "exact" with sixteen lumps.

Body axes: x along the span, y to the leading edge, z up; the axis is at 44 % of the chord. Its own weight acts, and its
displacement without a tip weight is subtracted, as in the test.
"""

import csv
from functools import cache
from math import asin, degrees, sqrt
from pathlib import Path

import numpy as np

import flexmb as fm

G, CHORD, SPAN = 9.80665, 0.1, 0.549843728
PLACES = (*(np.arange(14) * 0.03824999855).tolist(), 0.530718683, SPAN)  # of the lumps; sections are half way between
NONE = 1e-6  # kg, in place of no weight
BEHIND = {"bending": 0.06, "twist": 0.56}  # place of the weight behind the axis, in chords; for twist see the inputs


def predict(points, inputs, effort):
    """Vertical displacements of the tip's middle (% of the semispan), and twists (degrees)."""
    return [value for value, _ in answers(points, inputs, effort)]


def derivatives(points, inputs, effort):
    """By the place of the weight; by the stiffness of a beam, whose modes change with it, there are differences."""
    return {"place of the weight": [1e-3 * by_place for _, by_place in answers(points, inputs, effort, True)]}


def answers(points, inputs, effort, exact=False):
    """The prediction of each point, and its derivative by the place of the weight (1/m), if `exact`."""
    masses = {}
    for point in points:
        masses.setdefault(point.series, set()).add(point.conditions["tip_mass_kg"])
    known = {}
    for series, own in masses.items():
        kind, skin = series.partition(",")[0], int("with skin" in series)
        behind = BEHIND[kind] * CHORD + (1e-3 * inputs["place of the weight"] if kind == "twist" else 0.0)
        stiffness = inputs["bending stiffness"], inputs["twist stiffness"]
        turned = exact and kind == "twist"  # bending is measured under a weight that is not moved
        known[series] = rests(kind, tuple(sorted(own)), skin, behind, *stiffness, effort, turned)
    return [known[point.series][point.conditions["tip_mass_kg"]] for point in points]


def table(name, skin):
    """The rows of one wing."""
    with (Path(__file__).parent / name).open() as file:
        return [[float(value) for value in row[1:]] for row in csv.reader(file) if row[0] == str(skin)]


@cache
def rests(kind, masses, skin, behind, bending, twist, effort, exact):
    """Displacement or twist by weight (kg) less that of none, along the path of equilibria as the weight grows.

    With the derivative by the place of the weight, 0 unless `exact`.
    """
    scene = wing(skin, behind, bending, twist, effort)
    path = fm.equilibrium_path(scene, "load.mass_kg", [NONE, *masses])
    system = fm.compile(scene)
    values = {}
    for mass in (NONE, *masses):
        state = path.at(mass)[0]
        markers = system.evaluate(state.t, state.q, state.u).markers
        up = markers["leading"].position[2] - markers["trailing"].position[2]
        value = markers["middle"].position[2] / SPAN * 100.0 if kind == "bending" else degrees(asin(up / CHORD))
        rate = 0.0
        if exact:
            leading, trailing = by_place(scene.with_values({"load.mass_kg": mass}), state)
            rate = degrees((leading - trailing) / CHORD / sqrt(1.0 - (up / CHORD) ** 2))
        values[mass] = np.array([value, rate])
    return {mass: values[mass] - values[NONE] for mass in masses}


def by_place(scene, state):
    """How the edges rise as the weight moves backwards (m/m): accelerations stay zero, and displacements follow."""
    system = fm.compile(scene)
    numbers = system.parameters(["bolt.parent_position_m.1"])
    stiffness = system.acceleration_derivatives(state).by_displacement
    followed = np.linalg.solve(stiffness, numbers.accelerations(state)[:, 0])
    (seen,) = numbers.evaluate(state).values()
    rates = system.evaluation_derivatives(state)
    return [
        float(rates.markers[name].position.by_displacement[2] @ followed - seen.markers[name].position[2])
        for name in ("leading", "trailing")
    ]


def wing(skin, behind, bending, twist, effort):
    """The scene with the least of weights."""
    sections = table("sections.csv", skin)
    middle = 0.5 * (np.array(PLACES[1:]) + np.array(PLACES[:-1]))
    stations = [
        fm.BeamStation(
            x_m=float(x), EA_N=EA, GJ_Nm2=twist * GJ, EIy_Nm2=bending * flat, EIz_Nm2=edge, mass_per_length_kg_m=1e-6
        )
        for x, (EA, GJ, flat, edge) in zip((0.0, *middle, SPAN), (sections[0], *sections, sections[-1]), strict=True)
    ]
    lumps = [
        fm.TipMass(
            x_m=x, mass_kg=m, com_m=(along, -aft, up),
            inertia_kg_m2=((span, 0, 0), (0, chord, 0), (0, 0, max(vertical, abs(span - chord) * 1.0001))),
        )
        for x, (m, aft, along, up, chord, span, vertical) in zip(PLACES, table("lumps.csv", skin), strict=True)
    ]  # fmt: skip
    b = fm.SceneBuilder(
        "Pazy wing",
        gravity=(0, 0, -G),
        allow=("wave_speed", "many_elements", "thick_section", "shear_stiffness", "uncut_beam"),
    )
    b.beam(
        "wing", length=SPAN, elements=15, section=stations, level="exact", tip_masses=lumps,
        modes=fm.Modes(count=5 + 2 * effort, families=("bending_y", "bending_z", "torsion"), points=24),
    ).weld("clamp", "ground", "wing")  # fmt: skip
    b.rigid_body("load", mass=NONE, inertia=(1e-9,) * 3)
    b.weld("bolt", "wing", "load", parent_node="tip", parent_position=(0, -behind, 0))
    for name, chords in (("middle", -0.06), ("leading", 0.44), ("trailing", -0.56)):
        b.marker(name, "wing", node="tip", offset=(0, chords * CHORD, 0))
    return b.scene()
