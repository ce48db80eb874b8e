"""`crosscheck contract`: whether an engine keeps what it promises."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from crosscheck.cli import common
from crosscheck.cli.common import app, console, print_json, verbosity
from crosscheck.conformance.limit import CLAUSE_LIMIT_S


@app.command()
def contract(
    names: common.EngineWords,
    time_limit: Annotated[
        float, typer.Option("--time-limit", metavar="SECONDS", min=0.1, help="Of each clause, compiling included.")
    ] = CLAUSE_LIMIT_S,
    as_json: common.Json = False,
    quiet: common.Quiet = False,
    verbose: common.Verbose = False,
) -> None:
    """
    Try whether engines keep the contract: names, statuses, shapes, frames, signs, reference points, repeatability.

    Every clause is a sentence of the contract, tried in a process of its own on a small scene whose answer is known. A
    scene that the engine refuses, or an output that it leaves out, counts as *not offered*; a line says what to offer
    for it, and which clauses would then be tried.

    **Exit code**: 0 every clause that is offered holds, among them all on the form of an answer and a run that is known
    in closed form; 1 a clause is broken, or too little was shown; 2 there is no such engine, or its library is not
    installed.

    **Examples**: `crosscheck contract native` · `crosscheck contract mycode --verbose`
    """
    from crosscheck.conformance.trial import try_engine, verdict_on
    from crosscheck.terminal.clauses import print_clauses

    shown = verbosity(quiet, verbose)
    common.require_engines(names, broken=True)
    kept, tried = [], {}
    for name in names:
        with console.status(f"trying {name}"):
            outcomes = list(try_engine(name, limit_s=time_limit))
        verdict = verdict_on(outcomes)
        kept.append(verdict.kept)
        tried[name] = {
            "kept": verdict.kept, "whole": verdict.whole, "headline": verdict.text,
            "clauses": [asdict(outcome) for outcome in outcomes],
        }  # fmt: skip
        print_clauses(console, name, outcomes, shown)
    if as_json:
        print_json(tried)
    raise typer.Exit(0 if all(kept) else 1)
