"""`crosscheck verify`: a CSV of any code against a case."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from crosscheck.cli.common import (
    CaseWord,
    Json,
    NoUserCode,
    SchedulerAddress,
    app,
    console,
    found,
    in_one_line,
    refuse,
    require_engines,
    require_variants,
)
from crosscheck.running.schedulers import LOCAL, scheduler_at
from crosscheck.terminal.text import words
from flexmb.output.files import write_whole

if TYPE_CHECKING:
    from crosscheck.library.find import Case
    from crosscheck.verify.outcome import CsvOutcome


@app.command()
def verify(
    case: CaseWord,
    csv: Annotated[Path, typer.Argument(help="Your code's results (see below).")],
    coarse: Annotated[
        Path | None,
        typer.Option(help="The same results at half the accuracy: your U is 3 x the difference, not the case's goal."),
    ] = None,
    variant: Annotated[
        str | None, typer.Option(help="Variant to be held against; by default that of the stored reference.")
    ] = None,
    engine: Annotated[
        str | None, typer.Option(help="Run this engine and hold against it, instead of the stored reference.")
    ] = None,
    template: Annotated[bool, typer.Option("--template", help="Write CSV as a template with the times.")] = False,
    scheduler: SchedulerAddress = LOCAL,
    as_json: Json = False,
    no_user_code: NoUserCode = False,
) -> None:
    """
    Hold a CSV of your own code against a case, without an adapter, and where it has a stored reference without any run.

    **Format**: one header line, one line a time. Columns: `t` (s); for a marker `tip` `tip.px tip.py tip.pz` (m),
    `tip.qw tip.qx tip.qy tip.qz`, `tip.vx tip.vy tip.vz` (m/s), `tip.wx tip.wy tip.wz` (rad/s); for a hinge or a wheel
    `elbow` `elbow.tx elbow.ty elbow.tz` (Nm) and `elbow.fx elbow.fy elbow.fz` (N), the load on the outboard body about
    the hinge point; its drive `elbow.drive`; `energy.kinetic`, `energy.total` ... (J), `momentum.angular.x .y .z` (Nms)
    and `momentum.linear.x .y .z` (Ns). World axes; quaternions scalar-first, body to World. Only whole groups count,
    any subset of groups will do; `--template` writes a file with the times and all columns to fill in. flexmb's own
    `trajectory.csv` and a file like `reference.csv` will do as they are: they are compared in whatever the case sets a
    goal for.

    Your own times will do too, if they rise and cover the reference's: nothing is interpolated, but the reference is
    computed at your times, which takes seconds. `docs/verify.md` leads from a code of your own to the first verdict.

    **Shows** each channel's distance E, uncertainty U, the time at which it is worst, and what is wrong, where putting
    it right makes the channel agree: thousandths, degrees, revolutions per minute, a sign, exchanged components,
    quaternions conjugate or scalar-last, body axes, another origin, another zero of energy, moments about another
    point, times that are shifted or in another unit. Channels that your file lacks are listed.

    **Exit code**: 0 every channel in the file agrees; 1 some do not; 2 the file cannot be compared.
    """
    with in_one_line():
        require_engines(() if engine is None else (engine,))
        cases = found((case,))
        if len(cases) > 1:
            refuse(f'"{case}" is {len(cases)} cases: name one of {", ".join(case.name for case in cases)}')
        (chosen,) = cases
        require_variants(cases, () if variant is None else (variant,))
        from crosscheck.verify.against_case import outcome_json, verify_csv

        if template:
            _write_template(csv, chosen, variant)
            return
        runs_on = scheduler_at(scheduler)
        outcome = verify_csv(chosen, csv, coarse=coarse, variant=variant, engine=engine, scheduler=runs_on)
    code = _show(outcome)
    if as_json:
        typer.echo(outcome_json(outcome))
    raise typer.Exit(code)


def _write_template(csv: Path, case: Case, variant: str | None) -> None:
    from crosscheck.verify.against_case import sample_times_csv

    if csv.exists():
        refuse(f"{csv} exists already, and a template would replace it: name another file")
    write_whole(csv, sample_times_csv(case, variant))
    console.print(words(f"Fill in {csv}, then run the command again without --template."), soft_wrap=True)


def _show(outcome: CsvOutcome) -> int:
    """Print the channels and the verdicts; the exit code."""
    from crosscheck.terminal.listings import channels_table
    from crosscheck.terminal.verdicts import print_outcome

    console.print(channels_table(outcome))
    console.print(words(f"Held against {outcome.against}."), soft_wrap=True)
    if outcome.interpolated:
        console.print(words(f"Your times: {outcome.interpolated}."), soft_wrap=True)
    console.print(words(f"{outcome.inventory}."), soft_wrap=True)
    if outcome.left_out:
        console.print(words(f"Not compared: {', '.join(outcome.left_out)}"), soft_wrap=True)
    return print_outcome(console, outcome)
