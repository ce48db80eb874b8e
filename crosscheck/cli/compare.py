"""`crosscheck compare`: what changed between two archived sessions."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from crosscheck.cli.common import Json, Quiet, Verbose, app, console, print_json, refuse, verbosity


@app.command()
def compare(
    old: Annotated[Path, typer.Argument(help="results.json of an earlier session.")],
    new: Annotated[Path, typer.Argument(help="results.json of the session in question.")],
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """
    Say what became worse, better, new or gone between two sessions, by case, comparison, channel and engines.

    **Worse**: a verdict is not as expected any more, its status is graver, E or U has grown beyond the factor of
    accepted figures (10, above rounding), a run does not finish any more. **Gone**: what was judged is not judged any
    more. **New** is what was not judged before; where it is not as expected it is worse. Times are shown where they
    changed by half, and judge nothing: machines differ.

    **Exit code**: 0 nothing is worse or gone; 1 something is; 2 a file cannot be read, is of another version, is of a
    session that was killed, or was changed after it was written (every results.json is sealed by its SHA-256).

    **Example**: `crosscheck compare main/results.json out/results.json`
    """
    from crosscheck.sealed.compare import compare_results
    from crosscheck.sealed.seal import ResultsError, read_finished
    from crosscheck.terminal.verdicts import print_differences

    shown = verbosity(quiet, verbose)
    try:
        differences = compare_results(read_finished(old), read_finished(new))
    except ResultsError as error:
        refuse(str(error))
    print_differences(console, differences, shown)
    if as_json:
        print_json(asdict(differences) | {"regressed": differences.regressed})
    raise typer.Exit(int(differences.regressed))
