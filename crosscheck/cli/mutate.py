"""`crosscheck mutate`: deliberate faults, and which of them the cases notice."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from crosscheck.cli import common
from crosscheck.running.scheduler import Limits
from crosscheck.terminal.text import Verbosity, words


@common.app.command()
def mutate(
    cases: common.CaseWords,
    engine: Annotated[str, typer.Option("--engine", "-e", help="The engine that runs the faulty scenes.")] = "native",
    all_targets: Annotated[
        bool, typer.Option("--all-targets", help="Every target, not one of each kind (every body, every hinge).")
    ] = False,
    out: common.Out = Path("out"),
    fresh: common.Fresh = False,
    jobs: common.Jobs = None,
    time_limit: common.TimeLimit = None,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Every channel and every fault.")] = False,
    no_user_code: common.NoUserCode = False,
) -> None:
    """
    Plant deliberate faults and say which share of them each case notices: its mutation score.

    Every mutation of the catalogue (a sign, a frame, a dropped term, a unit; see `docs/mutations.md`) is applied to the
    scene of the case's reference variant, else of the first variant that a comparison judges, wherever it changes
    something. One engine runs each faulty scene, and its channels are held against its own true run, by the case's
    goals and with its uncertainty. Faults of an adapter are planted in the true answer.

    **Shows** for each case the share that was noticed, *at goals* the share that differs by more than a goal, which a
    code that just meets the goals would show too, *reference* the share that the stored reference notices, without
    any true run, and every fault that was missed.

    **Writes** into `--out` `mutation.json`, and the records `mutants.jsonl`, from which a stopped campaign resumes.

    **Exit code**: 0 the mean score is at least 0.95; 1 it is not, or something was not judged; 2 the request makes no
    sense.

    **Examples**: `crosscheck mutate torque_driven` · `crosscheck mutate all --jobs 2` ·
    `crosscheck mutate ./my_case --all-targets --verbose`
    """
    chosen = common.asked(cases, (engine,), time_limit=time_limit)
    from crosscheck.mutation.campaign import SCORES, run_campaign
    from crosscheck.terminal.mutation import print_mutation_scores
    from crosscheck.terminal.progress import LiveProgress

    with common.sole_writer(out):
        with LiveProgress(common.console, Verbosity.NORMAL) as live:
            limits = Limits(jobs, time_limit)
            scores = run_campaign(
                chosen, out, engine=engine, all_targets=all_targets, fresh=fresh, limits=limits, listener=live.hear
            )
        code = print_mutation_scores(common.console, scores, verbose)
    common.console.print(words(f"Scores: {out / SCORES}"), soft_wrap=True)
    raise typer.Exit(code)
