"""Beams in flexible pieces against the elastica, the Princeton beam, the flying spaghetti and the spin-up manoeuvres.

Where the truth is known to eight digits the order of convergence is tested, and what Richardson's extrapolation leaves;
where other codes are the truth, the distance to them against what both leave open.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from crosscheck.engines.contract import Run
from crosscheck.engines.registry import engine
from crosscheck.library.find import load_case
from crosscheck.running.plan import variant_scene
from flexmb.integrate.integrator import Method
from flexmb.linear.equilibrium import equilibrium
from flexmb.run.simulate import simulate
from flexmb.scene.files import load_scene
from flexmb.scene.functions import Ramp
from flexmb.scene.schema import BeamBody, Level, Scene
from flexmb.surrogate import substructured
from flexmb.system.compile import compile
from flexmb.system.system import System

FAMILY = Path(__file__).parents[2] / "cases" / "large_deflection"

# P L^2 / EI: deflection and shortening of the tip over L. Elliptic integrals, last digit rounded.
ELASTICA = {
    1.0: (0.30172077, 0.056433236), 2.0: (0.49345748, 0.16064172),
    5.0: (0.71379152, 0.38762836), 10.0: (0.81060902, 0.5549956),
}  # fmt: skip
ORDERS = {"full": 2, "stiffened": 3}

# Angle of the tip force 8.896 N against the stiff direction (deg): deflections (m) by beam elements of ANSYS, published
# by Obrezkov, Mikkola and Matikainen, Nonlinear Dynamics 109 (2022) 31, as quoted in a test of Exudyn's ANCF beams.
PRINCETON = {
    0: (0.0107142, 0.0), 15: (0.0106133, 0.0420823), 30: (0.0101117, 0.0793948), 45: (0.0088372, 0.1089879),
    60: (0.0066047, 0.1298876), 75: (0.0035389, 0.1421944), 90: (0.0, 0.1462460),
}  # fmt: skip


def loaded(case: str, direction: tuple[float, float, float]) -> Scene:
    """The scene of a case with a tip force of t newton at time t."""
    scene = load_scene(FAMILY / case / "scene.toml")
    return replace(scene, loads=(replace(scene.loads[0], direction=direction, function=Ramp(rate=1.0)),))


def tip_at_rest(system: System, loads: tuple[float, ...]) -> np.ndarray:
    """Position (3,) of the tip in static equilibrium under the last of `loads`, reached through the others."""
    state = system.initial_state
    for load in loads:
        state = equilibrium(system, system.state(state.q, state.u, load))
    return system.evaluate(state.t, state.q, state.u).markers["tip"].position


@cache
def strip(pieces: int, level: str) -> System:
    return compile(substructured(loaded("elastica", (0.0, 1.0, 0.0)), None, pieces, level=level))


@cache
def elastica(load: float, pieces: int, level: str) -> np.ndarray:
    """Errors of deflection and shortening of the tip, over L, under a tip force `load` EI / L^2 (L and EI are 1)."""
    fractions = (0.25 * load, 0.5 * load, 0.75 * load, load)
    x, y, _ = tip_at_rest(strip(pieces, level), fractions)
    return np.array([y, 1.0 - x]) - ELASTICA[load]


@pytest.mark.parametrize("load", [1.0, 2.0, 5.0])
@pytest.mark.parametrize("level", ORDERS)
def test_pieces_converge_to_the_elastica(load: float, level: str) -> None:
    """Level full: a piece does not foreshorten, an error of the square of its turn; stiffened: of the third power.

    The slope still drifts by the next order over the first, a turn theta = 1.5/16 of the last piece; extrapolation
    leaves a tenth of what it takes away.
    """
    order = ORDERS[level]
    coarse, fine = elastica(load, 8, level), elastica(load, 16, level)
    slope = np.log2(np.linalg.norm(coarse) / np.linalg.norm(fine))
    assert slope == pytest.approx(order, abs=0.15)
    extrapolated = fine + (fine - coarse) / (2.0**order - 1.0)
    assert np.linalg.norm(extrapolated) < 0.1 * np.linalg.norm(fine - coarse)


def test_ten_times_the_stiffness_bends_the_strip_back_on_itself() -> None:
    """P L^2 / EI = 10 turns the tip by 82 degrees: 16 stiffened pieces know its place to 4e-4 of the length."""
    assert np.abs(elastica(10.0, 16, "stiffened")).max() < 4e-4
    assert np.abs(elastica(10.0, 16, "full")).max() < 3e-3
    assert np.abs(elastica(10.0, 4, "stiffened")).max() > 1e-2  # and four do not


def princeton(
    degrees: float, pieces: int, torsion: float = 1.0, *, level: Level = "full", eigenmodes: int = 0
) -> np.ndarray:
    """Deflections (2,) of the tip (m); `torsion` multiplies the stiffness in torsion."""
    angle = np.deg2rad(degrees)
    scene = loaded("princeton_beam", (0.0, float(np.cos(angle)), float(np.sin(angle))))
    (bar,) = scene.bodies
    stations = tuple(replace(station, GJ_Nm2=torsion * station.GJ_Nm2) for station in bar.stations)
    modes = replace(bar.modes, families=("axial", *bar.modes.families))
    bar = replace(bar, stations=stations, modes=modes, theory="timoshenko")
    chain = substructured(replace(scene, bodies=(bar,)), None, pieces, level=level, eigenmodes=eigenmodes)
    return tip_at_rest(compile(chain), (8.896,))[1:]


def princeton_extrapolated(degrees: float, torsion: float = 1.0) -> tuple[np.ndarray, float]:
    """Richardson's value from 6 and 12 pieces of level full, and the size of its correction."""
    coarse, fine = princeton(degrees, 6, torsion), princeton(degrees, 12, torsion)
    correction = (fine - coarse) / 3.0
    return fine + correction, float(np.linalg.norm(correction))


