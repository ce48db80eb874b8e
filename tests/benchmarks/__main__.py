"""python -m tests.benchmarks: measure every row of what must hold and print the table. 1 where a row is not met.

Rows are measured as a user has them who sets no variable, whatever FLEXMB_KERNELS says; with --special also by special
kernels, which takes twice as long.
With --write the measurements are kept and appended to the history, and docs/performance.md, its pictures and
docs/performance-history.md are made of all that is kept.
"""

from __future__ import annotations

from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from flexmb.jit.installed import unfit
from tests.benchmarks.must_hold import history
from tests.benchmarks.must_hold.catalogue import all_rows
from tests.benchmarks.must_hold.kept import Kept, Scaling, read, write
from tests.benchmarks.must_hold.measure import measured_row
from tests.benchmarks.must_hold.page import PAGE, figures, goal, page, verdict
from tests.benchmarks.must_hold.row import Row
from tests.benchmarks.must_hold.scaling import PICTURES, draw, measured_curves


def main(
    words: Annotated[
        list[str] | None, typer.Option("--only", "-k", help="Rows and pictures with this in their names (repeat it).")
    ] = None,
    keep: Annotated[
        bool, typer.Option("--write", help="Keep the measurements; write the pages and their pictures.")
    ] = False,
    from_kept: Annotated[bool, typer.Option("--from-kept", help="Measure nothing: show what is kept.")] = False,
    scaling: Annotated[bool, typer.Option("--scaling", help="With --write: measure the curves of pictures.")] = False,
    special: Annotated[bool, typer.Option("--special", help="Measure by special kernels, too.")] = False,
) -> None:
    """Measure the rows of what must hold, each against its rival in turns."""
    console = Console()
    if not from_kept and unfit():
        raise typer.BadParameter(f"without general kernels the default is no default: {unfit()}")
    chosen = {name: row for name, row in all_rows().items() if _is_asked_for(name, words)}
    found = {name: kept for name, kept in read().rows.items() if name in chosen}
    curves = dict[str, Scaling]()
    if not from_kept:
        for name, row in chosen.items():
            found[name] = measured_row(row, special)
            if keep:  # a run that is stopped keeps what it has measured
                results = read()
                results.rows[name] = found[name]
                write(results)
            console.print(f"{name}: {verdict(row, found[name])}, {', '.join(figures(row, found[name]))}", style="dim")
        pictures = [picture for name, picture in PICTURES.items() if scaling and _is_asked_for(name, words)]
        curves = {picture.name: measured_curves(picture) for picture in pictures}
    console.print(_table(chosen, found))
    if keep:
        results = read()  # another process may have kept something meanwhile
        results.rows = {name: kept for name, kept in (results.rows | found).items() if name in all_rows()}
        results.scaling |= curves
        write(results)
        draw(results)
        PAGE.write_text(page(results), encoding="utf-8")
        points = history.append(results)
        history.draw_history(points)
        history.PAGE.write_text(history.history_page(points), encoding="utf-8")
    met = all(verdict(row, found.get(name)) == "met" for name, row in chosen.items())
    raise typer.Exit(0 if chosen and met else 1)


def _is_asked_for(name: str, words: list[str] | None) -> bool:
    return not words or any(word in name for word in words)


def _table(rows: dict[str, Row], found: dict[str, Kept]) -> Table:
    table = Table("row", "over, or of", "measured", "goal", "spread", "", "behind it")
    for name, row in rows.items():
        value, spread, detail = figures(row, found.get(name))
        table.add_row(name, row.what, value, goal(row), spread, verdict(row, found.get(name)), detail)
    return table


if __name__ == "__main__":
    typer.run(main)
