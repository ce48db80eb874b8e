"""`crosscheck contract`: whether an engine keeps what it promises."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated

import typer

from crosscheck.cli import common
from crosscheck.cli.common import app, console, print_json, verbosity
from crosscheck.conformance import CLAUSE_LIMIT_S
from flexmb.scene.problems import closest


@app.command()
def contract(
    names: common.EngineWords,
    time_limit: Annotated[
        float, typer.Option("--time-limit", metavar="SECONDS", min=0.1, help="Of each clause, compiling included.")
    ] = CLAUSE_LIMIT_S,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, max=common.MOST_JOBS, help="Clauses at a time.")] = 1,
    clause: Annotated[
        list[str] | None, typer.Option("--clause", metavar="PATTERN", help="Only clauses of such names (repeat it).")
    ] = None,
    out: common.Out = Path("out"),
    as_json: common.Json = False,
    quiet: common.Quiet = False,
    verbose: common.Verbose = False,
) -> None:
    """
    Try whether engines keep the contract: names, statuses, shapes, frames, signs, reference points, repeatability.

    Every clause is a sentence of the contract, tried on a small scene whose answer is known. Clauses on the form of an
    answer have a process each; those on mechanics share one, and what is broken there is tried again in one of its own.
    An engine that states `precision = "single"` is held to the bounds of 32-bit floats, and the last line says so. A
    scene that the engine refuses, or an output that it leaves out, counts as *not offered*; a line says what to offer
    for it, and which clauses would then be tried.

    **Writes** of an engine of another distribution, if all clauses were tried, `contract.json` into `--out`: sessions
    in that folder say whether its contract is kept, and by which sources.

    **Exit code**: 0 every clause that is offered holds, among them all on the form of an answer and a run that is known
    in closed form; 1 a clause is broken, or too little was shown; 2 there is no such engine, or its library is not
    installed.

    **Examples**: `crosscheck contract native` · `crosscheck contract mycode --verbose` ·
    `crosscheck contract mycode --clause '*tree*' --jobs 2`
    """
    shown = verbosity(quiet, verbose)
    common.require_engines(names, broken=True)  # before clauses are imported, and with them all that they call
    from crosscheck.conformance.trial import try_engine, verdict_on
    from crosscheck.records import contracts
    from crosscheck.terminal.clauses import clauses_bar, print_clauses

    chosen = _chosen(clause or ())
    kept, tried = [], {}
    for name in names:
        with clauses_bar(console, name, len(chosen), quiet) as hear:
            outcomes = list(try_engine(name, chosen, limit_s=time_limit, workers=jobs, listener=hear))
        verdict = verdict_on(outcomes, bool(clause))
        kept.append(verdict.kept)
        tried[name] = {
            "kept": verdict.kept, "whole": verdict.whole, "headline": verdict.text,
            "clauses": [asdict(outcome) for outcome in outcomes],
        }  # fmt: skip
        print_clauses(console, name, outcomes, shown, bool(clause))
        if not clause and contracts.is_outside(name):
            with common.in_one_line():
                contracts.keep(out, name, contracts.tried(name, verdict.kept, verdict.text))
    if as_json:
        print_json(tried)
    raise typer.Exit(0 if all(kept) else 1)


def _chosen(patterns: Sequence[str]) -> tuple[str, ...]:
    """The clauses whose names one of the patterns matches, all without patterns; one that matches none is refused."""
    from crosscheck.conformance.catalogue import CLAUSES

    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in CLAUSES):
            common.refuse(f'no clause "{pattern}": {closest(pattern, CLAUSES)}')
    return tuple(name for name in CLAUSES if not patterns or any(fnmatchcase(name, pattern) for pattern in patterns))