@pytest.mark.parametrize("degrees", [0, 90])
def test_princeton_beam_in_one_plane_deflects_as_published(degrees: int) -> None:
    """Torsion has no part in it. The publication's mesh and correction of shear are worth 1e-4 (shear is 5e-4)."""
    found, _ = princeton_extrapolated(degrees)
    assert found == pytest.approx(np.array(PRINCETON[degrees]), rel=1e-4, abs=1e-12)


@pytest.mark.parametrize("degrees", [15, 60])
def test_princeton_beam_in_two_planes_deflects_as_published(degrees: int) -> None:
    """The publication does not say its stiffness in torsion. With that of the rectangle (St. Venant) the deflections
    across are within 1 % of it, and with 3.5 % more, as of a coarse mesh of the section, all are within 2e-5 m."""
    published = np.array(PRINCETON[degrees])
    found, _ = princeton_extrapolated(degrees)
    assert found == pytest.approx(published, rel=0.01)
    stiffer, doubt = princeton_extrapolated(degrees, 1.035)
    assert stiffer == pytest.approx(published, abs=1.5e-5 + 0.25 * doubt)
    assert np.abs(found - published).max() > 2.0 * np.abs(stiffer - published).max()


@pytest.mark.parametrize(("eigenmodes", "order"), [(0, 2), pytest.param(4, 3, marks=pytest.mark.slow)])
def test_a_bar_that_twists_converges_as_its_twist_may_vary_within_a_piece(eigenmodes: int, order: int) -> None:
    """Level stiffened: the attachment mode of torsion twists a piece evenly, an error of the square of its length; four
    eigenmodes include one of torsion. Both go where level full goes, to what the two extrapolations leave open."""
    coarse, middle, fine = (princeton(45.0, n, level="stiffened", eigenmodes=eigenmodes) for n in (4, 8, 16))
    slope = np.log2(np.linalg.norm(middle - coarse) / np.linalg.norm(fine - middle))
    assert slope == pytest.approx(order, abs=0.15)
    correction = (fine - middle) / (2.0**order - 1.0)
    found, doubt = princeton_extrapolated(45.0)
    assert fine + correction == pytest.approx(found, abs=0.25 * (doubt + float(np.linalg.norm(correction))))


def test_princeton_beam_against_geometrically_exact_elements_in_space() -> None:
    """The very same section in Exudyn's beam elements of finite rotation, both extrapolated with order 2."""
    exu = pytest.importorskip("exudyn")
    (bar,) = load_scene(FAMILY / "princeton_beam" / "scene.toml").bodies
    coarse, fine = (exact_in_space(exu, bar, np.deg2rad(45.0), 8.896, elements) for elements in (16, 32))
    found, doubt = princeton_extrapolated(45.0)
    theirs = (fine - coarse) / 3.0
    assert found == pytest.approx(fine + theirs, abs=0.25 * (doubt + float(np.linalg.norm(theirs))))


def exact_in_space(exu: Any, bar: BeamBody, angle: float, force: float, elements: int) -> np.ndarray:
    """Static deflection (2,) of the tip of a clamped beam under a tip force across it."""
    items, s = exu.itemInterface, bar.stations[0]
    mbs = exu.SystemContainer().AddSystem()
    section = exu.BeamSection()
    section.stiffnessMatrix = np.diag([s.EA_N, s.GAy_N, s.GAz_N, s.GJ_Nm2, s.EIy_Nm2, s.EIz_Nm2])
    section.massPerLength = s.mass_per_length_kg_m
    section.inertia = np.diag([s.rotary_y_kg_m + s.rotary_z_kg_m, s.rotary_y_kg_m, s.rotary_z_kg_m])
    at = np.linspace(0.0, bar.length_m, elements + 1)
    nodes = [mbs.AddNode(items.NodeRigidBodyRotVecLG(referenceCoordinates=[x, 0, 0, 0, 0, 0])) for x in at]
    for pair in zip(nodes, nodes[1:], strict=False):
        mbs.AddObject(
            items.ObjectBeamGeometricallyExact(
                nodeNumbers=list(pair), length=bar.length_m / elements, sectionData=section
            )
        )
    ground = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(items.NodePointGround()), coordinate=0))
    for coordinate in range(6):
        held = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=nodes[0], coordinate=coordinate))
        mbs.AddObject(items.CoordinateConstraint(markerNumbers=[ground, held]))
    tip = mbs.AddMarker(items.MarkerNodeRigid(nodeNumber=nodes[-1]))
    across = [0.0, float(force * np.cos(angle)), float(force * np.sin(angle))]
    mbs.AddLoad(items.LoadForceVector(markerNumber=tip, loadVector=across))
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    static = settings.staticSolver
    static.verboseMode, static.numberOfLoadSteps = 0, 5
    static.newton.relativeTolerance, static.newton.absoluteTolerance = 1e-7, 1e-6
    mbs.SolveStatic(settings)
    return np.array(mbs.GetNodeOutput(nodes[-1], exu.OutputVariableType.Displacement))[1:]


