"""The command `crosscheck`: it reads the command line and shows results; the work is done by the other rooms."""

from __future__ import annotations

import warnings
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from math import inf
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from rich.console import Console

from crosscheck.judging.accept import NotAccepted, accept_figures
from crosscheck.library import find
from crosscheck.library.case import CaseError
from crosscheck.library.selection import without_part
from crosscheck.records.lock import FolderInUseError, locked
from crosscheck.records.session import last_session, standing
from crosscheck.report import Choice, write_all
from crosscheck.running.installed import describe_engines
from crosscheck.running.pool import TIME_LIMIT_S, Limits
from crosscheck.running.sweep import sweep
from crosscheck.terminal.csv_channels import channels_table
from crosscheck.terminal.listings import cases_table, engines_table, maps_table
from crosscheck.terminal.live import LiveProgress
from crosscheck.terminal.text import words
from crosscheck.terminal.verdicts import print_outcome
from crosscheck.verify.against_case import sample_times_csv, verify_csv
from flexmb.output.writing import in_words
from flexmb.scene.problems import closest

EXIT_USAGE = 2

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    help="""
Run the same multibody scene in independent codes and say who **agrees** with whom, on what, by how much, how fast.

Start with `crosscheck run canonical`, then open the report whose path it prints.
`crosscheck list` shows the cases, `crosscheck engines` the codes that are installed here.
""",
)
console = Console(markup=False, emoji=False)  # names and paths stand in what it prints

Out = Annotated[Path, typer.Option("--out", "-o", help="Folder for records, verdicts and report.")]
TimeLimit = Annotated[
    float | None,
    typer.Option(
        "--time-limit", metavar="SECONDS", help=f"Stop what takes longer; default the case's limit or {TIME_LIMIT_S:g}."
    ),
]
Jobs = Annotated[
    int | None, typer.Option("--jobs", "-j", min=1, help="Worker processes; by default one per core.")
]
Strict = Annotated[bool, typer.Option("--strict", help="Figures worse than recorded, or not recorded, are errors.")]
Open = Annotated[bool, typer.Option("--open", help="Open the report in the browser when done.")]


@app.command()
def run(
    cases: Annotated[
        list[str],
        typer.Argument(help="Case names, a tag such as `canonical`, `all`, or folders that hold a run.toml."),
    ],
    engine: Annotated[
        list[str] | None,
        typer.Option("--engine", "-e", help="Only these engines (repeat it). One alone is compared with its partners."),
    ] = None,
    out: Out = Path("out"),
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget the records in --out instead of resuming.")] = False,
    jobs: Jobs = None,
    time_limit: TimeLimit = None,
    accept: Annotated[
        bool, typer.Option("--accept", help="Write the figures reached into each case's accepted.toml, for review.")
    ] = False,
    strict: Strict = False,
    open_report: Open = False,
) -> None:
    """
    Run cases in all engines, judge them, write the report.

    **Writes** into `--out`: `report.html` (open it), `verdicts.json`, `summary.md`, `junit.xml`, `records.jsonl`.
    A run that was stopped resumes where it was: what is recorded is not run again, as long as the scene, the effort
    and everything that made it are the same: sources, libraries, machine. The report shows what this run asked for;
    `crosscheck report` shows everything that the records hold. One run at a time writes into a folder.

    An engine that takes longer for a scene than `--time-limit` says (or the case, or half an hour), or more than its
    part of the memory, is stopped: *did not finish*. The others go on.

    `--accept` writes the E and U that this run has reached into `accepted.toml` beside each case's run.toml, to be
    reviewed and kept like code. Later runs say where E or U has grown to more than 10 times that, *worse than
    recorded*: a warning, and with `--strict` an error, as is a comparison of the library's own engines without
    accepted figures. Nothing is accepted while anything is not as expected.

    **Exit code**: 0 every verdict is the one the case expects and everything asked for gave its result;
    1 something is not as expected, failed or did not run, or `--accept` wrote nothing; 2 the request itself makes no
    sense. With `--strict` also 1 where figures are worse than recorded or missing. `docs/verdicts.md` has the rules.

    **Examples**: `crosscheck run canonical` · `crosscheck run free_flying/flexible_beam -e native` ·
    `crosscheck run all -e mycode --out results` · `crosscheck run ./my_case --accept` ·
    `crosscheck run all --strict --time-limit 600`
    """
    _check_limit(time_limit)
    chosen = _found(tuple(cases))
    idle = without_part((case.run for case in chosen), tuple(engine or ()))
    if idle:
        _refuse(idle)
    with _sole_writer(out):
        with LiveProgress(console) as live:
            limits = Limits(jobs, time_limit)
            sweep(
                chosen, tuple(engine or ()), out / "records.jsonl", fresh=fresh, limits=limits, listener=live.hear
            )
        done = not accept or _accept(chosen, out / "records.jsonl", partial=bool(engine))
        _conclude(out / "records.jsonl", out, open_report, strict, last_session, failed=not done)


