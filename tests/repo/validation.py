"""The table of docs/validation.md: every shipped set is predicted anew, which takes some minutes. Write it with

python -m tests.repo.validation
"""

from collections.abc import Iterator

from crosscheck.validation.budget import budget
from crosscheck.validation.measured_set import find_set, shipped_sets
from tests.repo.project import ROOT, spliced

PAGE = ROOT / "docs" / "validation.md"
START = "<!-- measured: written by python -m tests.repo.validation -->\n"


def table() -> Iterator[str]:
    """One line for each series."""
    yield "| set | series | verdict | within | rms | largest | u_val | horizon | derivatives |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for name in shipped_sets():
        known = budget(find_set(name))
        exact, inputs = sum(known.exact), len(known.exact)
        by = "exact" if exact == inputs else f"{exact} of {inputs} exact" if exact else "differences"
        for verdict in known.verdicts():
            standing = "validated within u_val" if verdict.standing == "validated" else "model error"
            why = f": {verdict.series.reason}" if verdict.standing == "model error" else ""
            sizes = " | ".join(f"{size:.1%}" for size in (verdict.rms, verdict.largest, verdict.u_val))
            within = f"{verdict.within} of {verdict.points}"
            horizon = "" if verdict.horizon is None else f"{verdict.horizon:.3g} s"
            yield f"| `{name}` | {verdict.series.name} | {standing}{why} | {within} | {sizes} | {horizon} | {by} |"


if __name__ == "__main__":
    lines = "".join(f"{line}\n" for line in table())
    PAGE.write_text(spliced(PAGE.read_text(encoding="utf-8"), START, lines), encoding="utf-8")
