"""`crosscheck run` and `crosscheck report`: cases are run, judged and drawn, or records judged and drawn again."""

from __future__ import annotations

import math
import webbrowser
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from crosscheck.cli import common
from crosscheck.running.scheduler import Limits, Scheduler
from crosscheck.running.schedulers import LOCAL, scheduler_at
from crosscheck.terminal.text import Verbosity, words

if TYPE_CHECKING:
    from crosscheck.cli.baseline import AgainstBaseline
    from crosscheck.judging.outcome import SessionOutcome
    from crosscheck.library.find import Case

MOST_SAMPLES = 100_000


@common.app.command()
def run(
    cases: common.CaseWords,
    engine: common.EngineNames = None,
    t_end: Annotated[
        float | None, typer.Option("--t-end", metavar="S", help="Of a scene or a robot: how long to simulate it.")
    ] = None,
    samples: Annotated[int, typer.Option(help="Of a scene or a robot: output times from 0 to the end.")] = 201,
    alone: Annotated[
        bool, typer.Option("--alone", help="Hold the engines against the stored references only; no partners run.")
    ] = False,
    out: common.Out = Path("out"),
    fresh: common.Fresh = False,
    jobs: common.Jobs = None,
    time_limit: common.TimeLimit = None,
    scheduler: common.SchedulerAddress = LOCAL,
    goal: common.Goals = None,
    efforts: common.Efforts = None,
    expect: common.Expect = None,
    envelope: Annotated[
        bool,
        typer.Option(
            "--envelope", help="Follow runs of the library's own engines over all of their steps; write envelope.csv."
        ),
    ] = False,
    baseline: Annotated[
        Path | None,
        typer.Option(
            metavar="OLD", help="A results.json or its folder: only what became worse since fails. Written if missing."
        ),
    ] = None,
    accept: Annotated[
        bool, typer.Option("--accept", help="Write the figures reached into each case's accepted.toml, for review.")
    ] = False,
    strict: common.Strict = False,
    single_file: common.SingleFile = False,
    open_report: common.Open = False,
    as_json: common.Json = False,
    quiet: common.Quiet = False,
    verbose: common.Verbose = False,
    no_user_code: common.NoUserCode = False,
) -> None:
    """
    Run cases in all engines, judge them, write the report.

    **Writes** into `--out`: `report/` (open its `index.html`, to which `report.html` leads), `results.json` (small and
    sealed, for `crosscheck compare`), `verdicts.json`, `label.json` (the credibility of each case), `summary.md`,
    `junit.xml`, `badge.svg`, `badge.json`, `records.jsonl`; with `--envelope` also `envelope.csv`. With
    `--single-file`, `report.html` is the whole report. Until the session ends they say that it is unfinished. A stopped
    session resumes: what is recorded is not run again if scene, effort, sources, libraries and machine are the same.
    `crosscheck report` shows everything that the records hold. One session at a time writes into a folder. An engine
    that exceeds its time or its part of the memory is stopped: *did not finish*. The others go on.

    `--accept` writes the E and U that this run has reached into `accepted.toml` beside each case's run.toml, to be
    reviewed and kept like code. Later runs say where E or U has grown to more than 10 times that, *worse than
    recorded*: a warning, and with `--strict` an error, as is a comparison of the library's own engines without
    accepted figures. Figures accepted with other efforts, scenes, rules or versions of engines are *stale*: accept them
    again. Nothing is accepted while anything is not as expected.

    **Peaks**: the pages of cases list the largest loads. They are those of the samples, and peaks lie between these;
    with `--envelope` each run of the library's own engines is followed once more over all of its steps and both sides
    of events. `envelope.csv` has the least and greatest values of all channels of all engines, with their times, and
    says over what.

    **A scene or a robot** (`.toml`, `.urdf`, `.xml`, `.sid`) with `--t-end` needs no case: a folder `cases/NAME` in
    `--out` gets its scene, with a marker at the frame of every body, and a run.toml with usual goals. Native and all
    other codes that are installed run it; what one of them cannot represent is *not applicable*. Impossible inertia of
    a robot is repaired, and one that would rest begins with rates; notes say so.

    **Your own engine**: `--goal` replaces goals that it is not meant to meet, `--efforts` adds efforts where U is too
    large, and a file, `--expect`, keeps both, with failures that you expect and their reasons; `docs/expectations.md`
    has its keys. `--baseline OLD` lets only what became worse fail the session; without OLD it is written, and the
    session passes.

    **Exit code**: 0 every verdict is as the case expects, and everything asked for gave its result; 1 something is not
    as expected, failed or did not run, an engine asked for was compared in nothing, or `--accept` wrote nothing; 2 the
    request makes no sense. With `--strict` also 1 where figures are worse than recorded or missing, a reference was
    never made, a channel is offered that the case neither judges nor leaves open, or a scene is doubtful.
    `docs/verdicts.md` has the rules.

    **Examples**: `crosscheck run canonical` · `crosscheck run free_flying/flexible_beam -e native` ·
    `crosscheck run all -e mycode --alone --out results` · `crosscheck run ./my_case --accept` ·
    `crosscheck run all --strict --time-limit 600` · `crosscheck run 'pendulums/*' -e mycode --baseline main.json` ·
    `crosscheck run my.urdf --t-end 5`
    """
    common.check_limit(time_limit)
    shown = common.verbosity(quiet, verbose)
    cases, engine = _of_models(cases, engine, t_end, samples, out)
    chosen, asked, records = _chosen(cases, engine, alone), tuple(engine or ()), out / "records.jsonl"
    from crosscheck.cli.baseline import hold_against, read_baseline
    from crosscheck.records.session import last_session
    from crosscheck.report import write_all

    chosen = common.claimed(tuple(replace(case, envelopes=envelope) for case in chosen), expect, goal, efforts, asked)
    before = None if baseline is None else read_baseline(baseline, out)
    with common.sole_writer(out, strict):
        _run(chosen, asked, records, shown, fresh, Limits(jobs, time_limit), scheduler_at(scheduler))
        done = not accept or _accept(chosen, records, partial=bool(asked))
        outcome, page = write_all(records, out, strict, last_session, single_file)
        held = None if before is None else hold_against(before, outcome, out)
    json_of = out if as_json else None
    _conclude(outcome, page, records, shown, json_of, open_report, failed=not done, held=held)


