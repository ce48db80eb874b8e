"""`crosscheck chart`: error against time over the efforts of all engines."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from crosscheck.cli import common
from crosscheck.cli.bench import Variants
from crosscheck.running.scheduler import Limits
from crosscheck.terminal.text import marked, words


@common.app.command()
def chart(
    cases: common.CaseWords,
    engine: common.EngineNames = None,
    variant: Variants = None,
    rounds: common.Rounds = 5,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for pictures, data and pages.")] = Path("charts"),
    time_limit: common.TimeLimit = None,
    quiet: common.Quiet = False,
    no_user_code: common.NoUserCode = False,
) -> None:
    """
    Draw error against time: every engine and integrator over its efforts.

    Errors are against the stored `reference.csv`, up to its horizon, and its uncertainty is drawn as the floor below
    which nothing can be told. All efforts are timed in turns, as by `crosscheck bench`. Engines and efforts that failed
    stand on the margin; the page says why, and how each engine is run so that the race is fair.

    **Writes** into `--out` an index and a folder for each case: SVG pictures, `charts.json`, a page.

    **Exit code**: 0 every case was drawn; 1 one was not; 2 the request makes no sense.

    **Examples**: `crosscheck chart tops/gyrostat --out charts` · `crosscheck chart canonical -e native -e mujoco`
    """
    shown = common.verbosity(quiet, False)
    chosen = common.asked(cases, engine or (), variant or (), time_limit)
    from crosscheck.terminal.progress import LiveProgress
    from crosscheck.timing.chart import chart as chart_case
    from crosscheck.timing.page import INDEX, write_case, write_index  # it loads matplotlib

    done = []
    with common.sole_writer(out):
        (out / INDEX).unlink(missing_ok=True)  # of earlier charts, should this command be killed
        for case in chosen:
            with LiveProgress(common.console, shown) as live:
                charts = chart_case(
                    case, engine or (), variant or (),
                    rounds=rounds, limits=Limits(1, time_limit), listener=live.hear,
                )  # fmt: skip
            done.append(charts)
            if charts.problem:
                common.console.print(marked("✕", "red", charts.problem), soft_wrap=True)
                continue
            page = write_case(charts, out)
            if not quiet:
                common.console.print(marked("✓", "green", f"{charts.case}: {page}"), soft_wrap=True)
        index = write_index(done, out)
    good = not any(point.problem for point in done)
    common.console.print(words(f"Index: {index}", "green" if good else "red"), soft_wrap=True)
    raise typer.Exit(int(not good))
