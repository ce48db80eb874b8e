"""`crosscheck sensitivity`: how much verdicts rest on the last digits of their scenes."""

from __future__ import annotations

from dataclasses import asdict

import typer

from crosscheck.cli import common


@common.app.command()
def sensitivity(
    cases: common.CaseWords,
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
    kind.

    **Exit code**: 0 every variant was run; 1 a scene with moved inputs gave no result; 2 there is no such case, or
    native does not run it.

    **Examples**: `crosscheck sensitivity pendulums/double` · `crosscheck sensitivity ./my_case --json`
    """
    chosen = common.asked(cases)
    from crosscheck.sampling.printed import ENGINE, RUNS, spreads
    from crosscheck.terminal.spreads import spreads_table

    with common.in_one_line():
        found = {}
        for case in chosen:
            variants = [variant for variant in case.run.variants if ENGINE in variant.engines]
            if not variants:
                common.refuse(f"{case.name}: no variant of it is run by {ENGINE}")
            runs = RUNS * len(variants)
            common.console.print(f"{case.name}: {runs} runs of {ENGINE}", markup=False)
            found[case.name] = [spreads(case, variant) for variant in variants]
            common.console.print(spreads_table(case.name, found[case.name], verbose))
    failed = [text for group in found.values() for each in group for text in each.failed]
    for text in failed:
        common.console.print(f"no result with moved inputs: {text}", markup=False)
    if as_json:
        common.print_json({name: {each.variant: asdict(each) for each in group} for name, group in found.items()})
    raise typer.Exit(int(bool(failed)))
