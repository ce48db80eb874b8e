"""`crosscheck contract`: whether an engine keeps what it promises."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from crosscheck.cli.common import EngineWords, Json, Quiet, Verbose, app, console, print_json, refuse, verbosity
from crosscheck.conformance.limit import CLAUSE_LIMIT_S
from flexmb.scene.problems import closest


@app.command()
def contract(
    names: EngineWords,
    time_limit: Annotated[
        float, typer.Option("--time-limit", metavar="SECONDS", min=0.1, help="Of each clause, compiling included.")
    ] = CLAUSE_LIMIT_S,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """
    Try whether engines keep the contract: names, statuses, shapes, frames, signs, reference points, repeatability.

    Every clause is a sentence of the contract, tried in a process of its own on a small scene whose answer is known. A
    scene that the engine refuses, or an output that it leaves out, counts as *not offered*; a line says what to offer
    for it, and which clauses would then be tried.

    **Exit code**: 0 every clause that is offered holds, among them all on the form of an answer and a run that is known
    in closed form; 1 a clause is broken, too little was shown, or the engine's library is missing; 2 there is no such
    engine.

    **Examples**: `crosscheck contract native` · `crosscheck contract mycode --verbose`
    """
    from crosscheck.conformance.trial import try_engine, verdict_on
    from crosscheck.engines.registry import engines
    from crosscheck.terminal.clauses import print_clauses

    shown = verbosity(quiet, verbose)
    known = engines()
    for name in names:
        if name not in known:
            refuse(f'no engine "{name}": {closest(name, known)}; `crosscheck engines` shows them')
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
