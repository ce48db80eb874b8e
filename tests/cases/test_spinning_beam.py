"""The spin-up cases against published numbers and closed forms, by routes that share as little as possible."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import asdict, replace
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh

from crosscheck.engines.contract import Run
from crosscheck.engines.registry import engine
from crosscheck.library.find import load_case
from flexmb.run.simulate import simulate
from flexmb.scene.files import load_scene
from flexmb.scene.schema import AngularCoordinate, Ramp, Scene, StrainPolynomials
from flexmb.surrogate import finite_segments, substructured
from flexmb.system.compile import compile

pytestmark = pytest.mark.filterwarnings("ignore:.*leaves out that this pulls it straight")  # fast turns are meant

FAMILY = Path(__file__).parents[2] / "cases" / "spinning_beam"
SPIN_UP_S = 15.0
PAST_MINIMUM_S = 8.0
SAFETY = 1.25  # of Richardson's estimate, as in the verdicts


@dataclass(frozen=True)
class Truth:
    """Published or closed-form numbers of the supercritical manoeuvre.

    `tip_minimum` (m) at `minimum_time` (s): linear beam with centrifugal stiffening. `passes_length` (s): when the
    unstiffened tip is a beam length off. `omega_1` (rad/s): critical speed. `stretch` (m) at the final speed.
    """

    rate: float
    tip_minimum: float
    minimum_time: float
    passes_length: float
    omega_1: float
    stretch: float


TRUTHS = {
    "beam_k_supercritical": Truth(4.0, -0.53456, 6.766, 10.115, 2.91032, 1.09608e-4),
    "beam_s_supercritical": Truth(6.0, -0.57436, 6.762, 9.164, 3.79773, 5.143175e-4),
}
# A geometrically exact beam code on beam S with 16 and 32 elements: what it published, and by how much it still moves.
EXACT_S, STILL_MOVES_S = -0.57398, 0.57398 - 0.57372
CASES = [
    pytest.param("beam_k_supercritical", id="K"),
    pytest.param("beam_s_supercritical", id="S", marks=pytest.mark.slow),
]


def rotating_frame(rate: float, times: np.ndarray, position: np.ndarray) -> np.ndarray:
    """(T,2) along and across the undeformed beam (m), where the hub has turned by the spin-up's angle."""
    T = SPIN_UP_S
    angle = rate / T * (times**2 / 2 + (T / (2 * np.pi)) ** 2 * (np.cos(2 * np.pi * times / T) - 1))
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    return np.array([np.sum(axis.T * position[:, :2], axis=1) for axis in (along, across)]).T


def minimum(times: np.ndarray, deflection: np.ndarray) -> tuple[float, float]:
    """Time (s) and value (m) of the smallest deflection between the samples."""
    spline = CubicSpline(times, deflection)
    where = spline.derivative().roots(extrapolate=False)
    best = where[np.argmin(spline(where))]
    return float(best), float(spline(best))


@cache
def segmented_minimum(case: str, segments: int) -> tuple[float, float]:
    """Tip minimum (s, m) of the chain of rigid segments in native code."""
    scene = finite_segments(load_scene(FAMILY / case / "scene.toml"), None, segments)
    times = np.linspace(0.0, PAST_MINIMUM_S, 161)
    # RK4 is stable to 2.8/omega; 32 segments have modes up to 7.4e3 rad/s (K) and 9.7e3 rad/s (S), 16 a quarter of it.
    done = simulate(compile(scene), PAST_MINIMUM_S, "rk4", step=2.5e-4 * (32 / segments), samples=times)
    assert done.finished
    return minimum(times, rotating_frame(TRUTHS[case].rate, times, done.markers["tip"].position)[:, 1])


@cache
def minimum_of_pieces(case: str, pieces: int, level: str) -> tuple[float, float]:
    """Tip minimum (s, m) of the beam in flexible pieces, by an implicit method that steps over their fast modes."""
    scene = substructured(load_scene(FAMILY / case / "scene.toml"), None, pieces, level=level)
    times = np.linspace(0.0, PAST_MINIMUM_S, 161)
    done = simulate(scene, PAST_MINIMUM_S, "radau5", rtol=1e-7, atol=1e-9, samples=times)
    assert done.finished
    return minimum(times, rotating_frame(TRUTHS[case].rate, times, done.markers["tip"].position)[:, 1])


