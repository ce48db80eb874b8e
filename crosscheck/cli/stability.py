"""`crosscheck stability`: maps of where a motion or a method fails."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from crosscheck.cli import common
from crosscheck.running.scheduler import TIME_LIMIT_S, Limits
from crosscheck.running.schedulers import LOCAL, scheduler_at
from flexmb.scene.problems import closest


@common.app.command()
def stability(
    maps: Annotated[list[str], typer.Argument(help="Names of maps, `all`, or `list` to see which there are.")],
    out: common.Out = Path("out"),
    depth: Annotated[
        int | None,
        typer.Option(help="How often cells at a boundary are halved; by default what the map says.", min=0, max=8),
    ] = None,
    pictures: Annotated[Path | None, typer.Option(help="Folder for the pictures and maps.json; default --out.")] = None,
    fresh: common.Fresh = False,
    jobs: common.Jobs = None,
    time_limit: Annotated[
        float | None,
        typer.Option("--time-limit", metavar="SECONDS", help=f"Stop a longer cell; default {TIME_LIMIT_S:g}."),
    ] = None,
    scheduler: common.SchedulerAddress = LOCAL,
    as_json: common.Json = False,
) -> None:
    """
    Draw stability maps: where a method or a motion fails, beside the boundary that theory says.

    **Writes** into `--out` the records of each map, `<map>.jsonl`, and into `--pictures` `<map>.svg` and the verdicts,
    `maps.json`. A run that was stopped resumes where it was.

    **Exit code**: 0 every boundary lies within one of the finest cells of its overlay; 1 one does not, or cells did not
    run; 2 there is no such map.

    **Examples**: `crosscheck stability list` · `crosscheck stability vibrating_hinge --depth 5` ·
    `crosscheck stability all --pictures docs/pictures`
    """
    from crosscheck.stability.run import PROVIDER, maps_of
    from crosscheck.stability.verdict_file import VERDICTS
    from crosscheck.terminal.listings import maps_table
    from crosscheck.terminal.many_runs import run_and_draw

    common.check_limit(time_limit)
    known = maps_of(PROVIDER)
    if maps == ["list"] and as_json:
        axes = {name: {"x": stability_map.x.label, "y": stability_map.y.label} for name, stability_map in known.items()}
        common.print_json(
            {name: axes[name] | {"overlay": stability_map.overlay.name} for name, stability_map in known.items()}
        )
        return
    if maps == ["list"]:
        common.console.print(maps_table(known.values()))
        return
    chosen = list(known) if maps == ["all"] else maps
    for name in chosen:
        if name not in known:
            common.refuse(f'no map "{name}": {closest(name, known)}; `crosscheck stability list` shows them')
    with common.sole_writer(out):
        limits = Limits(jobs, time_limit)
        runs_on = scheduler_at(scheduler)
        code = run_and_draw(
            common.console, chosen, out, pictures or out, depth=depth, fresh=fresh, limits=limits, scheduler=runs_on
        )
    if as_json:
        typer.echo(((pictures or out) / VERDICTS).read_text(encoding="utf-8"), nl=False)
    raise typer.Exit(code)
