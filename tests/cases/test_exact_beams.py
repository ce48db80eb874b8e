"""Beams of level exact at rest against closed forms, publications and Exudyn's beam elements in space."""

import runpy
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.integrate import quad
from scipy.optimize import brentq

import flexmb as fm
from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.registry import engine
from flexmb.scene import schema as s
from flexmb.scene.files import load_scene
from flexmb.scene.functions import Ramp
from flexmb.system.watches import WAIVERS
from tests.benchmarks import exact_scenes as scenes
from tests.cases.test_large_deflection import ELASTICA, exact_in_space

CASES = Path(__file__).parents[2] / "cases"
FRAME = CASES / "frames" / "right_angle" / "scene.toml"
BEAMS = CASES / "beams"


def strip(count: int) -> fm.Scene:
    return scenes.bending(scenes.at_rest_under(load_scene(scenes.STRIP), 0.0, 1.0, 0.0), count)


@pytest.mark.parametrize(("count", "bound"), [(3, 2e-4), (4, 2e-5), (6, 2e-7)])
@pytest.mark.parametrize("load", [1.0, 2.0, 5.0])
def test_the_elastica_is_reached_by_few_polynomials(count: int, bound: float, load: float) -> None:
    x, y, _ = scenes.tip_at_rest(strip(count), *np.linspace(0.0, load, 5)[1:])
    assert np.hypot(*(np.array([y, 1.0 - x]) - ELASTICA[load])) < bound


def test_two_polynomials_are_too_few_for_a_tip_that_turns_by_82_degrees() -> None:
    x, y, _ = scenes.tip_at_rest(replace(strip(2), allow=WAIVERS), 2.5, 5.0, 7.5, 10.0)
    assert 1e-2 < np.hypot(*(np.array([y, 1.0 - x]) - ELASTICA[10.0])) < 3e-2


@pytest.mark.parametrize(("points", "bound"), [(8, 1e-5), (12, 1e-10)])
def test_an_end_moment_rolls_a_strip_up_twice(points: int, bound: float) -> None:
    """EI = 2, L = 1, M = 8 pi, after Simo and Vu-Quoc (1986, example 7.1): one polynomial has the angle exactly, and
    its points say how well the circle closes."""
    modes = s.Modes(count=1, families=("bending_y",), points=points)
    root = s.BeamStation(x_m=0.0, EA_N=1e6, EIy_Nm2=2.0, EIz_Nm2=2.0, GJ_Nm2=2.0, mass_per_length_kg_m=0.1)
    section = [root, replace(root, x_m=1.0)]
    scene = fm.SceneBuilder("rolled up", gravity=(0.0, 0.0, 0.0), allow=("few_points",))
    scene.beam("strip", length=1.0, elements=4, section=section, modes=modes, level="exact")
    scene.weld("clamp", "ground", "strip")
    scene.torque("moment", "strip", node="tip", direction=(0.0, 0.0, 1.0), function=Ramp(rate=1.0))
    scene.marker("tip", "strip", node="tip")
    whole = 8.0 * np.pi
    assert np.abs(scenes.tip_at_rest(scene.scene(), *(whole * k / 16.0 for k in range(1, 17)))).max() < bound


@pytest.mark.parametrize(("force", "published"), [(300.0, (58.84, 22.33, 40.08)), (600.0, (47.23, 15.79, 53.37))])
def test_the_45_degree_bend_is_where_it_was_published(force: float, published: tuple[float, float, float]) -> None:
    """Eight linear elements of Simo and Vu-Quoc (1986, example 7.5) are 0.25 % off, each number by 0.7 % at most."""
    found = scenes.tip_at_rest(scenes.bend_45(4, 3), *(force * k / 4.0 for k in range(1, 5)))
    assert found == pytest.approx(published, rel=7e-3)
    assert np.linalg.norm(found - published) < 2.5e-3 * np.linalg.norm(published)


def test_more_polynomials_and_points_do_not_move_the_bend() -> None:
    loads = (150.0, 300.0, 450.0, 600.0)
    coarse, fine = (scenes.tip_at_rest(scenes.bend_45(*each), *loads) for each in ((4, 3), (6, 5)))
    assert 1e-5 < np.linalg.norm(fine - coarse) < 2e-3


