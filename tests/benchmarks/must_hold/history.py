"""How measured rows changed from commit to commit: tests/benchmarks/must_hold/history.jsonl, and the page drawn of it.

Every measurement that is kept is a line of that file, appended once and never changed. So the history goes on although
results.json holds the last measurement of each row only.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import groupby
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import msgspec

from tests.benchmarks.must_hold.catalogue import all_rows
from tests.benchmarks.must_hold.kept import Results
from tests.benchmarks.must_hold.row import Row
from tests.repo.project import ROOT

FILE = Path(__file__).with_name("history.jsonl")
PAGE = ROOT / "docs" / "performance-history.md"
FOLDER = ROOT / "docs" / "pictures" / "history"
NAMED_COMMITS = 12  # on the axis of a picture; more would cover each other
INTRODUCTION = """# History of performance

How the rows of [what must hold](performance.md) changed from commit to commit. The pictures show the margin of each
row: how many times better than its goal it was. 1 is the goal, and higher is better for times and for ratios alike. A +
after a commit says that sources had been changed. The machine may differ from point to point, and the speed of one
machine from day to day by some per cent; `tests/benchmarks/must_hold/history.jsonl` names the machines.

`python -m tests.benchmarks --write` appends what it has measured, and `python -m tests.benchmarks --from-kept --write`
draws this page anew.
"""


class Point(msgspec.Struct, frozen=True, array_like=True):
    """One measurement of a row, with its quartiles as in `tests.benchmarks.must_hold.row.Measured`."""

    date: str
    commit: str
    row: str
    value: float
    low: float
    high: float
    machine: str


def read_history(file: Path = FILE) -> list[Point]:
    """All measurements, the oldest first."""
    lines = file.read_bytes().splitlines() if file.exists() else []
    return [msgspec.json.decode(line, type=Point) for line in lines]


def append(results: Results, file: Path = FILE) -> list[Point]:
    """Append the measurements of `results` that the history does not have, and return all of it."""
    known = read_history(file)
    kept = [
        Point(
            row.date, row.commit, row.name, row.measured.value, row.measured.low, row.measured.high,
            row.machine.partition(";")[0],
        )
        for row in results.rows.values()
        if row.measured is not None
    ]  # fmt: skip
    new = sorted(set(kept) - set(known), key=lambda point: (point.date, point.commit, point.row))
    with file.open("ab") as lines:
        lines.writelines(msgspec.json.encode(point) + b"\n" for point in new)
    return known + new


def history_page(points: Iterable[Point]) -> str:
    """The text of docs/performance-history.md."""
    points = list(points)
    parts = [INTRODUCTION]
    for group, rows in groupby(_drawn(), key=lambda row: row.group):
        lines = [_line(row, mine) for row in rows if (mine := [point for point in points if point.row == row.name])]
        if lines:
            head = f"## {group}\n\n![{group}](pictures/history/{_slug(group)}.svg)\n"
            table = ["| row | first | latest | goal | margin, first and latest |", "|---|---|---|---|---|", *lines]
            parts.append(head + "\n" + "\n".join(table) + "\n")
    return "\n".join(parts)


def draw_history(points: Iterable[Point], folder: Path = FOLDER) -> None:
    """A picture for each group of rows: margins against commits, in the order in which they were measured."""
    points = list(points)
    commits = list(dict.fromkeys(point.commit for point in points))
    plt.switch_backend("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "flexmb", "svg.fonttype": "none", "font.size": 9})
    folder.mkdir(exist_ok=True)
    for group, rows in groupby(_drawn(), key=lambda row: row.group):
        figure, axes = plt.subplots(figsize=(7.2, 3.6), layout="constrained")
        for row in rows:
            mine = [point for point in points if point.row == row.name]
            places = [commits.index(point.commit) for point in mine]
            axes.semilogy(places, [margin(row, point) for point in mine], "o-", ms=4, label=row.name)
        axes.axhline(1.0, color="k", lw=0.8, ls="--")
        shown = range(0, len(commits), -(-len(commits) // NAMED_COMMITS))
        axes.set(xticks=shown, xticklabels=[commits[place] for place in shown], xlim=(-0.5, len(commits) - 0.5))
        axes.tick_params(axis="x", rotation=45)
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("{x:g}")
        axes.set(ylabel="times better than the goal", title=group)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
        figure.savefig(folder / f"{_slug(group)}.svg", metadata={"Date": None})
        plt.close(figure)


def margin(row: Row, point: Point) -> float:
    """How many times better than its goal a row was."""
    return point.value / row.goal if row.sense == "at least" else row.goal / point.value


def _drawn() -> list[Row]:
    """The rows with a margin: one whose goal is zero is met or it is not."""
    return [row for row in all_rows().values() if row.goal]


def _line(row: Row, points: list[Point]) -> str:
    first, latest = points[0], points[-1]
    unit = "" if row.unit == "x" else f" {row.unit}"
    values = [f"{point.value:.3g}{unit} ({point.commit}, {point.date})" for point in (first, latest)]
    margins = f"{margin(row, first):.2f} to {margin(row, latest):.2f}"
    return f"| `{row.name}` | {values[0]} | {values[1]} | {row.sense} {row.goal:.3g}{unit} | {margins} |"


def _slug(group: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", group.lower()).strip("-")