@app.command("list")
def list_cases() -> None:
    """List the shipped cases with their tags, variants and engines."""
    console.print(cases_table(_found(("all",))))


@app.command()
def engines() -> None:
    """List the engines: which are installed, in which version, and how to install the others."""
    console.print(engines_table(describe_engines()))


@app.command()
def report(
    records: Annotated[Path, typer.Argument(help="A records.jsonl of an earlier run, yours or anybody's.")],
    out: Out = Path("out"),
    strict: Strict = False,
    open_report: Open = False,
) -> None:
    """
    Judge and draw recorded runs again; no engine needs to be installed.

    **Exit code** as of `run`.
    """
    if not records.is_file():
        _refuse(f"{records} is no file")
    with _sole_writer(out):
        _conclude(records, out, open_report, strict, standing)


@app.command()
def verify(
    case: Annotated[str, typer.Argument(help="Case name or folder.")],
    csv: Annotated[Path, typer.Argument(help="Your code's results (see below).")],
    coarse: Annotated[
        Path | None,
        typer.Option(help="The same results at half the accuracy: your U is 3 x the difference, not the case's goal."),
    ] = None,
    variant: Annotated[str | None, typer.Option(help="Variant to be held against; by default the first.")] = None,
    engine: Annotated[str, typer.Option(help="Engine that gives the reference.")] = "native",
    template: Annotated[bool, typer.Option("--template", help="Write CSV as a template with the times.")] = False,
) -> None:
    """
    Hold a CSV of your own code against a case, without an adapter.

    **Format**: one header line, one line a sample time of the case. Columns: `t` (s); for a marker `tip`
    `tip.px tip.py tip.pz` (m), `tip.qw tip.qx tip.qy tip.qz`, `tip.vx tip.vy tip.vz` (m/s), `tip.wx tip.wy tip.wz`
    (rad/s); for a hinge `elbow` `elbow.tx elbow.ty elbow.tz` (Nm) and `elbow.fx elbow.fy elbow.fz` (N), the load on the
    outboard body about the hinge point. World axes; quaternions scalar-first, body to World. Only whole groups count,
    any subset of groups will do; `--template` writes a file with the times and all columns to fill in. flexmb's own
    `trajectory.csv` will do as it is: it is compared in whatever the case sets a goal for.

    **Shows** each channel's distance E, uncertainty U, the time at which it is worst, and what is wrong where that can
    be guessed: thousandths, degrees, a sign, exchanged components, quaternions conjugate or scalar-last, body axes,
    another origin, shifted times.

    **Exit code**: 0 every channel in the file agrees; 1 some do not; 2 the file cannot be compared.
    """
    with _in_one_line():
        found = _found((case,))
        if len(found) > 1:
            _refuse(f'"{case}" is {len(found)} cases: name one of {", ".join(each.name for each in found)}')
        (chosen,) = found
        if template:
            if csv.exists():
                _refuse(f"{csv} is there already: a template would take its place; name another file")
            csv.write_text(sample_times_csv(chosen, variant), encoding="utf-8")
            console.print(words(f"Fill in {csv}, then run the command again without --template."), soft_wrap=True)
            return
        outcome = verify_csv(chosen, csv, coarse=coarse, variant=variant, engine=engine)
    console.print(channels_table(outcome))
    if outcome.left_out:
        console.print(words(f"Not compared: {', '.join(outcome.left_out)}"), soft_wrap=True)
    raise typer.Exit(print_outcome(console, outcome))


