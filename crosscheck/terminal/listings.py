"""Tables of the cases, the engines and the maps that there are."""

from __future__ import annotations

from collections.abc import Iterable

from rich.table import Column, Table

from crosscheck.library.find import Case
from crosscheck.running.installed import EngineState
from crosscheck.stability.map import StabilityMap
from crosscheck.terminal.text import words


def cases_table(cases: Iterable[Case]) -> Table:
    """The case library."""
    table = Table("case", "title", "tags", "variants", "engines", "accepted figures", header_style="bold")
    for case in cases:
        engines = dict.fromkeys(name for each in case.run.variants for name in (*each.engines, *each.also))
        variants = ", ".join(variant.name for variant in case.run.variants)
        figures = sum(len(each) for each in case.accepted.values())
        tags = ", ".join(case.run.tags)
        cells = (case.name, case.run.title, tags, variants, ", ".join(engines), str(figures or "none"))
        table.add_row(*map(words, cells))
    return table


def engines_table(states: Iterable[EngineState]) -> Table:
    """The engines."""
    table = Table(Column("engine", no_wrap=True), "what it is", "version", "how to install", header_style="bold")
    for state in states:
        version = words(state.absence, "yellow") if state.version is None else words(state.version, "green")
        table.add_row(words(state.name), words(state.summary), version, words(state.advice))
    return table


def maps_table(maps: Iterable[StabilityMap]) -> Table:
    """The stability maps."""
    table = Table("map", "axes", "overlay", header_style="bold")
    for what in maps:
        table.add_row(*map(words, (what.name, f"{what.x.label} x {what.y.label}", what.overlay.name)))
    return table
