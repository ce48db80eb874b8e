"""`crosscheck sensitivity`: how much verdicts rest on the last digits of their scenes."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from crosscheck.cli import common


@common.app.command()
def sensitivity(
    cases: common.CaseWords,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for sensitivity.json, evidence of a case's label.")
    ] = None,
    verbose: common.Verbose = False,
    as_json: common.Json = False,
    no_user_code: common.NoUserCode = False,
) -> None:
    """
    Move the inputs of scenes by their last digits, and show how far channels spread, beside E, U and goal.

    All numbers of `scene.toml` with a decimal point are moved at once, up or down by chance: by 2 units in the last
    place of 64 bits (`2 ulp`), and by half of their last printed digit (`digits`). A spread is the largest distance
    from the run as printed over 4 such scenes, relative to the channel's size as E and U are: nine runs of native at
    its finest effort for each variant that it runs, said before. E and U are the accepted figures of the case. Where
    `2 ulp` is above U, rounding of the inputs alone decides. Where `digits` is above the goal, what is compared is one
    scene and not what its numbers were measured on. `--verbose` has every channel, not only the largest spread of each
    kind. `--out FOLDER` writes all numbers as `sensitivity.json`, with the digests of the case's files and of the code:
    evidence for `crosscheck label`. Cases that it holds already are kept.

    **Exit code**: 0 every variant was run; 1 a scene with moved inputs gave no result; 2 there is no such case, or
    native does not run it.

    **Examples**: `crosscheck sensitivity pendulums/double` · `crosscheck sensitivity ./my_case --json`
    """
    chosen = common.asked(cases)
    from crosscheck.sampling.printed import ENGINE, FILE, RUNS, spreads
    from crosscheck.sealed.seal import add_stamped, stamped
    from crosscheck.terminal.listings import spreads_table

    with common.in_one_line() if out is None else common.sole_writer(out):
        found, written = {}, {}
        for case in chosen:
            variants = [variant for variant in case.run.variants if ENGINE in variant.engines]
            if not variants:
                common.refuse(f"{case.name}: no variant of it is run by {ENGINE}")
            runs = RUNS * len(variants)
            common.console.print(f"{case.name}: {runs} runs of {ENGINE}", markup=False)
            found[case.name] = [spreads(case, variant) for variant in variants]
            variants_of = {each.variant: asdict(each) for each in found[case.name]}
            written[case.name] = stamped({"variants": variants_of}, case.folder)
            common.console.print(spreads_table(case.name, found[case.name], verbose))
            if out is not None:
                common.console.print(f"Written: {add_stamped(written, out / FILE)}", soft_wrap=True, markup=False)
    failed = [text for group in found.values() for each in group for text in each.failed]
    for text in failed:
        common.console.print(f"no result with moved inputs: {text}", markup=False)
    if as_json:
        common.print_json(written)
    raise typer.Exit(int(bool(failed)))
