"""Scenes of the library with their beams at level exact, for rows of benchmarks and the chart of what a digit costs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from msgspec.structs import replace
from scipy.optimize import brentq

import flexmb as fm
from flexmb.scene import schema as s
from flexmb.scene.files import load_scene
from flexmb.scene.functions import Ramp
from flexmb.scene.strains import strains
from tests.repo.project import ROOT

LARGE = ROOT / "cases" / "large_deflection"
STRIP = LARGE / "elastica" / "scene.toml"
THROWN = LARGE / "flying_spaghetti" / "scene.toml"
PRINCETON = LARGE / "princeton_beam" / "scene.toml"
SPUN = ROOT / "cases" / "spinning_beam" / "beam_k_supercritical" / "scene.toml"
RADIUS = 100.0  # of the 45-degree bend
ARC = {0.0: 1.0 / RADIUS, 0.25 * np.pi * RADIUS: 1.0 / RADIUS}  # its curvature at its ends


def bending(scene: fm.Scene, count: int, pieces: int = 1) -> fm.Scene:
    """The one beam of a plane scene with `count` polynomials of its curvature alone along each piece."""
    return strained(scene, s.StrainPolynomials(bending_y=count), pieces)


def strained(
    scene: fm.Scene, polynomials: s.StrainPolynomials, pieces: int = 1, points: int | None = None
) -> fm.Scene:
    """The one beam of a scene with these polynomials of its strains along each piece."""
    (beam,) = scene.bodies
    assert isinstance(beam, s.BeamBody)
    modes = s.Modes(count=0, polynomials=polynomials, pieces=pieces, points=points)
    return replace(scene, bodies=(replace(beam, level="exact", modes=modes),))


def at_rest_under(scene: fm.Scene, *direction: float) -> fm.Scene:
    """The scene with a tip force of t newton at time t, so that loads are times."""
    x, y, z = direction
    return replace(scene, loads=(replace(scene.loads[0], direction=(x, y, z), function=Ramp(rate=1.0)),))


def tip_at_rest(scene: fm.Scene, *loads: float) -> np.ndarray:
    """Position (3,) of the tip in equilibrium at the last of these times, reached through the others."""
    system = fm.compile(scene)
    state = system.initial_state
    for load in loads:
        state = fm.equilibrium(system, system.state(state.q, state.u, load))
    return system.evaluate(state.t, state.q, state.u).markers["tip"].position


def welded(scene: fm.Scene, bodies: int, polynomials: s.StrainPolynomials) -> fm.Scene:
    """The one uniform beam of a scene as so many bodies of level exact, an even number, welded to one another."""
    (beam,), (root,) = scene.bodies, scene.hinges
    assert isinstance(beam, s.BeamBody)
    length, first = beam.length_m / bodies, beam.stations[0]
    ends = first, replace(first, x_m=length)
    part = replace(
        beam, length_m=length, stations=ends, level="exact", nodes=(),
        modes=s.Modes(count=0, polynomials=polynomials),
    )  # fmt: skip
    names = [f"{beam.name}.{k}" for k in range(bodies)]
    welds = [
        s.Weld(name=f"weld.{k}", parent=inner, parent_node="tip", child=outer)
        for k, (inner, outer) in enumerate(zip(names, names[1:], strict=False))
    ]
    places = {"root": (names[0], "root"), "middle": (names[bodies // 2 - 1], "tip"), "tip": (names[-1], "tip")}

    def moved(item):
        body, node = places[item.node]
        return replace(item, body=body, node=node)

    return replace(
        scene, bodies=tuple(replace(part, name=name) for name in names),
        hinges=(replace(root, child=names[0]), *welds),
        loads=tuple(map(moved, scene.loads)), markers=tuple(map(moved, scene.markers)),
    )  # fmt: skip


def all_strains(count: int, others: int) -> s.StrainPolynomials:
    """`count` polynomials of twist and of each curvature, and `others` of stretch and of each shear."""
    curvatures = {"torsion": count, "bending_y": count, "bending_z": count}
    return s.StrainPolynomials(**curvatures, axial=others, shear_y=others, shear_z=others)


def bend_45(
    count: int, others: int, points: int | None = None, curvatures: Mapping[float, float] = ARC
) -> fm.Scene:
    """An eighth of a circle under a force on its tip across its plane: `count` polynomials of each curvature, and
    `others` of stretch and shears. The section of Bathe and Bolourchi with GJ = EI and GA = 5/6 of G A, E = 1e7.
    `curvatures` (1/m) at places along it (m) make it another bend."""
    EI, EA = 1e7 / 12.0, 1e7
    GA = 5.0 / 12.0 * EA
    length = max(curvatures)
    stations = [
        s.BeamStation(
            x_m=x, EA_N=EA, EIy_Nm2=EI, EIz_Nm2=EI, GJ_Nm2=EI, GAy_N=GA, GAz_N=GA, mass_per_length_kg_m=1.0,
            rotary_y_kg_m=1.0 / 12.0, rotary_z_kg_m=1.0 / 12.0, curvature_1_m=(0.0, 0.0, curvature),
        )
        for x, curvature in curvatures.items()
    ]  # fmt: skip
    scene = fm.SceneBuilder("45-degree bend", gravity=(0.0, 0.0, 0.0))
    modes = s.Modes(count=0, polynomials=all_strains(count, others), points=points)
    scene.beam("bend", length=length, elements=8, section=stations, modes=modes, level="exact")
    scene.weld("clamp", "ground", "bend")
    scene.force("lift", "bend", node="tip", direction=(0.0, 0.0, 1.0), function=Ramp(rate=1.0))
    scene.marker("tip", "bend", node="tip")
    return scene.scene()


def princeton(polynomials: s.StrainPolynomials, degrees: float, points: int | None = None) -> fm.Scene:
    """The Princeton beam under a tip force of t newton at time t, at an angle to its stiff direction."""
    angle = np.deg2rad(degrees)
    scene = at_rest_under(load_scene(PRINCETON), 0.0, float(np.cos(angle)), float(np.sin(angle)))
    return strained(scene, polynomials, points=points)


def free_beam(count: int) -> fm.Scene:
    """A free beam in space with `count` polynomials of torsion and both bendings, and a mass beside its tip."""
    section = [
        s.BeamStation(
            x_m=x, EA_N=1e6, EIy_Nm2=200.0, EIz_Nm2=300.0, GJ_Nm2=150.0, mass_per_length_kg_m=0.8, rotary_y_kg_m=0.002,
            rotary_z_kg_m=0.003,
        )
        for x in (0.0, 4.0)
    ]  # fmt: skip
    scene = fm.SceneBuilder("free beam", gravity=(0.0, 0.0, 0.0))
    lump = s.TipMass(x_m=4.0, mass_kg=0.5, com_m=(0.0, 0.1, 0.05))
    modes = s.Modes(count=count, families=("torsion", "bending_y", "bending_z"))
    scene.beam("beam", length=4.0, elements=8, section=section, modes=modes, level="exact", tip_masses=[lump])
    scene.free("flight", "ground", "beam")
    scene.marker("tip", "beam", node="tip")
    return scene.scene()


def bent(system: fm.System, turn: float) -> fm.State:
    """A state of the free beam, in flight, with its two lowest modes such that they turn the tip by `turn` (rad)."""
    state = system.initial_state
    rest = len(state.q) - len(strains(system.scene.bodies[0])) * system.scene.bodies[0].modes.count
    shape = np.zeros(len(state.q) - rest)
    shape[:2] = 1.0, 0.7

    def of_size(size: float) -> np.ndarray:
        return np.concatenate([state.q[:rest], size * shape])

    def turned(size: float) -> float:
        w = system.evaluate(0.0, of_size(size), state.u).markers["tip"].quaternion[0]
        return 2.0 * float(np.arccos(min(1.0, abs(w)))) - turn

    size = brentq(turned, 0.0, _first_beyond(turned), xtol=1e-12)
    u = np.concatenate([[0.3, 0.5, 0.8, 0.0, -0.3, 0.2], np.zeros_like(shape)])
    return system.state(of_size(size), u, 0.0)


def _first_beyond(turned) -> float:
    """A size of the shape at which the tip is turned by more than asked for."""
    size = 1e-3
    while turned(size) < 0.0:
        size *= 1.2
    return size
