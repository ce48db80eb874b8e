"""How long each step of `.ci/run` took: `python -m tests.repo.split FILE KERNELS CORES [--write]`, which it calls.

FILE has a line for each step, its name and whole seconds. The table is printed; `--write` puts it into CONTRIBUTING.md.
"""

import sys
from datetime import date
from pathlib import Path

from tests.repo.project import ROOT, spliced

PAGE = ROOT / "CONTRIBUTING.md"
START = "<!-- written by .ci/run --write -->\n"


def table(lines: list[str], kernels: str, cores: str) -> str:
    """In Markdown."""
    steps = [line.split("\t") for line in lines]
    total = sum(int(seconds) for _, seconds in steps)
    rows = [f"| {name} | {int(seconds)} |" for name, seconds in [*steps, ("in all", str(total))]]
    head = f"Of `.ci/run`, with {cores} cores and an empty cache, on {date.today():%d %B %Y} ({kernels} of installing):"
    return "\n".join([head, "", "| step | s |", "|---|---|", *rows, ""])


if __name__ == "__main__":
    file, kernels, cores, *options = sys.argv[1:]
    made = table(Path(file).read_text(encoding="utf-8").splitlines(), kernels, cores)
    print(made)
    if "--write" in options:
        PAGE.write_text(spliced(PAGE.read_text(encoding="utf-8"), START, made), encoding="utf-8")
