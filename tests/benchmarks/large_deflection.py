"""What a digit costs in large deflection: python -m tests.benchmarks.large_deflection

Spin-up of beam K: error of the tip minimum against the time of a run, for flexible pieces of both levels and rigid
segments in native code, and cable elements in Exudyn; and the time of one evaluation against the number of pieces.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from msgspec.structs import replace

import flexmb as fm
from crosscheck.engines.contract import Run
from crosscheck.engines.registry import engine
from flexmb.surrogate import finite_segments, substructured
from tests.benchmarks.rivals import interleaved
from tests.benchmarks.routes import articulated
from tests.cases.test_spinning_beam import FAMILY, TRUTHS, minimum, rotating_frame
from tests.repo.project import ROOT

CASE = "beam_k_supercritical"
TIMES = np.linspace(0.0, 8.0, 161)
EXACT = -0.533761  # 64 cable elements, extrapolated over three steps; the last digit is open
COUNTS = (1, 2, 4, 8, 16, 32)
LONG_CHAINS = (4, 8, 16, 32, 64)


def main() -> None:
    """Draw the picture and print the table."""
    plt.switch_backend("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "flexmb", "svg.fonttype": "none", "font.size": 9})
    scene = fm.load_scene(FAMILY / CASE / "scene.toml")
    series: dict[str, dict[int, tuple[float, float]]] = {
        "pieces, stiffened": {n: native(substructured(scene, None, n, level="stiffened")) for n in COUNTS},
        "pieces, full": {n: native(substructured(scene, None, n, level="full")) for n in COUNTS[2:]},
        "rigid segments": {n: native(finite_segments(scene, None, n)) for n in COUNTS[2:]},
        "cable elements, Exudyn": {n: cables(scene, n) for n in (4, 8, 16, 32)},
    }
    figure, (left, right) = plt.subplots(ncols=2, figsize=(9.6, 4.2), layout="constrained")
    for name, points in series.items():
        seconds, errors = np.array(list(points.values())).T
        left.loglog(seconds, errors, "o-", ms=4, label=name)
        for n, (x, y) in points.items():
            left.annotate(str(n), (x, y), xytext=(3, 3), textcoords="offset points", fontsize=7)
            print(f"{name:24s} {n:3d} {x:8.3f} s {y:9.1e}")
    left.set(xlabel="time of a run (s)", ylabel="error of the tip minimum, part of it")
    left.set_title("Spin-up of beam K, 8 s; figures: pieces, segments, elements")
    left.legend(fontsize=8)
    for level in ("full", "stiffened"):
        per_piece = [1e6 * evaluation(scene, n, level) / n for n in LONG_CHAINS]
        right.semilogx(LONG_CHAINS, per_piece, "o-", ms=4, label=f"pieces, {level}", base=2)
        print(level, {n: round(t, 2) for n, t in zip(LONG_CHAINS, per_piece, strict=True)}, "us a piece")
    right.set(xlabel="pieces", ylabel="time per piece of one evaluation (µs)", ylim=(0.0, None))
    right.set_title("Accelerations by the recursion: O(N)")
    right.legend(fontsize=8)
    figure.savefig(ROOT / "docs" / "pictures" / "large_deflection_cost.svg", metadata={"Date": None})


def native(scene: fm.Scene) -> tuple[float, float]:
    """Seconds and relative error of the second of two runs, which compiles nothing."""
    system = fm.compile(scene)

    def run() -> fm.Trajectory:
        return fm.simulate(system, TIMES[-1], "radau5", rtol=1e-7, atol=1e-9, samples=TIMES)

    return timed(run, lambda done: done.markers["tip"].position, lambda done: done.statistics.run_s)


def cables(scene: fm.Scene, elements: int) -> tuple[float, float]:
    """The same of Exudyn, with the finest step of its engine."""
    code = engine("exudyn-beam")
    meshed = replace(scene, bodies=(replace(scene.bodies[0], elements=elements),))
    effort = code.efforts(meshed)[-1]
    return timed(
        lambda: code.compile(meshed).simulate(Run(TIMES), effort),
        lambda done: done.markers["tip"].position,
        lambda done: done.wall_s,
    )


def timed(run: Callable, position: Callable, seconds: Callable) -> tuple[float, float]:
    """Shortest of three runs and the error of the last."""
    done = [run() for _ in range(3)]
    _, lowest = minimum(TIMES, rotating_frame(TRUTHS[CASE].rate, TIMES, position(done[-1]))[:, 1])
    return min(seconds(each) for each in done), abs(lowest / EXACT - 1.0)


def evaluation(scene: fm.Scene, pieces: int, level: str) -> float:
    """Seconds of one evaluation of the accelerations."""
    (seconds,) = interleaved(articulated(fm.compile(substructured(scene, None, pieces, level=level))))
    return seconds


if __name__ == "__main__":
    start = perf_counter()
    main()
    print(f"{perf_counter() - start:.0f} s")
