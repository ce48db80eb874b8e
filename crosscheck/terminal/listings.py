"""Tables of the cases, the engines and the maps."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from crosscheck.terminal.text import words
from flexmb.output.listing import Listing, figures, names, prose

if TYPE_CHECKING:  # a table of one kind does not need the types of the others
    from crosscheck.library.find import Case
    from crosscheck.running.installed import EngineState
    from crosscheck.stability.map import StabilityMap


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
