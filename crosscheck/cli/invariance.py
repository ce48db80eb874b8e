"""`crosscheck invariance`: changes that mean nothing, and whether an engine's results stay the same."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from crosscheck.cli import common
from crosscheck.running.scheduler import Limits
from crosscheck.terminal.text import Verbosity, words


@common.app.command()
def invariance(
    cases: common.CaseWords,
    engine: Annotated[str, typer.Option("--engine", "-e", help="The engine that is put to the proof.")] = "native",
    out: common.Out = Path("out"),
    fresh: common.Fresh = False,
    jobs: common.Jobs = None,
    time_limit: common.TimeLimit = None,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Every verdict with its reason.")] = False,
    no_user_code: common.NoUserCode = False,
) -> None:
    """
    Change what means nothing and say whether the results stay the same.

    The World is turned; moved; seen from a frame in uniform motion, where everything flies freely; in a mirror; bodies
    and hinges are declared in the opposite order; length, mass and time have other units; functions of time are written
    on another clock, where that needs no start time. The engine runs the changed scene at all its efforts, its channels
    are told back, and each is held against the run of the case's own scene, within the uncertainties of the two.

    **Writes** into `--out` `invariance.json`, and the records `invariances.jsonl`.

    **Exit code**: 0 everything agrees; 1 something does not, or did not run; 2 the request makes no sense.

    **Examples**: `crosscheck invariance torque_driven` · `crosscheck invariance four_bar -e pinocchio`
    """
    chosen = common.asked(cases, (engine,), time_limit=time_limit)
    from crosscheck.mutation.invariance_runs import VERDICTS, run_invariances
    from crosscheck.terminal.mutation import print_invariances
    from crosscheck.terminal.progress import LiveProgress

    with common.sole_writer(out):
        with LiveProgress(common.console, Verbosity.NORMAL) as live:
            limits = Limits(jobs, time_limit)
            verdicts = run_invariances(chosen, out, engine=engine, fresh=fresh, limits=limits, listener=live.hear)
        code = print_invariances(common.console, verdicts, verbose)
    common.console.print(words(f"Verdicts: {out / VERDICTS}"), soft_wrap=True)
    raise typer.Exit(code)
