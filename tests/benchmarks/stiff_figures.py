"""The pictures of the stiff cases, from a run of them: python -m tests.benchmarks.stiff_figures FOLDER

FOLDER is what `crosscheck run stiff --jobs 1 --out FOLDER` left. It also prints which method is fastest at which error,
the table of docs/integrators.md.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import matplotlib.pyplot as plt

from crosscheck.judging.results import CaseResults, collect
from crosscheck.library.case import Chart
from crosscheck.records.archive import read
from crosscheck.report.speed import fastest
from crosscheck.report.workprecision import WorkPrecision, work_precision
from tests.repo.project import ROOT

PICTURES = {
    "stiff/beam_with_axial_modes": "stiff_beam.png",
    "stiff/stiff_hinge_springs": "stiff_springs.png",
    "stiff/four_bar": "stiff_four_bar.png",
}
ERRORS = (1e-4, 1e-6, 1e-8)  # m
STYLES = {
    "native": ("dop853", "ko-"),
    "native-radau5": ("radau5", "C0s-"),
    "native-exponential": ("exponential", "C3D-"),
    "native-generalised-alpha": ("generalised_alpha", "C2v-"),
    "exudyn": ("Exudyn", "C5*:"),
    "mujoco": ("MuJoCo, RK4", "C4^:"),
    "pinocchio": ("Pinocchio, DOP853", "C1P:"),
}


def main(folder: Path) -> None:
    """Draw the pictures, here and beside the cases; print the table."""
    plt.switch_backend("agg")
    for results in collect(read(folder / "records.jsonl")).cases:
        charts = [chart for chart in (work_precision(results, asked) for asked in positions(results)) if chart]
        picture = ROOT / "docs" / "pictures" / PICTURES[results.case.case]
        draw(charts, picture)
        shutil.copy(picture, ROOT / "cases" / results.case.case / "picture.png")
        tabulate(results, charts)


def positions(results: CaseResults) -> list[Chart]:
    """The charts of a case that are about a position."""
    return [chart for chart in results.case.run.charts if chart.observable.endswith(".position")]


def runs(chart: WorkPrecision) -> dict[str, list[tuple[float, float]]]:
    """(Largest error in m, seconds) of the finished runs of every engine, in the order of its efforts."""
    found: dict[str, list[tuple[float, float]]] = {engine: [] for engine in STYLES}
    for point in chart.points:
        if point.error is not None and point.error < 1.0:
            found[point.engine].append((point.error * chart.scale, point.wall_s))
    return {engine: sorted(points, reverse=True) for engine, points in found.items() if points}


def draw(charts: list[WorkPrecision], picture: Path) -> None:
    """One panel a release."""
    plt.rcParams.update({"font.size": 9})
    size = (max(6.0, 3.5 * len(charts) + 1.0), 4.4)
    figure, rows = plt.subplots(
        ncols=len(charts), sharey=True, squeeze=False, figsize=size, layout="constrained", dpi=100
    )
    panels = rows[0]
    for axes, chart in zip(panels, charts, strict=True):
        for engine, points in runs(chart).items():
            label, style = STYLES[engine]
            axes.loglog(*zip(*points, strict=True), style, ms=5, lw=1.2, label=label)
        axes.set(title=chart.title.removeprefix("Tip position, "), xlabel="largest error (m)")
        axes.invert_xaxis()
        axes.grid(alpha=0.4)
    panels[0].set_ylabel("seconds")
    panels[-1].legend(*panels[0].get_legend_handles_labels(), fontsize=8, loc="lower right")  # where no run is
    figure.savefig(picture, metadata={"Software": None})
    plt.close(figure)


def tabulate(results: CaseResults, charts: list[WorkPrecision]) -> None:
    """Milliseconds of the fastest run of each engine that errs by at most so much."""
    print(results.case.run.title)
    for chart in charts:
        for error in ERRORS:
            found = fastest(chart, error / chart.scale)
            times = {engine: f"{1e3 * found[engine]:.3g}" if engine in found else "-" for engine in runs(chart)}
            row = ", ".join(f"{STYLES[engine][0]} {ms}" for engine, ms in times.items())
            print(f"  {chart.title}, {error:.0e} m: {row} ms")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
