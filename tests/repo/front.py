"""The picture and the table of the tour: speed against accuracy of all codes in the canonical cases.

    python -m tests.repo.front records.jsonl   # keep the figures of a session, and draw them
    python -m tests.repo.front                 # draw those that are kept

What is kept is what the first page of a report computes (`crosscheck.report.speed`): for every chart of a case the time
in which an engine reaches an error, relative to the fastest engine at an error of 1e-6, and the median over the charts.
"""

import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from statistics import median

import msgspec
import numpy as np

from crosscheck.judging.results import Session, collect
from crosscheck.records.archive import read
from crosscheck.records.session import standing
from crosscheck.report.html import places
from crosscheck.report.speed import LEVELS, ChartOfCase, fastest, speed_view
from tests.repo.project import ROOT, spliced

KEPT = ROOT / "docs" / "pictures" / "speed.json"
PICTURE = ROOT / "docs" / "pictures" / "speed.svg"
PLACES = {"docs/tour.md": "pictures/speed.svg"}  # where it is shown
START = "<!-- written by tests.repo.front -->\n"  # of the table on these pages
EXPONENTS = range(-1, -13, -1)
COLOURS = {
    "native": "#0072b2", "pinocchio": "#d55e00", "mujoco": "#009e73", "exudyn": "#b07a00", "exudyn-beam": "#b8609a",
}  # fmt: skip
NAMES = {
    "native": "flexmb", "pinocchio": "Pinocchio", "mujoco": "MuJoCo", "exudyn": "Exudyn",
    "exudyn-beam": "Exudyn's beams",
}  # fmt: skip
WIDTH, HEIGHT = 760, 420
LEFT, RIGHT, TOP, BOTTOM = 70, 90, 44, 54  # margins


class Curve(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An engine: its `runs` and the `medians`, each [relative time, error]."""

    engine: str
    charts: int
    runs: list[tuple[float, float]]
    medians: list[tuple[float, float]]


class Front(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the picture shows, and of which session it is."""

    session: str
    charts: int
    curves: list[Curve]


def kept(session: Session) -> Front:
    """The figures of a session."""
    view = speed_view(session, places((case.case.case for case in session.cases), single=True))
    last = session.environments[-1]
    found = [_curve(engine, view.charts) for engine in NAMES]
    about = f"{last.started[:10]}, {last.processor}, {last.cores} cores"
    return Front(about, len(view.charts), [curve for curve in found if curve.runs])


def _curve(engine: str, charts: Iterable[ChartOfCase]) -> Curve:
    part = [chart for chart in charts if any(point.engine == engine for point in chart.chart.points)]
    runs = [
        (_short(point.wall_s / each.unit_s), _short(max(point.error, each.chart.reference_uncertainty)))
        for each in part
        for point in each.chart.points
        if point.engine == engine and point.error is not None and point.wall_s > 0.0
    ]
    medians = []
    for exponent in EXPONENTS:
        times = [
            found[engine] / each.unit_s for each in part if engine in (found := fastest(each.chart, 10.0**exponent))
        ]
        if not times or 2 * len(times) < len(part):
            break
        medians.append((_short(median(times)), 10.0**exponent))
    return Curve(engine, len(part), runs, medians)


def _short(number: float) -> float:
    return float(f"{number:.3g}")


def picture(front: Front) -> str:
    """The SVG: both axes logarithmic, a pale point for each run, a line with the medians of each engine."""
    runs = np.log10([run for curve in front.curves for run in curve.runs])
    low, high = np.floor(runs.min(axis=0) - 0.05), np.ceil(runs.max(axis=0) + 0.05)
    low[0], high[1] = runs[:, 0].min() - 0.15, min(high[1], 0.0)

    def at(time: float, error: float) -> tuple[float, float]:
        x, y = (np.log10([time, error]) - low) / (high - low)
        return round(LEFT + x * (WIDTH - LEFT - RIGHT), 1), round(HEIGHT - BOTTOM - y * (HEIGHT - TOP - BOTTOM), 1)

    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}">',
        "<title>Speed against accuracy in the canonical cases</title>",
        "<style>text{font:13px sans-serif;fill:#1c2430}.t{font-weight:bold;font-size:15px}"
        ".s{font-size:11px;fill:#525d6b}"
        ".n{font-weight:bold;font-size:14px;paint-order:stroke;stroke:#fff;stroke-width:4px}"
        "path{fill:none}.g{stroke:#dde2e8}</style>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="8" fill="#fff"/>',
        _text(LEFT, 22, "Speed against accuracy, all canonical cases", "t"),
        _text(LEFT, 38, f"{front.charts} charts; lines are medians, points are runs ({front.session})", "s"),
    ]
    for exponent in range(int(np.ceil(low[0])), int(high[0]) + 1):
        x, bottom = at(10.0**exponent, 10.0 ** low[1])
        lines += [
            f'<path class="g" d="M{x} {TOP}V{bottom}"/>',
            _text(x, bottom + 18, _power(exponent, "×"), "", "middle"),
        ]
    for exponent in range(int(low[1]), int(high[1]) + 1, 2):
        x, y = at(10.0 ** low[0], 10.0**exponent)
        lines += [f'<path class="g" d="M{x} {y}H{WIDTH - RIGHT}"/>', _text(x - 6, y + 4, _power(exponent), "", "end")]
    middle = 0.5 * (LEFT + WIDTH - RIGHT)
    lines.append(
        _text(middle, HEIGHT - 12, "wall time, relative to the fastest code at an error of 1e-6", "", "middle")
    )
    turned = f'<g transform="translate(18 {0.5 * (TOP + HEIGHT - BOTTOM):g}) rotate(-90)">'
    lines.append(f"{turned}{_text(0, 0, 'error, relative to the range', '', 'middle')}</g>")
    for curve in front.curves:
        lines += _curve_lines(curve, at, high[1])
    return "\n".join([*lines, "</svg>", ""])


