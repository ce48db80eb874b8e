"""`crosscheck list` and `crosscheck engines`: what there is."""

from __future__ import annotations

from crosscheck.cli.common import app, console, found
from crosscheck.running.installed import describe_engines
from crosscheck.terminal.listings import cases_table, engines_table


@app.command("list")
def list_cases() -> None:
    """List the shipped cases with their tags, variants and engines."""
    console.print(cases_table(found(("all",))))


@app.command()
def engines() -> None:
    """List the engines: which are installed, in which version, and how to install the others."""
    console.print(engines_table(describe_engines()))
