"""The table of docs/export-fmu.md: what of the case library is exported, by trying. Write it with

python -m tests.repo.exported

Each scene is refused, or assembled, with the block of memory that an instance of it has; tests/flexmb/export runs them,
all of them in its slow test_library.py.
"""

import re
import warnings
from collections.abc import Iterator

from crosscheck.library.find import Case, shipped_cases
from flexmb.export.model import memory
from flexmb.export.refusals import NotExportable, refuse
from flexmb.scene.problems import SceneWarning
from flexmb.system.compile import compile
from tests.repo.project import ROOT, spliced

PAGE = ROOT / "docs" / "export-fmu.md"
START = "<!-- exported: written by python -m tests.repo.exported -->\n"


def row(case: Case) -> str:
    """One line for the scene of a case's first variant."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)  # what is doubtful in a case is the case's matter
        scene = case.scene(case.run.variants[0])
        try:
            refuse(scene)
        except NotExportable as refused:
            reason = re.sub(r'^scene ".*?" cannot be exported: ', "", str(refused)).split(": ")[0]
            return f"| `{case.name}` | no: {reason} | | |"
        system = compile(scene)
        size = 8 * len(memory(system).words)
    return f"| `{case.name}` | yes | {system.nq + system.nu + 1} | {size / 1000:.0f} |"


def table() -> Iterator[str]:
    """One line for each case, and their number."""
    rows = [row(case) for case in shipped_cases()]
    count = sum("| no: " not in each for each in rows)
    yield f"{count} of {len(rows)} cases are not refused, and their tables make a block.\n"
    yield "| case | exported | states | kB of an instance |"
    yield "|---|---|---|---|"
    yield from rows


def page(lines: str) -> str:
    """The page with these lines for its table."""
    return spliced(PAGE.read_text(encoding="utf-8"), START, lines)


if __name__ == "__main__":
    PAGE.write_text(page("".join(f"{line}\n" for line in table())), encoding="utf-8")
