"""How long each step of `.ci/run` took: `python -m tests.repo.split FILE KERNELS CORES [--write]`, which it calls.

FILE has a line for each step, its name and whole seconds. The table is printed; `--write` puts it into CONTRIBUTING.md.
"""

import sys
from datetime import date
from pathlib import Path

from tests.repo.project import ROOT

PAGE = ROOT / "CONTRIBUTING.md"
BEGIN, END = "<!-- written by .ci/run --write -->\n", "<!-- end -->\n"


def table(lines: list[str], kernels: str, cores: str) -> str:
    """In Markdown."""
    steps = [line.split("\t") for line in lines]
    total = sum(int(seconds) for _, seconds in steps)
    rows = [f"| {name} | {int(seconds)} |" for name, seconds in [*steps, ("in all", str(total))]]
    head = f"Of `.ci/run`, with {cores} cores and an empty cache, on {date.today():%d %B %Y} ({kernels} of installing):"
    return "\n".join([head, "", "| step | s |", "|---|---|", *rows, ""])


def written(page: str, made: str) -> str:
    """The page with another table."""
    before, _, rest = page.partition(BEGIN)
    _, _, after = rest.partition(END)
    if not rest or not after:
        raise ValueError(f"CONTRIBUTING.md has no place for the table, between {BEGIN!r} and {END!r}")
    return before + BEGIN + made + END + after


if __name__ == "__main__":
    file, kernels, cores, *options = sys.argv[1:]
    made = table(Path(file).read_text(encoding="utf-8").splitlines(), kernels, cores)
    print(made)
    if "--write" in options:
        PAGE.write_text(written(PAGE.read_text(encoding="utf-8"), made), encoding="utf-8")
