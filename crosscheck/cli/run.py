"""`crosscheck run` and `crosscheck report`: cases are run, judged and drawn, or records judged and drawn again."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from crosscheck.cli.common import (
    Jobs,
    Open,
    Out,
    SingleFile,
    Strict,
    TimeLimit,
    app,
    check_limit,
    console,
    found,
    refuse,
    sole_writer,
)
from crosscheck.judging.accept import NotAccepted, accept_figures
from crosscheck.library import find
from crosscheck.library.selection import without_part
from crosscheck.records.session import last_session, standing
from crosscheck.report import Choice, write_all
from crosscheck.running.pool import Limits
from crosscheck.running.sweep import sweep
from crosscheck.terminal.live import LiveProgress
from crosscheck.terminal.text import words
from crosscheck.terminal.verdicts import print_outcome


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
    single_file: SingleFile = False,
    open_report: Open = False,
) -> None:
    """
    Run cases in all engines, judge them, write the report.

    **Writes** into `--out`: `report/` (open its `index.html`, to which `report.html` leads), `verdicts.json`,
    `summary.md`, `junit.xml`, `records.jsonl`. With `--single-file`, `report.html` is the whole report.
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
    check_limit(time_limit)
    chosen = found(tuple(cases))
    idle = without_part((case.run for case in chosen), tuple(engine or ()))
    if idle:
        refuse(idle)
    with sole_writer(out):
        with LiveProgress(console) as live:
            limits = Limits(jobs, time_limit)
            sweep(chosen, tuple(engine or ()), out / "records.jsonl", fresh=fresh, limits=limits, listener=live.hear)
        done = not accept or _accept(chosen, out / "records.jsonl", partial=bool(engine))
        _conclude(out / "records.jsonl", out, open_report, strict, last_session, single_file, failed=not done)


@app.command()
def report(
    records: Annotated[Path, typer.Argument(help="A records.jsonl of an earlier run, yours or anybody's.")],
    out: Out = Path("out"),
    strict: Strict = False,
    single_file: SingleFile = False,
    open_report: Open = False,
) -> None:
    """
    Judge and draw recorded runs again; no engine needs to be installed.

    **Exit code** as of `run`.
    """
    if not records.is_file():
        refuse(f"{records} is no file")
    with sole_writer(out):
        _conclude(records, out, open_report, strict, standing, single_file)


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
    records: Path,
    out: Path,
    open_report: bool,
    strict: bool,
    chosen: Choice,
    single_file: bool,
    failed: bool = False,
) -> None:
    """Judge, write everything, show the table, and leave with the exit code; 1 where something has `failed` before."""
    outcome, page = write_all(records, out, strict, chosen, single_file)
    code = print_outcome(console, outcome)
    console.print(words("Report: ") + words(str(page), "bold"), soft_wrap=True)
    if open_report:
        webbrowser.open(page.resolve().as_uri())
    raise typer.Exit(code or int(failed))