@common.app.command()
def report(
    records: Annotated[Path, typer.Argument(help="A records.jsonl of an earlier run, yours or anybody's.")],
    out: common.Out = Path("out"),
    strict: common.Strict = False,
    single_file: common.SingleFile = False,
    open_report: common.Open = False,
    as_json: common.Json = False,
    quiet: common.Quiet = False,
    verbose: common.Verbose = False,
) -> None:
    """
    Judge and draw recorded runs again; no engine needs to be installed.

    **Exit code** as of `run`.
    """
    if not records.is_file():
        common.refuse(f"{records} is no file")
    shown = common.verbosity(quiet, verbose)
    from crosscheck.records.session import standing
    from crosscheck.report import write_all

    with common.sole_writer(out):
        outcome, page = write_all(records, out, strict, standing, single_file)
    _conclude(outcome, page, records, shown, out if as_json else None, open_report)


def _of_models(
    words: list[str], engines: list[str] | None, t_end: float | None, samples: int, out: Path
) -> tuple[list[str], list[str] | None]:
    """The words with a case folder in place of each scene or robot, and the engines, all installed codes for these."""
    from crosscheck.library.case_error import CaseError
    from crosscheck.library.model_case import is_model, scene_of, write_case

    models = [word for word in words if is_model(word)]
    if not models:
        if t_end is not None:
            common.refuse("--t-end is of a scene or a robot (.toml, .urdf, .xml, .sid): a case has its own duration")
        return words, engines
    if len(models) < len(words):
        common.refuse("cases and models are run one after the other: all engines run models, and cases name theirs")
    if t_end is None or not 0.0 < t_end < math.inf or not 2 <= samples <= MOST_SAMPLES:
        common.refuse(f"a scene or a robot needs --t-end in s, above zero, and 2 to {MOST_SAMPLES} --samples")
    folders = {out / "cases" / Path(word).stem: word for word in models}
    if len(folders) < len(models):
        common.refuse("two models have the same name: rename one, or run each alone")
    try:
        read = {folder: scene_of(Path(word)) for folder, word in folders.items()}
    except CaseError as error:
        common.refuse(str(error))
    from crosscheck.running.installed import OWN_CODE, codes_for, partner_of  # after what may be wrong

    codes = codes_for([scene for scene, _ in read.values()])
    partners = {folder: partner_of(scene, codes) for folder, (scene, _) in read.items()}
    for folder, (scene, notes) in read.items():
        write_case(scene, folder, (OWN_CODE[0], partners[folder]), t_end, samples)
        for note in notes:
            common.errors.print(f"note: {folders[folder]}: {note}", soft_wrap=True, markup=False)
    return [str(folder) for folder in folders], engines or list(dict.fromkeys([*codes, *partners.values()]))


