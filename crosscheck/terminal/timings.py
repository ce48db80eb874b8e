"""The table of a benchmark, and the engines that are not in it."""

from __future__ import annotations

from rich.console import Console

from crosscheck.terminal.text import marked, words
from crosscheck.timing.bench import CaseBench, Contest
from crosscheck.timing.benchmark_json import statistics
from flexmb.output.listing import Listing, figures, names


def print_bench(console: Console, bench: CaseBench) -> None:
    """Print a case: the equals with their ratios, those timed apart, and those not timed with the reason."""
    levels = " and ".join(sorted({f"{each.rival.job.variant} ({each.rival.level})" for each in bench.contests}))
    title = f"\n{bench.case}, {levels}: equals are within {bench.accuracy:g} of the reference; {bench.rounds} rounds"
    console.print(words(title, "bold"), soft_wrap=True)
    if bench.problem:
        console.print(marked("✕", "red", bench.problem), soft_wrap=True)
        return
    timed = [each for each in bench.contests if each.timed is not None]
    if timed:
        console.print(_table(timed))
    for each in bench.contests:
        if each.standing == "apart":
            console.print(marked("!", "yellow", f"{each.rival.name} is no equal: {each.why}"), soft_wrap=True)
        elif each.standing == "not timed":
            console.print(marked("✕", "red", f"{each.rival.name} is not timed: {each.why}"), soft_wrap=True)


def _table(timed: list[Contest]) -> Listing:
    """The timed engines, with variant and level of the bodies if these are not the same for all."""
    right = figures("min", "quartiles", "ratio", "error", "compile", "again")
    table = Listing(*names("engine and effort"), *right)
    equals = [each.best_s for each in timed if each.standing == "equal" and each.best_s is not None]
    models = {(each.rival.job.variant, each.rival.level) for each in timed}
    for each in timed:
        assert each.timed is not None and each.timed.prepared is not None and each.rung is not None
        stats = statistics(each)
        job, level = each.rival.job, each.rival.level
        table.add(
            f"{job.engine if len(models) == 1 else f'{job.engine}, {job.variant} ({level})'} {each.rung.effort.label}",
            seconds(stats.min),
            f"+{_percent(stats.q1, stats.min)} .. +{_percent(stats.q3, stats.min)} %",
            f"{stats.min / min(equals):.3g}" if each.standing == "equal" else "apart",
            f"{each.rung.error:.0e}",
            seconds(each.rival.compile_s),
            seconds(each.timed.prepared.again_s),
        )
    return table


def _percent(value: float, least: float) -> str:
    return f"{100.0 * (value / least - 1.0):.0f}"


def seconds(value: float) -> str:
    """A time with three digits, in s, ms or us."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value / 1e-6:.3g} us"
