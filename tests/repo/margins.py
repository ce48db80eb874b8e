"""docs/margins.md: which goals of the shipped cases are met by little, or so that nothing can miss them.

From the goals of run.toml and the accepted figures beside it; nothing is run. Write it with

python -m tests.repo.margins
"""

from collections.abc import Iterator

from crosscheck.judging.margins import NARROW, WIDE, FlaggedGoal, flagged_of, margin
from crosscheck.library.channels import most_specific
from crosscheck.library.find import Case, shipped_cases
from tests.repo.project import ROOT

PAGE = ROOT / "docs" / "margins.md"
HEAD = f"""# Margins of goals

How far the agreements of the shipped cases are from their goals: goal / max(E, U), with the accepted figures of each
case (`accepted.toml`). Below {NARROW:g} the next machine may cross the goal. Above {WIDE:g} no fault of a size that
matters could: such a goal is no test by itself, and what shows that the comparison can fail are its negative controls
and [mutations](mutations.md). `crosscheck run` flags the same in `summary.md`, in the report's pages, in `results.json`
(`margins`) and, with `--verbose`, on the terminal. A flag changes no verdict.

Goals are requirements that are written before a run, in run.toml, and are wide here where a channel, say of a signal at
rest, is exact in one engine or a case has one goal for all of its channels. What watches figures far below their goals
are the [accepted figures](verdicts.md#accepted-figures): E or U beyond ten times those is *worse than recorded*.

This page is written by `python -m tests.repo.margins`.

"""


def flags(case: Case) -> Iterator[FlaggedGoal]:
    """The flagged goals of a case's comparisons that expect agreement, by its accepted figures."""
    for comparison in case.run.comparisons:
        group = []
        for place, figure in case.accepted.get(comparison.name, {}).items() if comparison.expect == "agree" else ():
            channel = place.partition(" | ")[0]
            pattern = most_specific(comparison.goals, channel)
            size = None if pattern is None else margin(comparison.goals[pattern], figure.E, figure.U)
            if pattern is not None and size is not None:
                group.append((size, channel, comparison.goals[pattern]))
        yield from flagged_of(case.name, comparison.name, group)


def agreements(case: Case) -> int:
    """Accepted figures of comparisons that expect agreement."""
    expecting = {comparison.name for comparison in case.run.comparisons if comparison.expect == "agree"}
    return sum(len(table) for name, table in case.accepted.items() if name in expecting)


def page() -> str:
    """The text of the page."""
    cases = shipped_cases()
    found = [each for case in cases for each in flags(case)]
    total = sum(map(agreements, cases))
    counts = {flag: sum(each.channels for each in found if each.flag == flag) for flag in ("narrow", "wide")}
    lines = [
        f"Of {total} agreements in {len(cases)} cases {counts['narrow']} have a margin below {NARROW:g} and "
        f"{counts['wide']} one above {WIDE:g}.",
    ]
    for flag, title in (("narrow", f"Below {NARROW:g}"), ("wide", f"Above {WIDE:g}")):
        lines += ["", f"## {title}", "", "| case | comparison | goals | extreme | channel | goal |"]
        lines += ["|---|---|---|---|---|---|"]
        lines += [
            f"| {each.case} | {each.comparison} | {each.channels} of {each.judged} | {each.extreme:.1e} | "
            f"`{each.channel}` | {each.goal:.2g} |"
            for each in found
            if each.flag == flag
        ]
    return HEAD + "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
