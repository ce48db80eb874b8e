"""`crosscheck sweep`: Monte Carlo, Latin hypercubes and grids over the parameters of a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from crosscheck.cli import common
from crosscheck.running.scheduler import Limits
from crosscheck.running.schedulers import LOCAL, scheduler_at
from crosscheck.terminal.text import words
from flexmb.output.files import write_whole


@common.app.command("sweep")
def sweep_parameters(
    file: Annotated[Path, typer.Argument(help="The sweep, a TOML file.")],
    out: common.Out = Path("out"),
    fresh: common.Fresh = False,
    jobs: common.Jobs = None,
    time_limit: common.TimeLimit = None,
    scheduler: common.SchedulerAddress = LOCAL,
    no_user_code: common.NoUserCode = False,
) -> None:
    """
    Run a scene many times with other parameters: Monte Carlo, a Latin hypercube or a grid.

    `docs/sweeps.md` shows a file and explains it. **Writes** into `--out`: `samples.csv`, a line for each sample, until
    the end as `samples.unfinished.csv`; `summary.json`, statistics with their standard errors; `samples.jsonl`, from
    which a run that was stopped resumes. The samples depend on the seed alone, not on the number of workers.

    **Exit code**: 0 every sample gave its quantities; 1 some did not; 2 the file makes no sense.

    **Examples**: `crosscheck sweep tolerances.toml` · `crosscheck sweep grid.toml --scheduler tcp://10.0.0.1:8786`
    """
    import msgspec

    from crosscheck.sampling.outputs import summarise
    from crosscheck.sampling.run import SUMMARY, run_sweep
    from crosscheck.terminal.many_runs import print_summary, sampling_bar

    common.check_limit(time_limit)
    with common.sole_writer(out):
        runs_on = scheduler_at(scheduler)
        with sampling_bar(common.console) as listener:
            done = run_sweep(
                file, out, fresh=fresh, limits=Limits(jobs, time_limit), scheduler=runs_on, listener=listener
            )
        summary = summarise(done)
        target = out / SUMMARY
        write_whole(target, msgspec.json.format(msgspec.json.encode(summary)) + b"\n")
        print_summary(common.console, summary)
        common.console.print(words("Samples: ") + words(str(out / "samples.csv"), "bold"), soft_wrap=True)
    raise typer.Exit(0 if summary.ok else 1)
