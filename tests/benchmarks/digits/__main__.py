"""What a digit costs in large deflection: python -m tests.benchmarks.digits [--draw | PROBLEM ...]

Every problem by one body or few bodies of level exact, by pieces of level stiffened and by Exudyn's beam elements, some
by Kratos' elements and MuJoCo's rods too: each over its number of parts, methods, tolerances or steps, steps of the
load, and the settings of its Newton iteration. Families take turns, twice. Drawn and printed are
the runs that no other of the same family beats in both time and error. They are kept in `results.json`, problem by
problem, from which the picture and the table of `docs/large-deflection.md` are made; `--draw` makes them again without
a run. For Kratos set OMP_NUM_THREADS=1: its threads wait busily, which counts as processor time.
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
from tests.benchmarks.digits.problems import CABLES, ELEMENTS, EXACT, KRATOS, PIECES, RODS, problems
from tests.repo.project import ROOT

PICTURE = ROOT / "docs" / "pictures" / "large_deflection_cost.svg"
RESULTS = Path(__file__).with_name("results.json")
PAGE = ROOT / "docs" / "large-deflection.md"
START, END = "<!-- ahead: written by python -m tests.benchmarks.digits --draw -->\n", "<!-- end -->"
COLUMNS = 4
PASSES = 2
OURS = (EXACT, PIECES)
STYLES = {
    EXACT: ("C0", "o"), PIECES: ("C1", "s"), CABLES: ("C2", "^"), ELEMENTS: ("C5", "<"), KRATOS: ("C3", "v"),
    RODS: ("C4", "D"),
}  # fmt: skip

Fronts = dict[str, dict[str, list[Point]]]


def main(names: list[str]) -> None:
    """Run the named problems, or all of them, keep what came out, and draw."""
    asked = problems()
    record = kept()
    for problem in asked:
        if "--draw" not in names and (not names or problem.name in names):
            print(problem.title, file=sys.stderr, flush=True)
            found = {family: list[Point]() for family in problem.families}
            for family in [*problem.families] * PASSES:
                found[family] += problem.points(family)
            record[problem.name] = {family: front(points) for family, points in found.items()}
            _print(problem, record[problem.name])
            RESULTS.write_bytes(msgspec.json.format(msgspec.json.encode(record)) + b"\n")
    there = [problem for problem in asked if problem.name in record]
    draw(there, record)
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(START)
    PAGE.write_text(before + START + table(there, record) + END + rest.partition(END)[2], encoding="utf-8")


def kept() -> Fronts:
    found = msgspec.json.decode(RESULTS.read_bytes(), type=Fronts) if RESULTS.exists() else {}
    return {name: {family: front(points) for family, points in of.items()} for name, of in found.items()}


def table(asked: list[Problem], kept: Fronts) -> str:
    """How many times as long as native a rival takes, at the errors of its runs, problem by problem."""
    heads = ("problem", "rival", "errors that it reaches", "its time over native's", "least at")
    lines = [f"| {' | '.join(heads)} | native not so accurate at |", "|---|---|---|---|---|---|"]
    for problem in asked:
        for rival, points in kept[problem.name].items():
            ratios = ahead(kept[problem.name], rival)
            beside = [each for each in ratios if each[0] > 0.0]
            if beside:
                errors = f"{points[0].error:.1e} to {points[-1].error:.1e}"
                (worst, at), beyond = min(beside), ", ".join(f"{error:.1e}" for ratio, error in ratios if ratio == 0.0)
                cells = (problem.title, rival, errors, f"{worst:.2g} to {max(beside)[0]:.3g}", f"{at:.1e}", beyond)
                lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def ahead(fronts: dict[str, list[Point]], rival: str) -> list[tuple[float, float]]:
    """Of each run of a rival its time over that of the fastest native run with at most its error, and the error; 0
    where no native run has so small an error. Nothing for native's own families."""
    native = [point for family in OURS for point in fronts.get(family, [])]
    if rival in OURS:
        return []
    ratios = []
    for point in fronts[rival]:
        good = [each.seconds for each in native if each.error <= point.error]
        ratios.append((point.seconds / min(good) if good else 0.0, point.error))
    return ratios


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
    handles = [panel.get_legend_handles_labels() for panel in axes.flat]
    every = {label: handle for panel in handles for handle, label in zip(*panel, strict=True)}
    figure.legend(every.values(), every.keys(), loc="lower right", fontsize=10)
    drawn = StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    short = re.sub(r"<!--.*?-->| id=\"[a-z.0-9]+_[0-9]+\"", "", drawn.getvalue())  # names that nothing uses
    rounded = re.sub(r"(\d\.\d\d)\d+", r"\1", short)  # a hundredth of a point is not seen
    PICTURE.write_text(re.sub(r"\n\s+", "\n", rounded), encoding="utf-8")


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