@pytest.mark.parametrize("case", TRUTHS)
def test_flexible_pieces_reach_the_published_tip_minimum(case: str) -> None:
    """As for segments, of the published beam: its finite deflection is open. The error falls with the third power of
    the length of a piece at level stiffened and with the square at level full; both lead to one value."""
    truth = TRUTHS[case]
    length = load_scene(FAMILY / case / "scene.toml").bodies[0].length_m
    first, second, third = (minimum_of_pieces(case, n, "stiffened")[1] for n in (2, 4, 8))
    assert np.log2(abs(second - first) / abs(third - second)) > 2.0  # towards three, where the turn of a piece is small
    time, full = minimum_of_pieces(case, 16, "full")
    coarse = minimum_of_pieces(case, 8, "full")[1]
    extrapolated = full + (full - coarse) / 3.0
    assert abs(extrapolated - third) < SAFETY * (abs(full - coarse) / 3.0 * 0.25 + abs(third - second) / 3.0)
    finite = abs(truth.tip_minimum) * (truth.tip_minimum / length) ** 2
    assert abs(third - truth.tip_minimum) < finite + SAFETY * abs(third - second) / 3.0
    assert minimum_of_pieces(case, 8, "stiffened")[0] == pytest.approx(truth.minimum_time, abs=0.005)
    assert time == pytest.approx(truth.minimum_time, abs=0.02)


def test_flexible_pieces_and_nonlinear_beam_have_one_tip_minimum() -> None:
    """Beam K, which both codes have without shear; beam S of the nonlinear code has shear."""
    pytest.importorskip("exudyn")
    case = "beam_k_supercritical"
    (_, coarse), (_, fine) = (minimum_of_pieces(case, n, "stiffened") for n in (4, 8))
    beam = nonlinear_beam(case)
    assert abs(fine - beam.minima[-1]) < SAFETY * abs(fine - coarse) / 3.0 + beam.doubt


def spinning_steadily(scene: Scene, rate: float) -> Scene:
    """The scene with its hub turning at a constant rate from the start."""
    steady = AngularCoordinate(prescribed_rad=Ramp(rate=rate))
    return replace(scene, hinges=(replace(scene.hinges[0], rotation=steady),))


@pytest.mark.parametrize("case", TRUTHS)
@pytest.mark.parametrize("fraction", [0.5, 0.99, 1.01, 1.5])
def test_full_loses_its_stability_at_the_first_clamped_frequency(case: str, fraction: float) -> None:
    """At constant Omega the accelerations are -M^-1 (K - Omega^2 M) eta, linear in eta: its lowest eigenvalue is
    omega_1^2 - Omega^2, which changes sign at omega_1.

    The closed form has no rotary inertia; by Rayleigh's quotient it lowers omega_1 by the fraction
    1/2 (rotary/m') int phi'^2 / int phi^2 = 1/2 (rotary/m') 4.648/L^2. The literature value has its last digit.
    """
    truth, scene = TRUTHS[case], load_scene(FAMILY / case / "scene.toml")
    (beam,) = scene.bodies
    speed = fraction * truth.omega_1
    system = compile(spinning_steadily(scene, speed))
    rest, modes = system.initial_state, system.coordinate("beam.modes")
    free = system.speed("beam.modes")
    M = system.mass_matrix(rest)[free, free]
    columns = []
    for n in range(modes.start, modes.stop):
        q = rest.q.copy()
        q[n] = 1e-2
        columns.append(system.accelerations(system.state(q, rest.u))[free] / 1e-2)
    stiffness = -M @ np.array(columns).T
    lowest = eigh((stiffness + stiffness.T) / 2, M, eigvals_only=True)[0]
    rotary = beam.stations[0].rotary_z_kg_m / beam.stations[0].mass_per_length_kg_m
    allowed = 5e-6 + 0.5 * rotary * 4.648 / beam.length_m**2 * truth.omega_1
    assert np.sqrt(lowest + speed**2) == pytest.approx(truth.omega_1, abs=2 * allowed)
    assert (lowest > 0.0) == (speed < truth.omega_1)


@pytest.mark.parametrize("case", TRUTHS)
def test_unstiffened_tip_passes_the_length_of_the_beam(case: str) -> None:
    """The literature's time has three decimals."""
    truth, scene = TRUTHS[case], load_scene(FAMILY / case / "scene.toml")
    times = np.linspace(0.0, 10.5 if case == "beam_k_supercritical" else 9.4, 1051)
    done = simulate(compile(scene), times[-1], "dop853", rtol=1e-10, atol=1e-12, samples=times)
    assert done.finished
    across = rotating_frame(truth.rate, times, done.markers["tip"].position)[:, 1]
    passing = CubicSpline(times, np.abs(across) - scene.bodies[0].length_m).roots(extrapolate=False)
    assert passing[0] == pytest.approx(truth.passes_length, abs=1e-3)


def stiffened(case: str, **modes) -> Scene:
    """The scene with its beam at level stiffened; `modes` replace what it says of its modes."""
    scene = load_scene(FAMILY / case / "scene.toml")
    (beam,) = scene.bodies
    return replace(scene, bodies=(replace(beam, level="stiffened", modes=replace(beam.modes, **modes)),))


