"""What a digit costs in large deflection: python -m tests.benchmarks.digits [--draw | PROBLEM ...]

Every problem by one body or few bodies of level exact, by pieces of level stiffened and by Exudyn's beam elements: each
over its number of parts, methods, tolerances or steps, and the settings of its Newton iteration. Drawn and printed are
the runs that no other of the same family beats in both time and error. They are kept in `results.json`, problem by
problem, from which the picture is drawn; `--draw` draws it again without a run.
"""

from __future__ import annotations

import re
import sys
from io import StringIO
from pathlib import Path
from time import perf_counter

import matplotlib
import matplotlib.pyplot as plt
import msgspec
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator

from tests.benchmarks.digits.problem import Point, Problem, front
from tests.benchmarks.digits.problems import ELEMENTS, EXACT, PIECES, problems
from tests.repo.project import ROOT

PICTURE = ROOT / "docs" / "pictures" / "large_deflection_cost.svg"
RESULTS = Path(__file__).with_name("results.json")
COLUMNS = 4
STYLES = {EXACT: ("C0", "o"), PIECES: ("C1", "s"), ELEMENTS: ("C2", "^")}

Fronts = dict[str, dict[str, list[Point]]]


def main(names: list[str]) -> None:
    """Run the named problems, or all of them, keep what came out, and draw."""
    asked = problems()
    kept = _kept()
    for problem in asked:
        if "--draw" not in names and (not names or problem.name in names):
            print(problem.title, file=sys.stderr, flush=True)
            kept[problem.name] = {family: front(problem.points(family)) for family in problem.families}
            _print(problem, kept[problem.name])
            RESULTS.write_bytes(msgspec.json.format(msgspec.json.encode(kept)) + b"\n")
    draw([problem for problem in asked if problem.name in kept], kept)


def _kept() -> Fronts:
    return msgspec.json.decode(RESULTS.read_bytes(), type=Fronts) if RESULTS.exists() else {}


def draw(asked: list[Problem], kept: Fronts) -> None:
    """A panel for each problem."""
    plt.switch_backend("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "flexmb", "svg.fonttype": "none", "font.size": 8})
    rows = -(-len(asked) // COLUMNS)
    figure, axes = plt.subplots(rows, COLUMNS, figsize=(13.2, 2.9 * rows), layout="constrained", squeeze=False)
    for panel in axes.flat[len(asked) :]:
        panel.axis("off")
    for panel, problem in zip(axes.flat, asked, strict=False):
        _panel(panel, problem, kept[problem.name])
    for row in axes:
        row[0].set_ylabel("error / length")
    figure.legend(*axes.flat[0].get_legend_handles_labels(), loc="lower right", fontsize=10)
    drawn = StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    short = re.sub(r"<!--.*?-->| id=\"[a-z.0-9]+_[0-9]+\"", "", drawn.getvalue())  # names that nothing uses
    PICTURE.write_text(re.sub(r"\n\s+", "\n", short), encoding="utf-8")


def _panel(axes: Axes, problem: Problem, found: dict[str, list[Point]]) -> None:
    for family, points in found.items():
        colour, marker = STYLES[family]
        times, errors = [point.seconds for point in points], [point.error for point in points]
        axes.loglog(times, errors, f"{marker}-", color=colour, ms=3.5, lw=1.2, label=family)
        for point in points:
            parts, _, _ = point.label.partition(",")
            axes.annotate(parts, (point.seconds, point.error), xytext=(3, 3), textcoords="offset points", fontsize=6)
    axes.set_title(problem.title, fontsize=9)
    axes.set_xlabel("time (s)", fontsize=7)
    axes.minorticks_off()
    axes.yaxis.set_major_locator(LogLocator(numticks=6))
    low, high = axes.get_xlim()
    axes.set_xlim(min(low, 10.0 ** np.floor(np.log10(low * 3.0))), max(high, 10.0 ** np.ceil(np.log10(high / 3.0))))
    axes.grid(alpha=0.3)


def _print(problem: Problem, found: dict[str, list[Point]]) -> None:
    print(f"\n{problem.title}; truth: {problem.source}")
    for family, points in found.items():
        for point in points:
            print(f"  {family:20s} {point.error:8.1e} {1e3 * point.seconds:10.2f} ms  {point.label}")


if __name__ == "__main__":
    start = perf_counter()
    main(sys.argv[1:])
    print(f"{perf_counter() - start:.0f} s", file=sys.stderr)