def test_the_princeton_beam_deflects_as_exudyns_elements_in_space() -> None:
    """27 modes and two meshes extrapolated: 4e-8 m apart of 0.109 m; without stretch and shear 5e-6 m."""
    exu = pytest.importorskip("exudyn")
    (bar,) = load_scene(scenes.PRINCETON).bodies
    coarse, fine = (exact_in_space(exu, bar, np.deg2rad(45.0), 8.896, elements) for elements in (16, 32))
    theirs = fine + (fine - coarse) / 3.0
    curvatures = dict.fromkeys(("torsion", "bending_y", "bending_z"), 6)
    others = dict.fromkeys(("axial", "shear_y", "shear_z"), 3)
    errors = [
        float(np.linalg.norm(scenes.tip_at_rest(scenes.princeton(each, 45.0, 12), 2.0, 4.0, 6.0, 8.896)[1:] - theirs))
        for each in (s.StrainPolynomials(**curvatures, **others), s.StrainPolynomials(**curvatures))
    ]
    assert errors[0] < 1e-7 < 2e-6 < errors[1] < 1e-5


INCH = 0.0254  # m
ONE_ELEMENT = {  # displacement of the tip by a spectral element of 18 nodes, BeamDyn and Kynema: m, of the bend in
    "composite": INCH * np.array([-9.02726627566296e-2, -6.47488486259039e-2, 1.22973648292371]),
    "twisted": np.array([-1.14152599954047, -1.71805334646493, -3.59321324027199]),
    "bend": np.array([-23.6459716009048, 13.7208006040058, 53.5776450626989]),
}


@pytest.mark.parametrize(("name", "bound"), [("composite", 1e-12), ("twisted", 1e-11)])
def test_equations_of_rods_at_rest_are_where_spectral_elements_are(name: str, bound: float) -> None:
    """`equations.py` of both cases by shooting, the load in steps, as other rods balance it too: of 18 nodes and 15
    the published tips differ by 3e-12 m at most."""
    scene = load_scene(BEAMS / name / "slow.toml")
    (load,) = scene.loads
    exact = runpy.run_path(str(BEAMS / name / "equations.py"))["exact"]
    tip = exact(np.linspace(0.0, load.function.duration_s, 13)[1:])["marker:tip.position"][-1]
    assert tip - [scene.bodies[0].length_m, 0.0, 0.0] == pytest.approx(ONE_ELEMENT[name], abs=bound)


@pytest.mark.parametrize(
    ("name", "strains", "points", "bound"),
    [("composite", (4, 3), 8, 5e-8), ("composite", (8, 6), 20, 1e-9), ("twisted", (6, 4), 10, 1e-5),
     ("twisted", (8, 6), 24, 5e-7)],
)  # fmt: skip
def test_rods_of_strain_modes_are_where_spectral_elements_are(
    name: str, strains: tuple[int, int], points: int, bound: float
) -> None:
    """Coupled sections, and a section that turns by 90 degrees along the beam. Bounds are twice what was measured."""
    scene = load_scene(BEAMS / name / "slow.toml")
    (load,), length = scene.loads, scene.bodies[0].length_m
    scene = replace(scene, loads=(replace(load, function=Ramp(rate=load.function.end_value)),))
    scene = scenes.strained(scene, scenes.all_strains(*strains), points=points)
    tip = scenes.tip_at_rest(scene, 0.25, 0.5, 0.75, 1.0) - [length, 0.0, 0.0]
    assert np.linalg.norm(tip - ONE_ELEMENT[name]) < bound


def test_a_bend_of_varying_curvature_is_where_spectral_elements_are() -> None:
    """Of the 45-degree bend BeamDyn and Kynema take the parabola through three of its points: at the root it leaves by
    3.2 degrees more than the arc, so that the tip is 0.18 in from the arc's. Its curvature is linear between stations,
    which leaves an error with the square of their distance."""
    (x_1, y_1), (x_2, y_2) = (38.2683, -7.61205), (70.7107, -29.2893)
    square = (y_2 / x_2 - y_1 / x_1) / (x_2 - x_1)
    slope = y_1 / x_1 - square * x_1
    root_turn = np.arctan(slope)
    bending = dict.fromkeys(("EIy_Nm2", "EIz_Nm2", "GJ_Nm2"), 8.333e5)
    shear = dict.fromkeys(("GAy_N", "GAz_N"), 41.6667e5)

    def length(x: float) -> float:
        return float(quad(lambda each: np.hypot(1.0, slope + 2.0 * square * each), 0.0, x, epsabs=1e-12)[0])

    def moved(stations: int) -> np.ndarray:
        places = np.linspace(0.0, length(x_2), stations)
        along = [brentq(lambda x, s=s: length(x) - s, -1.0, x_2 + 1.0, xtol=1e-12) for s in places]
        curvatures = 2.0 * square / np.hypot(1.0, slope + 2.0 * square * np.array(along)) ** 3
        scene = scenes.bend_45(6, 5, points=16, curvatures=dict(zip(places, curvatures, strict=True)))
        (bend,) = scene.bodies
        cut = tuple(replace(station, **bending, **shear) for station in bend.stations)
        scene = replace(scene, bodies=(replace(bend, stations=cut),))
        straight, lifted = (scenes.tip_at_rest(scene, *loads) for loads in ((0.0,), (150.0, 300.0, 450.0, 600.0)))
        c, s = np.cos(root_turn), np.sin(root_turn)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ (lifted - straight)

    coarse, fine = moved(17), moved(33)
    assert np.linalg.norm(fine - ONE_ELEMENT["bend"]) < 5e-3
    assert np.linalg.norm(fine + (fine - coarse) / 3.0 - ONE_ELEMENT["bend"]) < 2e-5