@pytest.mark.parametrize("case", TRUTHS)
def test_stiffened_reaches_the_published_tip_minimum(case: str) -> None:
    """With four modes, to a fraction (w/L)^2, below 0.5 %: the published beam is linear about the turning axis."""
    truth = TRUTHS[case]
    times = np.linspace(0.0, PAST_MINIMUM_S, 321)
    done = simulate(compile(stiffened(case)), PAST_MINIMUM_S, "dop853", rtol=1e-9, atol=1e-11, samples=times)
    assert done.finished
    time, tip = minimum(times, rotating_frame(truth.rate, times, done.markers["tip"].position)[:, 1])
    length = load_scene(FAMILY / case / "scene.toml").bodies[0].length_m
    assert tip == pytest.approx(truth.tip_minimum, rel=(truth.tip_minimum / length) ** 2)
    assert time == pytest.approx(truth.minimum_time, abs=0.01)


@pytest.mark.parametrize("case", TRUTHS)
def test_stiffened_stretches_as_a_spinning_rod(case: str) -> None:
    """With axial modes at rest under the final spin, to 0.5 %: what the third axial mode and those beyond it add.

    Modal shares of a uniform rod under a load that grows along it fall with the fourth power of the mode's number.
    """
    truth = TRUTHS[case]
    scene = spinning_steadily(stiffened(case, count=2, families=("axial",)), truth.rate)
    system = compile(scene)
    state, modes, rows = system.initial_state, system.coordinate("beam.modes"), system.speed("beam.modes")
    zero = system.bias(state)[rows]
    columns = []
    for n in range(modes.start, modes.stop):  # the force is linear in axial modes
        q = state.q.copy()
        q[n] = 1e-3
        columns.append((system.bias(system.state(q, state.u))[rows] - zero) / 1e-3)
    state.q[modes] = np.linalg.solve(np.array(columns).T, -zero)
    tip = system.evaluate(0.0, state.q, state.u).markers["tip"].position
    stretch = float(np.linalg.norm(tip)) - scene.bodies[0].length_m
    assert stretch == pytest.approx(truth.stretch, rel=5e-3)


@pytest.mark.parametrize("case", TRUTHS)
def test_stiffened_is_stable_above_the_first_clamped_frequency(case: str) -> None:
    """Over the whole manoeuvre, with stretch: the tip comes back, and energy less work stays."""
    truth = TRUTHS[case]
    times = np.linspace(0.0, SPIN_UP_S, 301)
    done = simulate(
        compile(stiffened(case, count=14, families=("bending_y", "axial"))), SPIN_UP_S, rtol=1e-9, atol=1e-11,
        samples=times,
    )  # fmt: skip
    assert done.finished
    motion = rotating_frame(truth.rate, times, done.markers["tip"].position)
    assert minimum(times, motion[:, 1])[1] == pytest.approx(truth.tip_minimum, rel=5e-3)
    assert np.max(np.abs(motion[times > 14.5, 1])) < 0.02 * abs(truth.tip_minimum)
    assert np.max(np.abs(done.energy_drift)) <= 1e-7 * done.energy_scale


@cache
def exact_minimum(case: str, more: int) -> tuple[float, float]:
    """Tip minimum (s, m) of one body of level exact, with `more` polynomials of each strain than the case has."""
    scene = load_scene(FAMILY / case / "exact.toml")
    (beam,) = scene.bodies
    strains = {name: count + more for name, count in asdict(beam.modes.polynomials).items() if count}
    beam = replace(beam, modes=replace(beam.modes, polynomials=StrainPolynomials(**strains)))
    times = np.linspace(0.0, PAST_MINIMUM_S, 161)
    done = simulate(compile(replace(scene, bodies=(beam,))), PAST_MINIMUM_S, "radau5", rtol=1e-8, samples=times)
    assert done.finished
    return minimum(times, rotating_frame(TRUTHS[case].rate, times, done.markers["tip"].position)[:, 1])


@pytest.mark.parametrize("case", TRUTHS)
def test_exact_reaches_the_published_tip_minimum(case: str) -> None:
    """The linear beam to a fraction (w/L)^2, and the published beam of finite rotation by what that still moves. The
    case's polynomials are 1e-5 of the deflection from two more of each, and those 1e-7 from another two."""
    truth, length = TRUTHS[case], load_scene(FAMILY / case / "scene.toml").bodies[0].length_m
    (_, few), (time, tip), (_, many) = (exact_minimum(case, more) for more in (0, 2, 4))
    assert abs(few - tip) < 1e-5 * abs(tip)
    assert abs(many - tip) < 1e-7 * abs(tip)
    assert tip == pytest.approx(truth.tip_minimum, rel=(truth.tip_minimum / length) ** 2)
    assert time == pytest.approx(truth.minimum_time, abs=2e-3)
    if case == "beam_s_supercritical":
        assert abs(tip - EXACT_S) < STILL_MOVES_S


