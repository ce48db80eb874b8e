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
    maps: Annotated[
        list[str],
        typer.Argument(
            help="Names of maps, `all`, Python files with maps of your own, or `list` to see which there are."
        ),
    ],
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
    no_user_code: common.NoUserCode = False,
) -> None:
    """
    Draw stability maps: where a method or a motion fails, beside the boundary that theory says.

    A file `my_map.py` is executed, here and in every worker, and all maps in its tuple `MAPS` are drawn;
    `docs/maps.md` has one to begin with.

    **Writes** into `--out` the records of each map, `<map>.jsonl`, and into `--pictures` `<map>.svg` and the verdicts,
    `maps.json`; `crosscheck report` shows those beside its records. A run that was stopped resumes where it was.

    **Exit code**: 0 every boundary lies within one of the finest cells of its overlay; 1 one does not, or cells did not
    run; 2 there is no such map, or a file has none.

    **Examples**: `crosscheck stability list` · `crosscheck stability vibrating_hinge --depth 5` ·
    `crosscheck stability my_map.py` ·
    `crosscheck stability all --pictures docs/pictures`
    """
    from crosscheck.library.case_error import CaseError
    from crosscheck.stability.run import PROVIDER, is_own_file, maps_of
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
    chosen = dict[str, str]()
    for word in maps:
        provider, names = PROVIDER, list(known) if maps == ["all"] else [word]
        if is_own_file(word):
            provider = str(Path(word).resolve())
            try:
                names = list(maps_of(provider))
            except CaseError as error:
                common.refuse(str(error))
        elif word not in known and maps != ["all"]:
            common.refuse(f'no map "{word}": {closest(word, known)}; `crosscheck stability list` shows them')
        for name in names:
            if chosen.setdefault(name, provider) != provider:
                common.refuse(f'two maps have the name "{name}": rename one, or give each --out of its own')
    with common.sole_writer(out):
        limits = Limits(jobs, time_limit)
        runs_on = scheduler_at(scheduler)
        code = run_and_draw(
            common.console, chosen, out, pictures or out, depth=depth, fresh=fresh, limits=limits, scheduler=runs_on
        )
    if as_json:
        typer.echo(((pictures or out) / VERDICTS).read_text(encoding="utf-8"), nl=False)
    raise typer.Exit(code)
