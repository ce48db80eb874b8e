"""What a digit costs in large deflection: python -m tests.benchmarks.large_deflection

Spin-up of beam K and the first seconds of the flying spaghetti: error against the time of a run, for bodies of level
exact, flexible pieces of both levels and rigid segments in native code, and nonlinear beam elements in Exudyn; and the
time of one evaluation against the number of pieces.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from msgspec.structs import replace

import flexmb as fm
from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.registry import engine
from flexmb.integrate.integrator import Method
from flexmb.scene.schema import Level, StrainPolynomials
from flexmb.surrogate import finite_segments, substructured
from tests.benchmarks.exact_scenes import bending, welded
from tests.benchmarks.rivals import interleaved
from tests.benchmarks.routes import articulated
from tests.cases.test_spinning_beam import FAMILY, TRUTHS, minimum, rotating_frame
from tests.repo.project import ROOT

Positions = dict[str, np.ndarray]
Point = tuple[float, float]  # seconds of a run and its error

CASE = "beam_k_supercritical"
SPUN = FAMILY / CASE / "scene.toml"
THROWN = ROOT / "cases" / "large_deflection" / "flying_spaghetti" / "scene.toml"
SPIN_UP = np.linspace(0.0, 8.0, 161)
FLIGHT = np.linspace(0.0, 2.5, 41)
LOWEST = -0.533761  # 64 cable elements, extrapolated over three steps; the last digit is open
STEPS = (0.0025, 0.00125)
LEVELS: tuple[Level, ...] = ("stiffened", "full")
THROWN_PIECES: tuple[tuple[str, Level, int], ...] = (
    ("pieces, stiffened", "stiffened", 2), ("pieces, full", "full", 2), ("pieces, no eigenmodes", "stiffened", 0),
)  # fmt: skip
COUNTS = (4, 8, 16, 32)
EXACT_MODES = (2, 3, 4, 5, 6, 8)
EXACT_STEP = 0.0125  # s
EXACT_BODIES = {
    "exact bodies": (StrainPolynomials(bending_y=4), (2, 4, 8)),
    "exact bodies, stretch and shear": (StrainPolynomials(bending_y=4, axial=1, shear_y=2), (4, 8, 12, 16)),
}
LONG_CHAINS = (4, 8, 16, 32, 64)


def main() -> None:
    """Draw the picture and print the table."""
    plt.switch_backend("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "flexmb", "svg.fonttype": "none", "font.size": 9})
    figure, (left, middle, right) = plt.subplots(ncols=3, figsize=(13.2, 4.2), layout="constrained")
    _draw(left, spin_up())
    left.set(ylabel="error of the tip minimum, part of it", title="Spin-up of beam K, 8 s")
    _draw(middle, flight())
    middle.set(ylabel="distance, rms over time (m)", title="Flying spaghetti, 2.5 s")
    scene = fm.load_scene(SPUN)
    for level in LEVELS:
        per_piece = [1e6 * evaluation(scene, n, level) / n for n in LONG_CHAINS]
        right.semilogx(LONG_CHAINS, per_piece, "o-", ms=4, label=f"pieces, {level}", base=2)
        print(level, {n: round(t, 2) for n, t in zip(LONG_CHAINS, per_piece, strict=True)}, "us a piece")
    right.set(xlabel="pieces of beam K", ylabel="time per piece of one evaluation (µs)", ylim=(0.0, None))
    right.set_title("Accelerations by the recursion: O(N)")
    right.legend(fontsize=8)
    figure.savefig(ROOT / "docs" / "pictures" / "large_deflection_cost.svg", metadata={"Date": None})


def spin_up() -> dict[str, dict[int, Point]]:
    """Seconds and relative error of the tip's lowest point, seen from the hub, by kind of model and number of parts."""
    scene = fm.load_scene(SPUN)

    def error(found: Positions) -> float:
        _, lowest = minimum(SPIN_UP, rotating_frame(TRUTHS[CASE].rate, SPIN_UP, found["tip"])[:, 1])
        return float(abs(lowest / LOWEST - 1.0))

    def run(chain: fm.Scene) -> Point:
        return timed(native(chain, "radau5", 1e-7, SPIN_UP), error)

    return {
        "one exact body, modes": {n: run(bending(scene, n)) for n in EXACT_MODES},
        "pieces, stiffened": {n: run(substructured(scene, None, n, level="stiffened")) for n in (1, 2, *COUNTS)},
        "pieces, full": {n: run(substructured(scene, None, n, level="full")) for n in COUNTS},
        "rigid segments": {n: run(finite_segments(scene, None, n)) for n in COUNTS},
        "cable elements, Exudyn": {n: timed(elements(scene, n, STEPS[0], SPIN_UP), error) for n in COUNTS},
    }


