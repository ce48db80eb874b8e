"""Tables of cases, engines, maps, the channels of a CSV and benchmarks, and the versions of all that runs."""

from __future__ import annotations

import platform
from collections.abc import Iterable
from typing import TYPE_CHECKING

from rich.console import Console

from crosscheck.judging.work import seconds
from crosscheck.terminal.text import marked, words
from flexmb.output.listing import Listing, figures, names, prose
from flexmb.output.versions import version_of

if TYPE_CHECKING:
    from crosscheck.label.document import LabelFile, SubjectLabel
    from crosscheck.library.find import Case
    from crosscheck.running.installed import EngineState
    from crosscheck.sampling.printed import VariantSpreads
    from crosscheck.stability.map import StabilityMap
    from crosscheck.timing.bench import CaseBench, Contest
    from crosscheck.verify.outcome import CsvOutcome


def cases_table(cases: Iterable[Case]) -> Listing:
    """The case library."""
    table = Listing(*names("case"), *prose("title", "tags", "variants", "engines"), *figures("accepted figures"))
    for case in cases:
        engines = dict.fromkeys(name for variant in case.run.variants for name in (*variant.engines, *variant.also))
        variants = ", ".join(variant.name for variant in case.run.variants)
        accepted = sum(len(verdicts) for verdicts in case.accepted.values())
        tags = ", ".join(case.run.tags)
        table.add(case.name, case.run.title, tags, variants, ", ".join(engines), str(accepted or "none"))
    return table


def engines_table(states: Iterable[EngineState]) -> Listing:
    """The engines."""
    table = Listing(*names("engine"), *prose("what it is", "version", "how to install"))
    for state in states:
        version = words(state.absence, "yellow") if state.version is None else words(state.version, "green")
        table.add(state.name, state.summary, version, state.advice)
    table.add("fmu:FILE", "any FMU of FMI 2 or 3, or a mapping of one", "", "")
    return table


def maps_table(maps: Iterable[StabilityMap]) -> Listing:
    """The stability maps."""
    table = Listing(*names("map"), *prose("axes", "overlay"))
    for what in maps:
        table.add(what.name, f"{what.x.label} x {what.y.label}", what.overlay.name)
    return table


def channels_table(checked: CsvOutcome) -> Listing:
    """Every channel of a CSV: how far off, with which uncertainty, when worst, and why, where there is a guess."""
    table = Listing(
        *names("channel", "status"), *figures("E", "U", "goal", "worst at, s"), *prose("it looks as if")
    )  # fmt: skip
    for verdict in checked.all:
        detail = checked.details.get(verdict.channel)
        numbers = ("" if value is None else f"{value:.2g}" for value in (verdict.E, verdict.U, verdict.goal))
        when, why = ("", "") if detail is None else (f"{detail.worst_s:.6g}", detail.cause)
        status = words(verdict.status, "green" if verdict.ok else "red")
        table.add(verdict.channel, status, *numbers, when, why)
    return table


def versions_text() -> str:
    """One line for each version, for bug reports; all engines are asked, including plug-ins."""
    from crosscheck.running.installed import describe_engines  # no table needs it

    lines = [f"crosscheck {version_of('flexmb')}", f"Python {platform.python_version()}, numba {version_of('numba')}"]
    alike: dict[str, list[str]] = {}
    for engine in describe_engines():
        alike.setdefault(engine.version or engine.absence, []).append(engine.name)
    lines += [f"{', '.join(engines)}: {text}" for text, engines in alike.items()]
    return "\n".join(lines)


def print_bench(console: Console, bench: CaseBench) -> None:
    """Print a case: the equals with their ratios, those timed apart, and those not timed with the reason."""
    levels = " and ".join(
        sorted({f"{contest.rival.job.variant} ({contest.rival.level})" for contest in bench.contests})
    )
    title = f"\n{bench.case}, {levels}: equals are within {bench.accuracy:g} of the reference; {bench.rounds} rounds"
    console.print(words(title, "bold"), soft_wrap=True)
    if bench.problem:
        console.print(marked("✕", "red", bench.problem), soft_wrap=True)
        return
    timed = [contest for contest in bench.contests if contest.timed is not None]
    if timed:
        console.print(_timed_table(timed))
    for contest in bench.contests:
        if contest.standing == "apart":
            console.print(marked("!", "yellow", f"{contest.rival.name} is no equal: {contest.why}"), soft_wrap=True)
        elif contest.standing == "not timed":
            console.print(marked("✕", "red", f"{contest.rival.name} is not timed: {contest.why}"), soft_wrap=True)


