"""`crosscheck list` and `crosscheck engines`: what there is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from crosscheck.cli.common import Json, app, console, found, print_json

if TYPE_CHECKING:
    from crosscheck.library.find import Case
    from crosscheck.running.installed import EngineState


@app.command("list")
def list_cases(as_json: Json = False) -> None:
    """List the shipped cases with their tags, variants and engines."""
    from crosscheck.terminal.listings import cases_table

    cases = found(("all",))
    if as_json:
        print_json([_plain(case) for case in cases])
    else:
        console.print(cases_table(cases))


@app.command()
def engines(as_json: Json = False) -> None:
    """List the engines: which are installed, in which version, and how to install the others."""
    from crosscheck.running.installed import describe_engines
    from crosscheck.terminal.listings import engines_table

    states = describe_engines()
    if as_json:
        print_json([_state(state) for state in states])
    else:
        console.print(engines_table(states))


def _state(state: EngineState) -> dict[str, Any]:
    problem = "" if state.version is not None else state.absence
    return {
        "name": state.name, "summary": state.summary, "version": state.version, "problem": problem,
        "advice": state.advice,
    }  # fmt: skip


def _plain(case: Case) -> dict[str, Any]:
    return {
        "name": case.name,
        "title": case.run.title,
        "tags": case.run.tags,
        "folder": str(case.folder),
        "variants": {variant.name: {"engines": variant.engines, "also": variant.also} for variant in case.run.variants},
        "accepted_figures": sum(len(table) for table in case.accepted.values()),
    }
