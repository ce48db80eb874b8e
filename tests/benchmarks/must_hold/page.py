"""docs/performance.md, made of the kept measurements and of nothing else."""

from __future__ import annotations

from itertools import groupby

from tests.benchmarks.must_hold.catalogue import all_rows
from tests.benchmarks.must_hold.kept import Kept, Results
from tests.benchmarks.must_hold.reasons import REASONS
from tests.benchmarks.must_hold.row import Row
from tests.benchmarks.must_hold.scaling import PICTURES
from tests.repo.project import ROOT

PAGE = ROOT / "docs" / "performance.md"
INTRODUCTION = """# Performance

What must hold, and what was measured. This page is generated from `tests/benchmarks/must_hold/results.json`:

<!-- not run: it measures, for half an hour -->
```sh
python -m tests.benchmarks                 # measure every row and print the table; it takes half an hour
python -m tests.benchmarks -k kernel       # only rows with this word in their names
python -m tests.benchmarks --special --write   # measure by special kernels too; keep all, and write this page
python -m tests.benchmarks --from-kept --write   # write this page and the pictures anew
```

Measured is what a user gets who sets nothing: the general kernels of the installation. Beside it stands what
[special kernels](kernels.md) give, which contain only what a scene needs, with the processor time to compile them.

Rivals take turns in one process, so that a busy machine slows both, and their results are compared before they are
timed. A figure is the median over the rounds, its spread the quartiles; of seconds of whole processes the least and the
largest. Times are processor time; behind a ratio are the native time and the rival's. Peers run without contacts,
constraints, sensors or output that the scene has none of. Where codes are compared at equal error, a tuner
(`tests/benchmarks/must_hold/tuning.py`) searches the settings of each code for the least time at that error; the grid
stands below the table, and what was found behind each ratio.
The same rows are pytest benchmarks: `python -m pytest tests/benchmarks/test_must_hold.py`.

What these figures say is of one machine. What a change does to the work of a kernel is held without a clock by
`tests/flexmb/jit/test_kernel_budget.py`, and accuracy by the tests of the suite: dense route, peers, identities.
"""


HEAD = (
    "| over, or of | measured | spread | special, s to compile | goal | | behind it | row |",
    "|---|---|---|---|---|---|---|---|",
)
OF_SPECIAL = " (special)"  # a figure that is not of the default


def page(results: Results) -> str:
    """The text of the page."""
    rows = all_rows()
    parts = [INTRODUCTION, _summary(results)]
    for group, members in groupby(rows.values(), key=lambda row: row.group):
        parts.append(_table(group, list(members), results))
    for picture in PICTURES.values():
        scaling = results.scaling.get(picture.name)
        if scaling is not None:
            parts.append(
                f"## {picture.title}\n\n{picture.text} Measured on {scaling.date}, commit {scaling.commit}.\n\n"
                f"![{picture.title}](pictures/{picture.name}.svg)\n"
            )
    parts.append(_machines(results))
    return "\n".join(parts)


def verdict(row: Row, kept: Kept | None) -> str:
    """In one word."""
    if kept is None:
        return "not measured"
    if kept.measured is None:
        return "failed"
    return "met" if row.is_met(kept.measured.value) else "missed"


def figures(row: Row, kept: Kept | None) -> tuple[str, str, str]:
    """Value, spread and what is behind them."""
    if kept is None:
        return "-", "-", ""
    if kept.measured is None:
        return "-", "-", kept.failure
    found = kept.measured
    value, low, high = (_number(each) for each in (found.value, found.low, found.high))
    apart = "" if found.difference is None else f"; results {found.difference:.0e} apart"
    mark = "" if kept.kernels == "auto" else OF_SPECIAL
    return f"{value} {_unit(row)}".strip() + mark, f"{low} to {high}", f"{found.detail}{apart}"


def special(row: Row, kept: Kept | None) -> str:
    """Value by special kernels, and the seconds it takes to compile them."""
    if kept is None or kept.special is None:
        return ""
    return f"{_number(kept.special.measured.value)} {_unit(row)}".strip() + f", {kept.special.compiled_s:.0f} s"


def goal(row: Row) -> str:
    """As the page says it."""
    return f"{row.sense} {_number(row.goal)} {_unit(row)}".strip()


def _unit(row: Row) -> str:
    return "" if row.unit == "x" else row.unit


def _number(value: float) -> str:
    return f"{value:.3g}"


def _summary(results: Results) -> str:
    words = [verdict(row, results.rows.get(name)) for name, row in all_rows().items()]
    marked = sum(kept.kernels != "auto" for kept in results.rows.values())
    said = f" Of {marked} rows, marked{OF_SPECIAL}, the default was not measured yet." if marked else ""
    return f"{words.count('met')} of {len(words)} rows are met.{said}\n"


def _table(group: str, rows: list[Row], results: Results) -> str:
    lines = [f"## {group}", "", *HEAD]
    for row in rows:
        kept = results.rows.get(row.name)
        value, spread, detail = figures(row, kept)
        word = verdict(row, kept)
        shown = word if word == "met" else f"**{word}**"
        beside = special(row, kept)
        cells = (row.what, value, spread, beside, goal(row), shown, detail.replace("|", "/"), f"`{row.name}`")
        lines.append(f"| {' | '.join(cells)} |")
    searched = [f"Settings that were searched: {text}" for text in dict.fromkeys(row.searched for row in rows) if text]
    return "\n".join([*lines, *(part for text in searched for part in ("", text)), *_reasons(rows, results)]) + "\n"


def _reasons(rows: list[Row], results: Results) -> list[str]:
    """Of those that are missed: where the time goes."""
    missed = {row.name for row in rows if verdict(row, results.rows.get(row.name)) == "missed"}
    reasons = [reason for reason in REASONS if missed & set(reason.rows)]
    unexplained = sorted(missed - {name for reason in reasons for name in reason.rows})
    lines = [f"Missed, {_names(sorted(missed & set(reason.rows)))}: {reason.text}" for reason in reasons]
    if unexplained:
        lines.append(f"Missed, {_names(unexplained)}: no profile says why yet.")
    return [part for line in lines for part in ("", line)]


def _names(names: list[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _machines(results: Results) -> str:
    """Rows by the machine and the commit they are from."""
    kept = sorted(results.rows.values(), key=lambda each: (each.machine, each.date, each.commit, each.name))
    lines = ["## Where and when", ""]
    for (machine, date, commit), rows in groupby(kept, key=lambda each: (each.machine, each.date, each.commit)):
        names = _names([row.name for row in rows])
        lines += [f"- {date}, commit {commit}, {machine}: {names}."]
    return "\n".join(lines) + "\n"