@pytest.mark.parametrize("case", TRUTHS)
def test_exact_and_nonlinear_beam_have_one_tip_minimum(case: str) -> None:
    """Both have stretch, and beam S shear; what is left is the mesh of the elements, whose error in the length of an
    element is of second order or better: 16 of them are less than (1/16)^2 of the deflection off."""
    pytest.importorskip("exudyn")
    beam, (_, tip) = nonlinear_beam(case), exact_minimum(case, 2)
    assert abs(tip - beam.minima[-1]) < abs(tip) / 16**2 + beam.doubt


@pytest.mark.parametrize("case", CASES)
def test_segments_reach_the_published_tip_minimum(case: str) -> None:
    """The published beam is linear about the turning axis; finite deflection w changes it by a fraction (w/L)^2."""
    truth = TRUTHS[case]
    length = load_scene(FAMILY / case / "scene.toml").bodies[0].length_m
    (_, coarse), (time, fine) = segmented_minimum(case, 16), segmented_minimum(case, 32)
    extrapolated = fine + (fine - coarse) / 3.0  # second order in the number of segments
    finite = abs(truth.tip_minimum) * (truth.tip_minimum / length) ** 2
    assert abs(extrapolated - truth.tip_minimum) < finite + SAFETY * abs(fine - coarse) / 3.0
    assert time == pytest.approx(truth.minimum_time, abs=0.01)


@pytest.mark.parametrize("case", CASES)
def test_segments_and_nonlinear_beam_have_one_tip_minimum(case: str) -> None:
    pytest.importorskip("exudyn")
    (_, coarse), (_, fine) = segmented_minimum(case, 16), segmented_minimum(case, 32)
    beam = nonlinear_beam(case)
    assert abs(fine - beam.minima[-1]) < SAFETY * abs(fine - coarse) / 3.0 + beam.doubt


@pytest.mark.parametrize("case", TRUTHS)
def test_nonlinear_beam_reaches_the_published_tip_minimum(case: str) -> None:
    pytest.importorskip("exudyn")
    truth, beam = TRUTHS[case], nonlinear_beam(case)
    finite = abs(truth.tip_minimum) * (truth.tip_minimum / beam.length) ** 2
    assert abs(beam.minima[-1] - truth.tip_minimum) < finite + beam.doubt
    assert beam.time == pytest.approx(truth.minimum_time, abs=0.005)
    if case == "beam_s_supercritical":
        assert abs(beam.minima[-1] - EXACT_S) < STILL_MOVES_S + beam.doubt


@pytest.mark.parametrize("case", TRUTHS)
def test_nonlinear_beam_stretches_as_a_spinning_rod(case: str) -> None:
    """At the final speed the tip is out by the stretch, less the foreshortening of what still swings.

    Of a first mode with tip deflection d that is 1/2 int w'^2 = 1/2 (4.648/4) d^2/L; of higher modes, more.
    """
    pytest.importorskip("exudyn")
    beam, stretch = nonlinear_beam(case), TRUTHS[case].stretch
    out, across = beam.last
    foreshortened = 0.5 * 4.648 / 4.0 * across**2 / beam.length
    assert foreshortened < 0.1 * stretch
    assert out + foreshortened == pytest.approx(stretch, rel=0.01)


@dataclass(frozen=True)
class NonlinearBeam:
    """Tip minima (m) at successive steps, time of the last (s), its uncertainty, the last tip position (2,) less L."""

    minima: tuple[float, ...]
    time: float
    doubt: float
    last: np.ndarray
    length: float


@cache
def nonlinear_beam(case: str) -> NonlinearBeam:
    """Exudyn's beam of finite deflection at two steps: of second order, so a third of the difference remains."""
    loaded = load_case(FAMILY / case)
    scene = loaded.scene(loaded.run.variant("nonlinear beam"))
    code = engine("exudyn-beam")
    model, times = code.compile(scene), np.linspace(0.0, SPIN_UP_S, 151)
    length, found = scene.bodies[0].length_m, []
    for effort in code.efforts_for(scene, SPIN_UP_S)[-2:]:
        done = model.simulate(Run(times), effort)
        assert done.status == "finished"
        motion = rotating_frame(TRUTHS[case].rate, times, done.markers["tip"].position)
        found.append(minimum(times, motion[:, 1]))
    (_, coarse), (time, fine) = found
    doubt = SAFETY * abs(fine - coarse) / 3.0
    return NonlinearBeam((coarse, fine), time, doubt, motion[-1] - [length, 0.0], length)