@app.command()
def stability(
    maps: Annotated[list[str], typer.Argument(help="Names of maps, `all`, or `list` to see which there are.")],
    out: Out = Path("out"),
    depth: Annotated[
        int | None, typer.Option(help="How often cells at a boundary are halved; by default what the map says.", min=0)
    ] = None,
    pictures: Annotated[Path | None, typer.Option(help="Folder for the pictures and maps.json; default --out.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget the records in --out instead of resuming.")] = False,
    jobs: Jobs = None,
    time_limit: Annotated[
        float | None,
        typer.Option("--time-limit", metavar="SECONDS", help=f"Stop a longer cell; default {TIME_LIMIT_S:g}."),
    ] = None,
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
    from crosscheck.terminal.map_runs import run_and_draw  # they load the compiler

    _check_limit(time_limit)
    known = maps_of(PROVIDER)
    if maps == ["list"]:
        console.print(maps_table(known.values()))
        return
    chosen = list(known) if maps == ["all"] else maps
    for name in chosen:
        if name not in known:
            _refuse(f'no map "{name}": {closest(name, known)}; `crosscheck stability list` shows them')
    with _sole_writer(out):
        limits = Limits(jobs, time_limit)
        code = run_and_draw(console, chosen, out, pictures or out, depth=depth, fresh=fresh, limits=limits)
    raise typer.Exit(code)


def _found(words: tuple[str, ...]) -> tuple[find.Case, ...]:
    """The cases asked for, or the end of the program with exit code 2."""
    try:
        return find.resolve(words)
    except CaseError as error:
        _refuse(str(error))


@contextmanager
def _sole_writer(out: Path) -> Iterator[None]:
    """Lock the folder while something is written there; an error that the user can put right is shown in one line."""
    with _in_one_line(), locked(out):
        yield


def _check_limit(seconds: float | None) -> None:
    if seconds is not None and not 0.0 < seconds < inf:
        _refuse(f"--time-limit {seconds:g}: give a positive number of seconds")


def _accept(cases: tuple[find.Case, ...], records: Path, partial: bool) -> bool:
    """Write the figures that the cases have reached beside their run files, or say why not; whether it was done."""
    try:
        for file, count in accept_figures(cases, records, partial):
            console.print(words(f"{count} figures accepted: review {file}"), soft_wrap=True)
    except NotAccepted as error:
        console.print(words(str(error), "red"), soft_wrap=True)
        return False
    return True


def _conclude(
    records: Path, out: Path, open_report: bool, strict: bool, chosen: Choice, failed: bool = False
) -> None:
    """Judge, write everything, show the table, and leave with the exit code; 1 where something has `failed` before."""
    outcome, page = write_all(records, out, strict, chosen)
    code = print_outcome(console, outcome)
    console.print(words("Report: ") + words(str(page), "bold"), soft_wrap=True)
    if open_report:
        webbrowser.open(page.resolve().as_uri())
    raise typer.Exit(code or int(failed))


@contextmanager
def _in_one_line() -> Iterator[None]:
    """Show each warning, and the error that ends the command, in one line without a traceback."""
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_: console.print(words(f"warning: {message}", "yellow"), soft_wrap=True)
        try:
            yield
        except BrokenPipeError:  # the reader of the output has closed it
            raise
        except OSError as error:
            _refuse(in_words(error))
        except (ValueError, FolderInUseError) as error:
            _refuse(str(error))


def _refuse(message: str) -> NoReturn:
    console.print(words(message, "red"), soft_wrap=True)
    raise typer.Exit(EXIT_USAGE)


def main() -> None:
    """Entry point of the console script."""
    app()
