"""What a digit costs in large deflection: python -m tests.benchmarks.digits [PROBLEM ...]

Every problem by one body or few bodies of level exact, by pieces of level stiffened and by Exudyn's beam elements: each
over its number of parts, methods, tolerances or steps, and the settings of its Newton iteration. Drawn and printed are
the runs that no other of the same family beats in both time and error. The picture is drawn when all problems were run.
"""

from __future__ import annotations

import sys
from time import perf_counter

import matplotlib
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from tests.benchmarks.digits.problem import Point, Problem, front
from tests.benchmarks.digits.problems import problems
from tests.repo.project import ROOT

PICTURE = ROOT / "docs" / "pictures" / "large_deflection_cost.svg"
COLUMNS = 4


def main(names: list[str]) -> None:
    """Run the named problems, or all of them and draw."""
    asked = [problem for problem in problems() if not names or problem.name in names]
    fronts = []
    for problem in asked:
        print(problem.title, file=sys.stderr, flush=True)
        fronts.append({family: front(problem.points(family)) for family in problem.families})
        _print(problem, fronts[-1])
    if not names:
        draw(asked, fronts)


def draw(asked: list[Problem], fronts: list[dict[str, list[Point]]]) -> None:
    """A panel for each problem."""
    plt.switch_backend("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "flexmb", "svg.fonttype": "none", "font.size": 8})
    rows = -(-len(asked) // COLUMNS)
    figure, axes = plt.subplots(rows, COLUMNS, figsize=(13.2, 3.1 * rows), layout="constrained", squeeze=False)
    for panel in axes.flat[len(asked) :]:
        panel.axis("off")
    for panel, problem, found in zip(axes.flat, asked, fronts, strict=False):
        _panel(panel, problem, found)
    for row in axes:
        row[0].set_ylabel("error / length")
    for panel in axes[-1]:
        panel.set_xlabel("time (s)")
    figure.savefig(PICTURE, metadata={"Date": None})


def _panel(axes: Axes, problem: Problem, found: dict[str, list[Point]]) -> None:
    for marker, (family, points) in zip("os^", found.items(), strict=False):
        axes.loglog([p.seconds for p in points], [p.error for p in points], f"{marker}-", ms=4, label=family)
        for point in points:
            parts, _, _ = point.label.partition(",")
            axes.annotate(parts, (point.seconds, point.error), xytext=(3, 3), textcoords="offset points", fontsize=6)
    axes.set_title(problem.title, fontsize=9)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=6)


def _print(problem: Problem, found: dict[str, list[Point]]) -> None:
    print(f"\n{problem.title}; truth: {problem.source}")
    for family, points in found.items():
        for point in points:
            print(f"  {family:20s} {point.error:8.1e} {1e3 * point.seconds:10.2f} ms  {point.label}")


if __name__ == "__main__":
    start = perf_counter()
    main(sys.argv[1:])
    print(f"{perf_counter() - start:.0f} s", file=sys.stderr)
