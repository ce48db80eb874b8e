"""`crosscheck regenerate`: stored references are made again by their routes."""

from __future__ import annotations

from typing import Annotated

import typer

from crosscheck.cli import common
from crosscheck.library.case_error import CaseError
from crosscheck.running.scheduler import Limits
from crosscheck.running.schedulers import LOCAL, scheduler_at
from crosscheck.terminal.text import marked, words


@common.app.command()
def regenerate(
    cases: common.CaseWords,
    check: Annotated[bool, typer.Option("--check", help="Compare with what is stored, write nothing.")] = False,
    jobs: common.Jobs = None,
    time_limit: common.TimeLimit = None,
    scheduler: common.SchedulerAddress = LOCAL,
    no_user_code: common.NoUserCode = False,
) -> None:
    """
    Make the stored reference of cases again, by the routes of their table `[reference]`.

    **Writes** `reference.csv` and `reference.toml` into each case's folder: times and channels with 17 digits, and of
    each channel the uncertainty, with the routes that say so. Nothing is written where the stored files are reproduced
    within what they state.

    It is **refused** where a channel does not come by two independent routes that agree within their uncertainties,
    where a published number of `provenance.toml` is not met, and where the numbers change by more than was stated
    while `provenance.toml` is as it was: a reference is not moved to make a run green. `docs/references.md` has the
    rules.

    **Exit code**: 0 every reference is confirmed or written; 1 one was refused, or with `--check` would be written;
    2 the request makes no sense.

    **Examples**: `crosscheck regenerate wheel_gyrostat/torque_free` · `crosscheck regenerate all --check` ·
    `crosscheck regenerate ./my_case`
    """
    chosen = common.asked(cases, time_limit=time_limit)
    from crosscheck.references.regenerate import regenerate as make_again
    from crosscheck.terminal.progress import LiveProgress

    good = True
    with common.in_one_line():
        runs_on = scheduler_at(scheduler)
        for case in chosen:
            try:
                with LiveProgress(common.console, first="evaluating the routes that files of the case give") as live:
                    limits = Limits(jobs, time_limit)
                    done = make_again(case, check=check, limits=limits, scheduler=runs_on, listener=live.hear)
            except CaseError as error:
                common.console.print(marked("✕", "red", str(error)), soft_wrap=True)
                good = False
                continue
            kept = done.done != "would be written"
            good = good and kept
            what = f"{done.case}: {done.done}, {done.channels} channels to {done.horizon_s:g} s"
            remark = f"; {done.remark}" if done.remark else ""
            sign, colour = ("✓", "green") if kept else ("!", "yellow")
            common.console.print(marked(sign, colour, what + remark), soft_wrap=True)
    text, colour = ("Every reference holds", "green") if good else ("Not every reference holds", "red")
    common.console.print(words(text, colour))
    raise typer.Exit(int(not good))