def test_flying_spaghetti_is_thrown_by_newtons_law_and_keeps_its_energy() -> None:
    """The mass centre in closed form, by the potential in a field of 1 m/s2; the work of the loads is all it gets.

    In the case's own pieces; the errors of its steps are 1e-8 of some 20 m, 20 m/s and 10 kg.
    """
    case = load_case(FAMILY / "flying_spaghetti")
    variant = case.run.variant("pieces")
    scene = variant_scene(case.scene(variant), variant)
    times = np.linspace(0.0, case.run.duration_s, case.run.samples)
    done = simulate(scene, times[-1], "dop853", rtol=1e-8, atol=1e-10, samples=times)
    assert done.finished
    pulled = compile(replace(scene, gravity_m_s2=(-1.0, 0.0, 0.0)))
    for t, q, u in zip(done.t[::15], done.q[::15], done.u[::15], strict=True):
        state = pulled.state(q, u, t)
        travelled = 0.4 * t**2 if t < 2.5 else 2.5 + 2.0 * (t - 2.5)
        assert pulled.energy(state)["gravity"] / 10.0 == pytest.approx(3.0 + travelled, abs=1e-6)
        assert pulled.momentum(state)[3:] == pytest.approx([8.0 * min(t, 2.5), 0.0, 0.0], abs=1e-6)
    energy = sum(done.energy.values())
    assert energy - done.work == pytest.approx(np.full(len(times), energy[0]), abs=1e-5 * energy[-1])
    assert np.ptp(energy[done.t >= 2.5]) < 1e-5 * energy[-1] < 0.1 * energy[-1] < done.work[-1]


@dataclass(frozen=True)
class InMotion:
    """A motion (s) that is not yet sensitive to what it starts from, and two numbers of pieces to compare in it."""

    duration: float
    eigenmodes: int
    pieces: tuple[int, int]
    method: Method

    @property
    def times(self) -> np.ndarray:
        return np.linspace(0.0, self.duration, 41)


IN_MOTION = {"elastica": InMotion(4.0, 0, (8, 16), "radau5"), "flying_spaghetti": InMotion(2.5, 2, (16, 32), "dop853")}


@cache
def exact_in_motion(case: str) -> np.ndarray:
    """Positions (markers, T, 3) by 64 of Exudyn's elements, as good as more pieces than are compared below."""
    scene = load_scene(FAMILY / case / "scene.toml")
    meshed = replace(scene, bodies=(replace(scene.bodies[0], elements=64),))
    code = engine("exudyn-beam")
    motion = IN_MOTION[case]
    done = code.compile(meshed).simulate(Run(motion.times), code.efforts_for(meshed, motion.duration)[-1])
    return np.array([done.markers[marker.name].position for marker in scene.markers])


def slope_in_motion(case: str, level: Level, eigenmodes: int) -> float:
    """Order by which the largest error of a marker, its root mean square over time, falls with the pieces' length."""
    scene, motion, errors = load_scene(FAMILY / case / "scene.toml"), IN_MOTION[case], []
    for count in motion.pieces:
        chain = substructured(scene, None, count, level=level, eigenmodes=eigenmodes)
        done = simulate(chain, motion.duration, motion.method, rtol=1e-6, atol=1e-8, samples=motion.times)
        found = np.array([done.markers[marker.name].position for marker in scene.markers])
        errors.append(np.linalg.norm(found - exact_in_motion(case), axis=2).max(axis=0))
    coarse, fine = (np.sqrt(np.mean(error**2)) for error in errors)
    return float(np.log2(coarse / fine))


@pytest.mark.slow
@pytest.mark.parametrize("case", IN_MOTION)
@pytest.mark.parametrize("level", ORDERS)
def test_pieces_converge_in_motion_as_they_do_at_rest(case: str, level: Level) -> None:
    """Against nonlinear elements of another code. Terms of the next order still move the slopes, and phases add up."""
    pytest.importorskip("exudyn")
    assert slope_in_motion(case, level, IN_MOTION[case].eigenmodes) == pytest.approx(ORDERS[level], abs=0.35)


@pytest.mark.slow
def test_waves_of_shear_that_pieces_do_not_resolve_slow_the_convergence() -> None:
    """Without eigenmodes a piece follows them by its ends alone: less than half of the order is left."""
    pytest.importorskip("exudyn")
    assert slope_in_motion("flying_spaghetti", "stiffened", eigenmodes=0) < 1.5
