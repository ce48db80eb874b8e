"""`crosscheck bench`: engines that agree are timed in turns."""

from __future__ import annotations

import json
from math import inf
from pathlib import Path
from typing import Annotated, Any

import typer

from crosscheck.cli import common
from crosscheck.running.scheduler import Limits
from crosscheck.terminal.text import words
from flexmb.output.files import check_folder, folder, take_away, write_whole

Variants = Annotated[
    list[str] | None,
    typer.Option("--variant", help="Only these variants (repeat it); by default the one that the reference is of."),
]


@common.app.command()
def bench(
    cases: common.CaseWords,
    engine: common.EngineNames = None,
    variant: Variants = None,
    rounds: common.Rounds = 10,
    accuracy: Annotated[
        float, typer.Option("--accuracy", help="How near to the reference, of the signals' sizes, an equal must be.")
    ] = 1e-4,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write what `pytest-benchmark compare` reads.")
    ] = None,
    time_limit: common.TimeLimit = None,
    quiet: common.Quiet = False,
    no_user_code: common.NoUserCode = False,
) -> None:
    """
    Time the engines of cases against each other, those that agree.

    Every engine first climbs its efforts and is held against the stored `reference.csv`. The cheapest effort that is
    within `--accuracy` in every channel is timed: each engine in a process of its own, all taking turns. Shown are the
    shortest solve and the quartiles, and apart from them what compiling takes, the first time and again. Who disagrees,
    or is less accurate, is no equal, and it says so; who crashes or hangs does not stop the others.

    **Exit code**: 0 somebody was timed on every case; 1 nobody was on one of them; 2 the request makes no sense.

    **Examples**: `crosscheck bench tops/gyrostat` · `crosscheck bench canonical --rounds 30 --json bench.json` ·
    `crosscheck bench closed_chains/four_bar -e native -e pinocchio --accuracy 1e-6`
    """
    shown = common.verbosity(quiet, False)
    if not 0.0 < accuracy < inf:
        common.refuse(f"--accuracy {accuracy:g}: give a positive number such as 1e-4")
    chosen = common.asked(cases, engine or (), variant or (), time_limit)
    from crosscheck.terminal.listings import print_bench
    from crosscheck.terminal.progress import LiveProgress
    from crosscheck.timing.bench import bench as bench_case
    from crosscheck.timing.benchmark_json import MISSING, available, benchmark_document

    if not available():
        common.refuse(MISSING)
    benches = []
    with common.in_one_line():
        if json_file is not None:
            check_folder(json_file.parent)
            take_away(json_file)
        for case in chosen:
            with LiveProgress(common.console, shown) as live:
                done = bench_case(
                    case, engine or (), variant or (),
                    rounds=rounds, accuracy=accuracy, limits=Limits(1, time_limit), listener=live.hear,
                )  # fmt: skip
            benches.append(done)
            if not quiet:
                print_bench(common.console, done)
        if json_file is not None:
            _write(json_file, benchmark_document(benches))
    empty = [bench.case for bench in benches if not any(contest.timed for contest in bench.contests)]
    last = f"nobody was timed on {', '.join(empty)}" if empty else f"{len(benches)} cases timed"
    where = "" if json_file is None else f"; {json_file}"
    common.console.print(words(last + where, "red" if empty else "green"))
    raise typer.Exit(int(bool(empty)))


def _write(file: Path, document: dict[str, Any]) -> None:
    folder(file.parent)
    write_whole(file, json.dumps(document, indent=1, allow_nan=False))
