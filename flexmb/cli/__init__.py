"""The command `flexmb`: it parses arguments and prints results; all else is in other rooms.

The code of a command is imported when it runs: `--help`, completion and mistyped arguments load neither scenes nor
NumPy.
"""

from __future__ import annotations

from typing import Annotated

import typer

from flexmb.cli.advising import advise
from flexmb.cli.appendages import equivalence
from flexmb.cli.compiling import warmup
from flexmb.cli.interchanging import export, import_, reduce
from flexmb.cli.linearising import campbell, linearize
from flexmb.cli.properties import mass
from flexmb.cli.running import simulate
from flexmb.cli.scenes import check, schema
from flexmb.cli.vibrating import vibrate
from flexmb.cli.viewing import view
from flexmb.output.readers import outlive_readers

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""
Simulate trees of rigid and flexible bodies, wheels and point masses.

A scene is a TOML file: see `docs/scene-reference.md`, or `flexmb schema` for the JSON Schema your editor understands.

Find every defect of a scene: `flexmb check scene.toml`

Run it, write CSV and charts: `flexmb simulate scene.toml --t-end 10 --out results`
""",
)


def _show_version(asked: bool) -> None:
    if asked:
        from flexmb.cli.terminal import versions_text  # it reads the metadata of installed distributions

        typer.echo(versions_text())
        raise typer.Exit


@app.callback()
def everything(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show versions and end.")
    ] = False,
) -> None:
    """No text: the help of the application is above."""


for command in (
    simulate, check, mass, equivalence, advise, linearize, campbell, vibrate, view, export, reduce, schema, warmup
):  # fmt: skip
    app.command()(command)
app.command("import")(import_)  # `import` is a keyword and cannot be the name of a function


def main() -> None:
    """Entry point of the command `flexmb`."""
    outlive_readers()
    app()