def table(front: Front) -> str:
    """The medians of the picture in Markdown, a line for each code and a column for each of `LEVELS`."""
    lines = [
        f"| code | charts |{''.join(f' {_power(round(np.log10(level)))} |' for level in LEVELS)}",
        f"|---|---|{'---|' * len(LEVELS)}",
    ]
    for curve in front.curves:
        found = {round(np.log10(error)): time for time, error in curve.medians}
        cells = (found.get(round(np.log10(level))) for level in LEVELS)
        times = "".join(" – |" if time is None else f" {float(f'{time:.2g}'):g} × |" for time in cells)
        lines.append(f"| {NAMES[curve.engine]} | {curve.charts} |{times}")
    return "\n".join([*lines, ""])


def with_table(page: str, front: Front) -> str:
    """A page with the table between its marks."""
    return spliced(page, START, f"\n{table(front)}\n")


def _curve_lines(curve: Curve, at: Callable[[float, float], tuple[float, float]], top: float) -> list[str]:
    colour = COLOURS[curve.engine]
    points = [at(time, error) for time, error in curve.runs if error <= 10.0**top]
    lines = [f'<g fill="{colour}" opacity="0.3">', *(f'<circle cx="{x}" cy="{y}" r="2.5"/>' for x, y in points), "</g>"]
    middle = [at(time, error) for time, error in curve.medians]
    if middle:
        lines.append(f'<path stroke="{colour}" stroke-width="3" d="M{"L".join(f"{x} {y}" for x, y in middle)}"/>')
        lines += [f'<circle cx="{x}" cy="{y}" r="4.5" fill="{colour}"/>' for x, y in middle]
        x, y = middle[-1]
        lines.append(f'<text x="{x + 9:g}" y="{y + 5:g}" class="n" style="fill:{colour}">{NAMES[curve.engine]}</text>')
    return lines


def _power(exponent: int, sign: str = "") -> str:
    number = f"{10.0**exponent:g}" if -3 < exponent < 5 else f"1e{exponent}"
    return f"{number} {sign}".strip()


def _text(x: float, y: float, text: str, kind: str, anchor: str = "start") -> str:
    return f'<text x="{x:g}" y="{y:g}" class="{kind}" text-anchor="{anchor}">{text}</text>'


def main(records: list[str]) -> None:
    for file in records:
        front = kept(collect(standing(read(Path(file)))))
        KEPT.write_bytes(msgspec.json.encode(front) + b"\n")
    front = msgspec.json.decode(KEPT.read_bytes(), type=Front)
    PICTURE.write_text(picture(front), encoding="utf-8")
    for page in PLACES:
        (ROOT / page).write_text(with_table((ROOT / page).read_text(encoding="utf-8"), front), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
