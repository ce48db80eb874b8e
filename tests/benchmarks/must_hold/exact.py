"""Level exact: what its errors are where the truth is known, and what one evaluation costs.

Truths that are numbers are in closed form, of Exudyn's elements extrapolated, or of own refinement; each says which.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

import flexmb as fm
from flexmb.scene.files import load_scene
from flexmb.scene.schema import Modes, StrainPolynomials
from flexmb.scene.shapes import beam_section
from tests.benchmarks import exact_scenes as scenes
from tests.benchmarks.must_hold.native import kernel
from tests.benchmarks.must_hold.row import Measured, Row, duration, measured
from tests.benchmarks.rivals import ROUNDS, turns

GROUP = "Beams of level exact: errors"
COST = "Beams of level exact: one evaluation"
LOAD = 10.0  # P L^2 / EI of the elastica
BEND_TIP = (47.1501, 15.6847, 53.4755)  # m: 33 modes of a prototype, two numbers of points within 2e-5
SOROMOX_US, SOROMOX_DOFS = 860.0, 148  # of SoRoMoX 0.4 on a CPU, FP64, its authors' figure: dynamics terms, no solve
TURN = 0.5  # rad of the tip of the free beam


def rows() -> list[Row]:
    """Errors first, each with its own measure; then times of evaluations."""
    most: Callable[..., Row] = partial(Row, sense="at most")
    rest = "elastica at rest, P L²/EI = 10"
    return [
        most("exact_rest_4", GROUP, f"{rest}, 4 modes", 3e-5, partial(_rest, 4), unit="L"),
        most("exact_rest_8", GROUP, f"{rest}, 8 modes", 1e-8, partial(_rest, 8), unit="L"),
        most("exact_princeton", GROUP, "Princeton beam at 45°, 27 modes, of Exudyn's", 1e-7, _princeton, unit="m"),
        most("exact_bend", GROUP, "45-degree bend under 600, 21 modes", 2e-3, _bend, unit="m"),
        most("exact_energy", GROUP, "free flight, bent by 0.5 rad, energy", 1e-10, partial(_flight, 0), unit=""),
        most("exact_momentum", GROUP, "free flight, bent by 0.5 rad, momenta", 1e-10, partial(_flight, 1), unit=""),
        most("exact_plane", COST, "4 modes in the plane, of a stiffened body of 4", 1.5, partial(_cost, _plane)),
        most("exact_space", COST, "12 modes in space, of a stiffened body of 4", 4.0, partial(_cost, _space)),
        most("exact_pieces", COST, "derivatives of eight pieces of a body, of eight welded bodies", 12.0, _pieces),
        Row("exact_soromox", COST, "SoRoMoX for each dof, its authors' figure, 5 bodies of 12 modes", 25.0, _soromox),
    ]


@cache
def elastica(load: float) -> np.ndarray:
    """Place (2,) of the tip of a strip of unit length and stiffness under a force across it, by elliptic integrals."""
    root = np.sqrt(load)

    def missing(k: float) -> float:
        return ellipk(k * k) - ellipkinc(np.arcsin(1.0 / (k * np.sqrt(2.0))), k * k) - root

    k = brentq(missing, np.sqrt(0.5) + 1e-12, 1.0 - 1e-14, xtol=1e-16)
    m, amplitude = k * k, np.arcsin(1.0 / (k * np.sqrt(2.0)))
    return np.array([np.sqrt(2.0 * (2.0 * m - 1.0)) / root, 1.0 - 2.0 / root * (ellipe(m) - ellipeinc(amplitude, m))])


def _rest(count: int) -> Measured:
    scene = scenes.bending(scenes.at_rest_under(load_scene(scenes.STRIP), 0.0, 1.0, 0.0), count)
    tip = scenes.tip_at_rest(scene, *np.linspace(0.0, LOAD, 6)[1:])
    return _exactly(float(np.linalg.norm(tip[:2] - elastica(LOAD))), "of elliptic integrals")


def _princeton() -> Measured:
    import exudyn

    from tests.cases.test_large_deflection import exact_in_space

    curvatures = dict.fromkeys(("torsion", "bending_y", "bending_z"), 6)
    others = dict.fromkeys(("axial", "shear_y", "shear_z"), 3)
    polynomials = StrainPolynomials(**curvatures, **others)
    scene = scenes.princeton(polynomials, 45.0)
    found = scenes.tip_at_rest(scene, 2.0, 4.0, 6.0, 8.896)[1:]
    (bar,) = load_scene(scenes.PRINCETON).bodies
    coarse, fine = (exact_in_space(exudyn, bar, np.deg2rad(45.0), 8.896, n) for n in (16, 32))
    theirs = fine + (fine - coarse) / 3.0
    detail = "Exudyn's 16 and 32 elements extrapolated; default points"
    return _exactly(float(np.linalg.norm(found - theirs)), detail)


def _bend() -> Measured:
    found = scenes.tip_at_rest(scenes.bend_45(4, 3), 150.0, 300.0, 450.0, 600.0)
    return _exactly(float(np.linalg.norm(found - BEND_TIP)), f"of {BEND_TIP}, by a prototype of its own code")


def _flight(which: int) -> Measured:
    """Largest drift of energy, or of linear and angular momentum, of the largest magnitude."""
    return _exactly(_drifts()[which], "dop853 at rtol 1e-10, 2 s")


@cache
def _drifts() -> tuple[float, float]:
    system = fm.compile(scenes.free_beam(3))
    state = scenes.bent(system, TURN)
    done = fm.simulate(system, 2.0, "dop853", state=state, rtol=1e-10, atol=1e-12, samples=21)
    energy = sum(done.energy.values())
    momenta = np.hstack([done.momentum[:, :3], done.momentum[:, 3:]])
    sizes = np.repeat(np.linalg.norm(momenta[0].reshape(2, 3), axis=1), 3)
    return float(np.abs(energy / energy[0] - 1.0).max()), float(np.abs((momenta - momenta[0]) / sizes).max())


def _plane(level: str) -> fm.System:
    return _pendulum(Modes(count=4, families=("bending_y",)), level)


def _space(level: str) -> fm.System:
    if level != "exact":
        return _plane(level)
    return _pendulum(Modes(count=4, families=("torsion", "bending_y", "bending_z")), level)


def _pendulum(modes: Modes, level: str) -> fm.System:
    scene = fm.SceneBuilder("pendulum", gravity=(0.0, -9.81, 0.0))
    section = beam_section(E=7e10, G=2.7e10, A=1e-3, Iy=2e-7, Iz=1e-7, rho=2700.0)
    scene.beam("beam", length=2.0, elements=12, section=section, modes=modes, level=level)
    scene.revolute("pivot", "ground", "beam", axis=(0.0, 0.0, 1.0), angle=0.3, rate=0.2)
    return fm.compile(scene.scene())


def _cost(system: Callable[[str], fm.System]) -> Measured:
    exact, stiffened = (kernel(system(level)) for level in ("exact", "stiffened"))
    seconds = turns(exact.call, stiffened.call, rounds=ROUNDS) / exact.samples
    mine, other = np.median(seconds, axis=0)
    return measured(seconds[:, 0] / seconds[:, 1], f"{duration(mine)} against {duration(other)}")


def _pieces() -> Measured:
    """Of accelerations, in space, from Python."""
    scene, polynomials = load_scene(scenes.PRINCETON), StrainPolynomials(torsion=4, bending_y=4, bending_z=4)
    calls = list[Callable[[], object]]()
    for each in (scenes.strained(scene, polynomials, 8), scenes.welded(scene, 8, polynomials)):
        system = fm.compile(each)
        state = system.initial_state
        calls.append(partial(system.derivative_evaluator(), 0.0, state.q, state.u))
    seconds = turns(*calls, rounds=ROUNDS)
    mine, other = np.median(seconds, axis=0)
    return measured(seconds[:, 0] / seconds[:, 1], f"{duration(mine)} against {duration(other)}")


def _soromox() -> Measured:
    """Time for each dof; theirs is what its authors publish, measured on their machine."""
    scene = fm.SceneBuilder("five exact beams", gravity=(0.0, 0.0, -9.81))
    section = beam_section(E=7e10, G=2.7e10, A=1e-3, Iy=2e-7, Iz=1e-7, rho=2700.0)
    modes = Modes(count=4, families=("torsion", "bending_y", "bending_z"))
    for k in range(5):
        scene.beam(f"b{k}", length=0.4, elements=8, section=section, modes=modes, level="exact")
        parent, at = ("ground", {}) if k == 0 else (f"b{k - 1}", {"parent_node": "tip"})
        scene.weld(f"w{k}", parent, f"b{k}", **at)
    each = kernel(fm.compile(scene.scene()))
    seconds = turns(each.call, rounds=ROUNDS)[:, 0] / each.samples
    theirs = SOROMOX_US / SOROMOX_DOFS
    detail = f"{duration(float(np.median(seconds)))} for 60 dofs; theirs 860 µs for 148, stated, not measured here"
    return measured(theirs * 60.0 / (1e6 * seconds), detail)


def _exactly(value: float, detail: str) -> Measured:
    """A number that no clock enters."""
    return Measured(value, value, value, detail)
