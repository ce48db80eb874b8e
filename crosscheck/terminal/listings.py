"""Tables of cases, engines, maps and the channels of a CSV, and the versions of all that runs."""

from __future__ import annotations

import platform
from collections.abc import Iterable
from typing import TYPE_CHECKING

from crosscheck.terminal.text import words
from flexmb.output.listing import Listing, figures, names, prose
from flexmb.output.versions import version_of

if TYPE_CHECKING:  # a table of one kind does not need the types of the others
    from crosscheck.library.find import Case
    from crosscheck.running.installed import EngineState
    from crosscheck.stability.map import StabilityMap
    from crosscheck.verify.outcome import CsvOutcome


def cases_table(cases: Iterable[Case]) -> Listing:
    """The case library."""
    table = Listing(*names("case"), *prose("title", "tags", "variants", "engines"), *figures("accepted figures"))
    for case in cases:
        engines = dict.fromkeys(name for each in case.run.variants for name in (*each.engines, *each.also))
        variants = ", ".join(variant.name for variant in case.run.variants)
        accepted = sum(len(each) for each in case.accepted.values())
        tags = ", ".join(case.run.tags)
        table.add(case.name, case.run.title, tags, variants, ", ".join(engines), str(accepted or "none"))
    return table


def engines_table(states: Iterable[EngineState]) -> Listing:
    """The engines."""
    table = Listing(*names("engine"), *prose("what it is", "version", "how to install"))
    for state in states:
        version = words(state.absence, "yellow") if state.version is None else words(state.version, "green")
        table.add(state.name, state.summary, version, state.advice)
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
    for each in describe_engines():
        alike.setdefault(each.version or each.absence, []).append(each.name)
    lines += [f"{', '.join(engines)}: {text}" for text, engines in alike.items()]
    return "\n".join(lines)
