"""The tables of docs/credibility.md: the criteria, and what the files of the library show. Write them with

python -m tests.repo.credibility
"""

from collections.abc import Iterator
from pathlib import Path

from crosscheck.label.document import SubjectLabel, label
from crosscheck.label.evidence import evidence, of_case, of_measured_set
from crosscheck.label.factors import CRITERIA, FACTORS, TITLES
from crosscheck.library.find import shipped_cases
from crosscheck.validation.measured_set import find_set, shipped_sets
from tests.repo.project import ROOT, spliced

PAGE = ROOT / "docs" / "credibility.md"
MARK = "<!-- {}: written by python -m tests.repo.credibility -->\n"
FEW = 12
NOWHERE = Path("no session")  # nothing lies there: the case's own folder is all


def labels() -> Iterator[tuple[str, SubjectLabel]]:
    """All cases, then all measured sets, by what is in their folders."""
    for case in shipped_cases():
        subject = of_case(case)
        yield case.name, label(subject, evidence(subject, NOWHERE))
    for name in shipped_sets():
        measured = find_set(name)
        subject = of_measured_set(name, measured.content.title, measured.folder)
        yield name, label(subject, evidence(subject, NOWHERE))


def criteria() -> str:
    """A table of the levels of each factor."""
    lines = ["| factor | 1 | 2 | 3 | 4 |", "|---|---|---|---|---|"]
    lines += [f"| {TITLES[factor]} | {' | '.join(CRITERIA[factor][1:])} |" for factor in FACTORS]
    return "\n".join(lines) + "\n"


def levels() -> str:
    """How many subjects have which levels, with their names where there are few."""
    groups: dict[tuple[int, ...], list[str]] = {}
    for name, each in labels():
        groups.setdefault(each.levels, []).append(name)
    lines = [f"| {' | '.join(TITLES[factor] for factor in FACTORS)} | how many | which |"]
    lines += ["|---" * (len(FACTORS) + 2) + "|"]
    for found, names in sorted(groups.items(), reverse=True):
        shown = ", ".join(names) if len(names) <= FEW else "all other cases"
        lines.append(f"| {' | '.join(map(str, found))} | {len(names)} | {shown} |")
    return "\n".join(lines) + "\n"


def page() -> str:
    """The text of the page, with its tables anew."""
    text = PAGE.read_text(encoding="utf-8")
    for name, table in (("criteria", criteria()), ("levels", levels())):
        text = spliced(text, MARK.format(name), table)
    return text


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