def flight() -> dict[str, dict[int, Point]]:
    """Seconds and error (m), root mean square over time of the marker that is farthest off; the truth extrapolated."""
    scene = fm.load_scene(THROWN)
    coarse, fine = (_together(elements(scene, 128, step, FLIGHT)()[0]) for step in STEPS)
    truth = fine + (fine - coarse) / 3.0

    def error(found: Positions) -> float:
        distance = np.linalg.norm(_together(found) - truth, axis=2).max(axis=0)
        return float(np.sqrt(np.mean(distance**2)))

    def run(count: int, level: Level, eigenmodes: int) -> Point:
        chain = substructured(scene, None, count, level=level, eigenmodes=eigenmodes)
        return timed(native(chain, "dop853", 1e-4, FLIGHT), error)

    def implicit(bodies: int, strains: StrainPolynomials) -> Point:
        return timed(native(welded(scene, bodies, strains), "generalised_alpha", 1e-4, FLIGHT, EXACT_STEP), error)

    return {
        **{name: {n: implicit(n, strains) for n in counts} for name, (strains, counts) in EXACT_BODIES.items()},
        **{name: {n: run(n, level, modes) for n in COUNTS[1:]} for name, level, modes in THROWN_PIECES},
        "exact elements, Exudyn": {n: timed(elements(scene, n, 0.01, FLIGHT), error) for n in COUNTS},
    }


def native(
    scene: fm.Scene, method: Method, tolerance: float, times: np.ndarray, step: float | None = None
) -> Callable[[], tuple[Positions, float]]:
    """A run in native code: positions of the markers and its seconds."""
    system = fm.compile(scene)
    fixed = {} if step is None else {"step": step}

    def run() -> tuple[Positions, float]:
        done = fm.simulate(system, times[-1], method, rtol=tolerance, atol=0.01 * tolerance, samples=times, **fixed)
        return _positions(done), done.statistics.run_s

    return run


def elements(scene: fm.Scene, count: int, step: float, times: np.ndarray) -> Callable[[], tuple[Positions, float]]:
    """The same of so many of Exudyn's elements."""
    code = engine("exudyn-beam")
    meshed = replace(scene, bodies=(replace(scene.bodies[0], elements=count),))

    def run() -> tuple[Positions, float]:
        done = code.compile(meshed).simulate(Run(times), Effort("step", step, "GeneralizedAlpha"))
        return _positions(done), done.wall_s

    return run


def timed(run: Callable[[], tuple[Positions, float]], error: Callable[[Positions], float]) -> Point:
    """Shortest of three runs, the first of which may compile, and the error of the last."""
    done = [run() for _ in range(3)]
    return min(seconds for _, seconds in done), error(done[-1][0])


def evaluation(scene: fm.Scene, pieces: int, level: Level) -> float:
    """Seconds of one evaluation of the accelerations."""
    (seconds,) = interleaved(articulated(fm.compile(substructured(scene, None, pieces, level=level))))
    return seconds


def _positions(done: Any) -> Positions:
    return {name: path.position for name, path in done.markers.items()}


def _together(found: Positions) -> np.ndarray:
    """Positions (markers, T, 3) in the order of the markers' names."""
    return np.array([found[name] for name in sorted(found)])


def _draw(axes: Axes, series: dict[str, dict[int, Point]]) -> None:
    for name, points in series.items():
        seconds, errors = np.array(list(points.values())).T
        axes.loglog(seconds, errors, "o-", ms=4, label=name)
        for n, (x, y) in points.items():
            axes.annotate(str(n), (x, y), xytext=(3, 3), textcoords="offset points", fontsize=7)
            print(f"{name:36s} {n:3d} {x:8.3f} s {y:9.1e}")
    axes.set(xlabel="time of a run (s); figures: pieces, segments, elements")
    axes.legend(fontsize=8)


if __name__ == "__main__":
    start = perf_counter()
    main()
    print(f"{perf_counter() - start:.0f} s")
