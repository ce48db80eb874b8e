"""`crosscheck validate`: predictions against measurements."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from crosscheck.cli.common import Json, NoUserCode, Verbose, app, console, in_one_line, print_json, sole_writer


def _complete_set(begun: str) -> list[str]:
    from crosscheck.validation.measured_set import shipped_sets  # it reads the names of sets, of nothing else

    return [name for name in shipped_sets() if name.startswith(begun)]


@app.command()
def validate(
    sets: Annotated[
        list[str],
        typer.Argument(
            help="Names of measured sets, `all`, `list` to see which there are, or folders with a measured.toml.",
            autocompletion=_complete_set,
        ),
    ],
    samples: Annotated[
        int, typer.Option(min=0, max=10_000, help="Draw all inputs so many times, beside the first-order budget.")
    ] = 0,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for a page of each set and for validation.json.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the samples.")] = 0,
    verbose: Verbose = False,
    as_json: Json = False,
    no_user_code: NoUserCode = False,
) -> None:
    """
    Hold predictions against measured data, with a budget of uncertainty for every point (after ASME V&V 20).

    A point's error is E = S - D, prediction less reading. Its validation uncertainty u_val is the root of the sum of
    squares of three standard deviations: of the numbers (u_num, by refinement), of the inputs (u_input, by the
    derivatives of the prediction) and of the reading (u_D). It is within if |E| is at most 2 u_val. A series with 19 of
    20 points within is *validated within u_val*; otherwise its model is wrong by what is shown. `--verbose` has every
    point, and which input its uncertainty comes from. `--samples 200` draws the inputs and shows how far u_input, which
    is of first order, is from the deviation of the samples. `--out FOLDER` writes a page of each set, with charts, and
    all numbers as JSON.

    A set is a folder with `measured.toml`, `points.csv` and `model.py`; `docs/validation.md` says what they hold.

    **Exit code**: 0 every series came out as its file says; 1 one did not; 2 there is no such set, or its files or its
    model are wrong.

    **Examples**: `crosscheck validate list` · `crosscheck validate composite_strips --verbose` ·
    `crosscheck validate all --json`
    """
    with in_one_line() if out is None else sole_writer(out):
        from crosscheck.terminal.measured import identified_table, points_table, series_table, sets_table, told_progress
        from crosscheck.validation.budget import budget, document
        from crosscheck.validation.measured_set import find_sets

        chosen = find_sets(sets)
        if sets == ["list"]:
            if as_json:
                print_json({each.name: {"title": each.content.title, "points": len(each.points)} for each in chosen})
            else:
                console.print(sets_table(chosen))
            return
        if out is not None:
            from crosscheck.report.measured import write_measured  # before anything is computed

        budgets = []
        for measured in chosen:
            with told_progress(console, measured.name) as listener:
                budgets.append(budget(measured, samples, seed, listener))
            console.print(series_table(budgets[-1]))
            if measured.content.fit:
                console.print(identified_table(budgets[-1]))
            if verbose:
                console.print(points_table(budgets[-1]))
        verdicts = [verdict for of_set in budgets for verdict in of_set.verdicts()]
        wrong = [verdict for verdict in verdicts if not verdict.ok]
        within, points = sum(each.within for each in verdicts), sum(each.points for each in verdicts)
        headline = f"{within} of {points} points are within their uncertainty; " + (
            f"{len(wrong)} of {len(verdicts)} series are not as their files say"
            if wrong
            else f"all {len(verdicts)} series are as their files say"
        )
        console.print(headline)
        if out is not None:
            console.print(f"Report: {write_measured(budgets, headline, out)}", soft_wrap=True)
    if as_json:
        print_json({of_set.of.name: document(of_set) for of_set in budgets})
    raise typer.Exit(1 if wrong else 0)