@cache
def critical_load(direction: float, count: int) -> float:
    """Load (N) at which the plane equilibria of the right-angle frame lose their stability, between two of 40 loads."""
    scene = load_scene(FRAME)
    (push, _) = scene.loads
    bodies = tuple(replace(body, modes=replace(body.modes, count=count)) for body in scene.bodies)
    push = replace(push, direction=(direction, 0.0, 0.0), function=Ramp(rate=1.0))
    system = fm.compile(replace(scene, bodies=bodies, loads=(push,)))
    state, before = system.initial_state, (0.0, 1.0)
    for load in np.linspace(0.05, 1.5, 30):
        state = fm.equilibrium(system, system.state(state.q, state.u, float(load)))
        square = -float(np.max((np.linalg.eigvals(fm.linearize(system, state).A) ** 2).real))  # omega^2 of the lowest
        if square < 0.0:
            return before[0] + (load - before[0]) * before[1] / (before[1] - square)
        before = float(load), square
    raise AssertionError("the frame stays in its plane")


def test_the_right_angle_frame_gives_way_at_the_published_load() -> None:
    """1.09 by Simo and Vu-Quoc (1986, example 7.6), whose last digit is half open; the other way it is another load."""
    assert critical_load(1.0, 4) == pytest.approx(1.09, abs=5e-3)
    assert critical_load(1.0, 3) == pytest.approx(critical_load(1.0, 4), rel=5e-4)
    assert critical_load(-1.0, 4) == pytest.approx(0.6804, abs=1e-3)


def test_equal_steps_pass_over_the_waves_of_shear_and_stretch() -> None:
    """Their frequencies are up to 2000 rad/s, and a step is 12.5 ms: Newton's first iterates are beyond the range of a
    body, where a method of small steps would say that the motion diverges. A smaller step makes little difference."""
    strains = s.StrainPolynomials(bending_y=4, axial=2, shear_y=3)
    system = fm.compile(replace(scenes.welded(load_scene(scenes.THROWN), 8, strains), allow=WAIVERS))
    coarse, fine = (
        fm.simulate(system, 1.0, "generalised_alpha", step=step, rtol=1e-6, atol=1e-7, samples=11)
        for step in (0.0125, 0.003125)
    )
    assert coarse.finished
    assert fine.finished
    apart = np.linalg.norm(coarse.markers["tip"].position - fine.markers["tip"].position, axis=1).max()
    assert apart < 5e-3


@pytest.mark.slow
def test_the_right_angle_frame_moves_as_two_meshes_of_exudyns_elements_say() -> None:
    """Through the loss of stability, at speeds of 5 m/s: extrapolated with order 2 they leave less than a quarter of
    the correction."""
    pytest.importorskip("exudyn")
    scene, times = load_scene(FRAME), np.linspace(0.0, 6.0, 121)

    def tip(name: str, effort: Effort, elements: int) -> np.ndarray:
        meshed = replace(scene, bodies=tuple(replace(body, elements=elements) for body in scene.bodies))
        done = engine(name).compile(meshed).simulate(Run(times), effort)
        assert done.status == "finished"
        return done.markers["tip"].position

    exact = tip("native", Effort("tolerance", 1e-6, "radau5"), 8)
    coarse, fine = (tip("exudyn-beam", Effort("step", 1.5625e-3, "GeneralizedAlpha"), count) for count in (16, 32))
    correction = (fine - coarse) / 3.0
    assert np.linalg.norm(fine + correction - exact, axis=1).max() < 0.25 * np.linalg.norm(correction, axis=1).max()
