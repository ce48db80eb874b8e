"""`crosscheck run` and `crosscheck report`: cases are run, judged and drawn, or records judged and drawn again."""

from __future__ import annotations

import webbrowser
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from crosscheck.cli.common import (
    CaseWords,
    EngineNames,
    Jobs,
    Json,
    NoUserCode,
    Open,
    Out,
    Quiet,
    SchedulerAddress,
    SingleFile,
    Strict,
    TimeLimit,
    Verbose,
    app,
    check_limit,
    console,
    errors,
    found,
    refuse,
    sole_writer,
    verbosity,
)
from crosscheck.running.scheduler import Limits
from crosscheck.running.schedulers import LOCAL, scheduler_at
from crosscheck.terminal.text import words
from crosscheck.terminal.verbosity import Verbosity

if TYPE_CHECKING:
    from crosscheck.judging.outcome import SessionOutcome
    from crosscheck.library.find import Case


@app.command()
def run(
    cases: CaseWords,
    engine: EngineNames = None,
    alone: Annotated[
        bool, typer.Option("--alone", help="Hold the engines against the stored references only; no partners run.")
    ] = False,
    out: Out = Path("out"),
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget the records in --out instead of resuming.")] = False,
    jobs: Jobs = None,
    time_limit: TimeLimit = None,
    scheduler: SchedulerAddress = LOCAL,
    accept: Annotated[
        bool, typer.Option("--accept", help="Write the figures reached into each case's accepted.toml, for review.")
    ] = False,
    strict: Strict = False,
    single_file: SingleFile = False,
    open_report: Open = False,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    no_user_code: NoUserCode = False,
) -> None:
    """
    Run cases in all engines, judge them, write the report.

    **Writes** into `--out`: `report/` (open its `index.html`, to which `report.html` leads), `results.json` (small and
    sealed, for `crosscheck compare`), `verdicts.json`, `summary.md`, `junit.xml`, `badge.svg`, `badge.json`,
    `records.jsonl`. With `--single-file`, `report.html` is the whole report.
    A run that was stopped resumes where it was: what is recorded is not run again, as long as the scene, the effort
    and everything that made it are the same: sources, libraries, machine. The report shows what this run asked for;
    `crosscheck report` shows everything that the records hold. One run at a time writes into a folder.

    An engine that takes longer for a scene than `--time-limit` says (or the case, or half an hour), or more than its
    part of the memory, is stopped: *did not finish*. The others go on.

    `--accept` writes the E and U that this run has reached into `accepted.toml` beside each case's run.toml, to be
    reviewed and kept like code. Later runs say where E or U has grown to more than 10 times that, *worse than
    recorded*: a warning, and with `--strict` an error, as is a comparison of the library's own engines without
    accepted figures. Figures accepted with other efforts, scenes, rules or versions of engines are told as *stale*:
    accept them anew. Nothing is accepted while anything is not as expected.

    Until the session has come to its end, all that it writes says that it is unfinished.

    **Exit code**: 0 every verdict is the one the case expects and everything asked for gave its result;
    1 something is not as expected, failed or did not run, an engine asked for was compared in nothing, or `--accept`
    wrote nothing; 2 the request itself makes no sense. With `--strict` also 1 where figures are worse than recorded or
    missing, a reference was never made, or a scene is doubtful. `docs/verdicts.md` has the rules.

    **Examples**: `crosscheck run canonical` · `crosscheck run free_flying/flexible_beam -e native` ·
    `crosscheck run all -e mycode --alone --out results` · `crosscheck run ./my_case --accept` ·
    `crosscheck run all --strict --time-limit 600`
    """
    from crosscheck.library.selection import without_part
    from crosscheck.records.session import last_session
    from crosscheck.report import mark_unfinished, write_all
    from crosscheck.running.sweep import sweep
    from crosscheck.sealed.seal import FILE
    from crosscheck.terminal.live import LiveProgress

    check_limit(time_limit)
    shown = verbosity(quiet, verbose)
    chosen = found(tuple(cases))
    if alone:
        chosen = _alone(chosen)
    idle = without_part((case.run for case in chosen), tuple(engine or ()))
    if idle:
        refuse(idle)
    with sole_writer(out, strict):
        runs_on = scheduler_at(scheduler)
        mark_unfinished(out / "records.jsonl", out)
        with LiveProgress(console, shown) as live:
            sweep(
                chosen, tuple(engine or ()), out / "records.jsonl", fresh=fresh, limits=Limits(jobs, time_limit),
                scheduler=runs_on, listener=live.hear,
            )  # fmt: skip
        done = not accept or _accept(chosen, out / "records.jsonl", partial=bool(engine))
        outcome, page = write_all(out / "records.jsonl", out, strict, last_session, single_file)
    _conclude(outcome, page, shown, results=out / FILE if as_json else None, open_report=open_report, failed=not done)


@app.command()
def report(
    records: Annotated[Path, typer.Argument(help="A records.jsonl of an earlier run, yours or anybody's.")],
    out: Out = Path("out"),
    strict: Strict = False,
    single_file: SingleFile = False,
    open_report: Open = False,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """
    Judge and draw recorded runs again; no engine needs to be installed.

    **Exit code** as of `run`.
    """
    from crosscheck.records.session import standing
    from crosscheck.report import write_all
    from crosscheck.sealed.seal import FILE

    if not records.is_file():
        refuse(f"{records} is no file")
    shown = verbosity(quiet, verbose)
    with sole_writer(out):
        outcome, page = write_all(records, out, strict, standing, single_file)
    _conclude(outcome, page, shown, results=out / FILE if as_json else None, open_report=open_report)


def _alone(cases: tuple[Case, ...]) -> tuple[Case, ...]:
    """The cases, to be run without partners; those without a stored reference are named and left out."""
    from crosscheck.library.reference import has_reference

    without = [case.name for case in cases if case.run.reference is None or not has_reference(case.folder)]
    if len(without) == len(cases):
        refuse(f"no stored reference: {', '.join(without)}. `crosscheck regenerate` makes them; or leave --alone out")
    if without:
        console.print(words(f"Left out, as there is no stored reference: {', '.join(without)}", "yellow"))
    return tuple(replace(case, alone=True) for case in cases if case.name not in without)


def _accept(cases: tuple[Case, ...], records: Path, partial: bool) -> bool:
    """Write the figures that the cases have reached beside their run files, or say why not; whether it was done."""
    from crosscheck.judging.accept import NotAccepted, accept_figures

    try:
        for file, count in accept_figures(cases, records, partial):
            console.print(words(f"{count} figures accepted: review {file}"), soft_wrap=True)
    except NotAccepted as error:
        errors.print(words(str(error), "red"), soft_wrap=True)
        return False
    return True


def _conclude(
    outcome: SessionOutcome, page: Path, shown: Verbosity, *, results: Path | None, open_report: bool,
    failed: bool = False,
) -> None:  # fmt: skip
    """Show what came out, print the file of `results` if one is given, leave with the exit code: 1 if it `failed`."""
    from crosscheck.terminal.verdicts import print_outcome

    code = print_outcome(console, outcome, shown)
    if shown is not Verbosity.QUIET:
        console.print(words("Report: ") + words(str(page), "bold"), soft_wrap=True)
    if results is not None:
        typer.echo(results.read_text(encoding="ascii"), nl=False)
    if open_report:
        webbrowser.open(page.resolve().as_uri())
    raise typer.Exit(code or int(failed))