def _chosen(cases: list[str], engines: list[str] | None, alone: bool) -> tuple[Case, ...]:
    """The cases asked for; refuses engines that are not there, or have no part in any of them."""
    chosen = common.asked(cases, engines or ())
    from crosscheck.library.selection import without_part

    chosen = _alone(chosen) if alone else chosen
    if idle := without_part((case.run for case in chosen), tuple(engines or ())):
        common.refuse(idle)
    return chosen


def _run(
    cases: tuple[Case, ...], engines: tuple[str, ...], records: Path, shown: Verbosity, fresh: bool, limits: Limits,
    scheduler: Scheduler,
) -> None:  # fmt: skip
    """Run the cases; until they are judged the outputs say that the session is unfinished."""
    from crosscheck.report import mark_unfinished
    from crosscheck.running.sweep import sweep
    from crosscheck.terminal.progress import LiveProgress
    from crosscheck.timing.charted import chart_jobs

    mark_unfinished(records, records.parent)
    with LiveProgress(common.console, shown) as live:
        sweep(
            cases, engines, records,
            fresh=fresh, limits=limits, scheduler=scheduler, listener=live.hear, follow=chart_jobs,
        )  # fmt: skip


def _alone(cases: tuple[Case, ...]) -> tuple[Case, ...]:
    """The cases, to be run without partners; those without a stored reference are named and left out."""
    from crosscheck.library.reference import has_reference

    without = [case.name for case in cases if case.run.reference is None or not has_reference(case.folder)]
    if len(without) == len(cases):
        remedy = "`crosscheck regenerate` makes them; or leave --alone out"
        common.refuse(f"no stored reference: {', '.join(without)}. {remedy}")
    if without:
        common.console.print(words(f"Left out, as there is no stored reference: {', '.join(without)}", "yellow"))
    return tuple(replace(case, alone=True) for case in cases if case.name not in without)


def _accept(cases: tuple[Case, ...], records: Path, partial: bool) -> bool:
    """Write the figures that the cases have reached beside their run files, or say why not; whether it was done."""
    from crosscheck.judging.accept import NotAccepted, accept_figures

    try:
        for file, count in accept_figures(cases, records, partial):
            common.console.print(words(f"{count} figures accepted: review {file}"), soft_wrap=True)
    except NotAccepted as error:
        common.errors.print(words(str(error), "red"), soft_wrap=True)
        return False
    return True


def _kept(records: Path) -> str:
    """How much the records take, what they are for, and that they may go."""
    size = records.stat().st_size / 1e6
    return f"Records: {records}, {size:.3g} MB; runs in it are not repeated; to drop them all, delete the file"


def _conclude(
    outcome: SessionOutcome, page: Path, records: Path, shown: Verbosity, json_of: Path | None, open_report: bool,
    failed: bool = False, held: AgainstBaseline | None = None,
) -> None:  # fmt: skip
    """Show the outcome, with the results of the folder `json_of` as JSON, and exit; with code 1 if it `failed`.

    Where the session was `held` against a baseline, that decides.
    """
    from crosscheck.sealed.seal import FILE
    from crosscheck.terminal.verdicts import print_outcome

    of_session = print_outcome(common.console, outcome, shown)
    if shown is not Verbosity.QUIET:
        common.console.print(words("Report: ") + words(str(page), "bold"), soft_wrap=True)
        common.console.print(words(_kept(records), "dim"), soft_wrap=True)
    if held is not None:
        from crosscheck.cli.baseline import print_held

        print_held(held, shown)
    if json_of is not None:
        typer.echo((json_of / FILE).read_text(encoding="ascii"), nl=False)
    if open_report:
        webbrowser.open(page.resolve().as_uri())
    raise typer.Exit((of_session if held is None else held.code) or int(failed))