def _timed_table(timed: list[Contest]) -> Listing:
    """The timed engines, with variant and level of the bodies if these are not the same for all."""
    from crosscheck.timing.benchmark_json import statistics  # no other table needs it

    right = figures("min", "quartiles", "ratio", "error", "compile", "again")
    table = Listing(*names("engine and effort"), *right)
    equals = [contest.best_s for contest in timed if contest.standing == "equal" and contest.best_s is not None]
    models = {(contest.rival.job.variant, contest.rival.level) for contest in timed}
    for contest in timed:
        assert contest.timed is not None and contest.timed.prepared is not None and contest.rung is not None
        stats = statistics(contest)
        job, level, rung = contest.rival.job, contest.rival.level, contest.rung
        table.add(
            f"{job.engine if len(models) == 1 else f'{job.engine}, {job.variant} ({level})'} {rung.effort.label}",
            seconds(stats.min),
            f"+{_percent(stats.q1, stats.min)} .. +{_percent(stats.q3, stats.min)} %",
            f"{stats.min / min(equals):.3g}" if contest.standing == "equal" else "apart",
            f"{rung.error:.0e}",
            seconds(contest.rival.compile_s),
            seconds(contest.timed.prepared.again_s),
        )
    return table


def _percent(value: float, least: float) -> str:
    return f"{100.0 * (value / least - 1.0):.0f}"


# Labels on the terminal: all factors of one subject, or the levels of many.


def levels_table(labels: LabelFile) -> Listing:
    """A row for each subject."""
    from crosscheck.label.document import level_rows
    from crosscheck.label.factors import FACTORS

    heads = (factor.replace("_", " ") for factor in FACTORS)
    table = Listing(*names("case"), *figures(*heads), title=f"Credibility by {labels.standard}, levels 0 to 4")
    for row in level_rows(labels.subjects):
        table.add(*row)
    return table


def label_table(name: str, label: SubjectLabel, everything: bool) -> Listing:
    """A row for each factor, with the evidence that counts, or all that was looked at."""
    from crosscheck.label.factors import TITLES

    use = [f"Intended use: {label.intended_use}", *(f"Limit: {each}" for each in label.limits)]
    table = Listing(
        *names("factor"), *figures("level"), *prose("what the files show", "files", "raised by"),
        title=f"{name}: {label.title}", caption=". ".join([*use, *(f"Waiver: {each}" for each in label.waivers)]),
    )  # fmt: skip
    for factor, row in label.factors.items():
        shown = [each.words for each in row.evidence if everything or each.state != "absent"]
        table.add(TITLES[factor], str(row.level), row.because, "; ".join(shown), row.raised_by)
    return table


# Spreads of channels under moved inputs, on the terminal.


def spreads_table(case: str, found: Iterable[VariantSpreads], everything: bool) -> Listing:
    """A row for each channel, or for that with the largest spread by digits of each kind of channel."""
    table = Listing(
        *names("variant", "channel"), *figures("inputs moved", "held", "2 ulp", "digits", "E", "U", "goal"), title=case
    )
    for of in found:
        largest: dict[str, str] = {}
        for name, spread in of.channels.items():
            kind = name if everything else f"{name.partition(':')[0]}.{name.rpartition('.')[2]}"
            if kind not in largest or spread.digits > of.channels[largest[kind]].digits:
                largest[kind] = name
        for name in largest.values():
            each = of.channels[name]
            numbers = (each.ulp, each.digits, each.E, each.U, each.goal)
            cells = ("" if number is None else f"{number:.1e}" for number in numbers)
            table.add(of.variant, name, str(of.moved), str(len(of.held)), *cells)
    return table
