"""docs/equations.md: which function implements every numbered equation of a paper, and which test holds it.

Every docs/equations/<paper>.toml lists the equations of a paper; who implements and who holds them is read from
docstrings and comments (citations.py). Write the page with

    python -m tests.repo.equations
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from tests.repo.citations import Place, Sources, citations
from tests.repo.project import ROOT

PAGE = ROOT / "docs" / "equations.md"
CODE = ("flexmb", "crosscheck")
TESTS = ("tests/flexmb", "tests/crosscheck", "tests/cases")
INTRODUCTION = """# Equations

Every numbered equation of the papers, the functions that implement or use it and the tests that hold it, or why none
is needed. This page is generated: `python -m tests.repo.equations` reads `docs/equations/*.toml` and the equation
numbers that docstrings and comments of functions, classes and tests cite. What the prints get wrong is in
[errata](errata.md), symbols and frames are in [notation](notation.md).
"""
TABLE_HEAD = "| | states | implemented or used in | held by |\n|---|---|---|---|\n"


@dataclass(frozen=True)
class Equation:
    """One numbered equation; `none` says why no function is needed."""

    number: str
    section: str
    states: str
    none: str


@dataclass(frozen=True)
class Paper:
    """A paper as its data file lists it."""

    title: str
    reference: str
    sources: Sources
    errata: str  # page of errata, relative to docs/
    last: int
    equations: tuple[Equation, ...]
    appendices: dict[str, int] = field(default_factory=dict)  # last equation of appendices with lettered numbers

    @property
    def numbers(self) -> list[str]:
        """All its equations: (1) to (`last`), then those of the appendices."""
        lettered = (f"{letter}{n}" for letter, last in self.appendices.items() for n in range(1, last + 1))
        return [*map(str, range(1, self.last + 1)), *lettered]

    @property
    def anchor(self) -> str:
        """Where the page has it: the paper's first name."""
        return anchor(self.sources.names[0])


def load_paper(path: Path) -> Paper:
    """Read a data file; unknown and missing keys are errors."""
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    equations = []
    for section in data.pop("section"):
        for entry in section["equation"]:
            number = str(entry.pop("number"))
            equations.append(Equation(number=number, section=section["title"], **({"none": ""} | entry)))
    named = (tuple(data.pop(key)) for key in ("folders", "names", "other_names"))
    sources = Sources(*named, letters=tuple(data.get("appendices", {})))
    return Paper(sources=sources, equations=tuple(equations), **data)


@dataclass(frozen=True)
class Index:
    """Where a paper's equations are cited."""

    paper: Paper
    code: dict[str, list[Place]]
    tests: dict[str, list[Place]]
    unknown: list[tuple[Place, str]]  # citations of numbers that the paper does not have

    @classmethod
    def of(cls, paper: Paper, root: Path = ROOT) -> Index:
        """Citations of the paper in the code and the tests below root; a range passes over what needs no function."""
        cited = citations(root, paper.sources, CODE + TESTS)
        known = {equation.number: equation for equation in paper.equations}
        index = cls(paper, {}, {}, [(place, n) for place, found in cited.items() for n in found if n not in known])
        for place, found in sorted(cited.items()):
            for n, alone in found.items():
                if n in known and known[n].none and not alone:
                    continue
                if place.is_test:
                    index.tests.setdefault(n, []).append(place)
                elif place.name and place.path.startswith(tuple(f"{package}/" for package in CODE)):
                    index.code.setdefault(n, []).append(place)
        return index

    def faults(self) -> list[str]:
        """What is wrong: numbers that do not exist, equations without code or reason, or with both, or without test."""
        faults = [f"{place.path} {place.name}: cites ({n}), which does not exist" for place, n in self.unknown]
        expected = self.paper.numbers
        if [equation.number for equation in self.paper.equations] != expected:
            faults.append(f"the data file does not list (1) to ({expected[-1]}) once each and in order")
        for equation in self.paper.equations:
            n, code, tests = equation.number, self.code.get(equation.number), self.tests.get(equation.number)
            if not code and not equation.none:
                faults.append(f"({n}) {equation.states}: no function cites it and no reason is given")
            if code and equation.none:
                faults.append(f"({n}) is cited by {code[0].path} {code[0].name}: take the reason out of the data file")
            if code and not tests:
                faults.append(f"({n}) is cited by {code[0].path} {code[0].name}, but by no test")
            for named in numbers_in(equation.none):
                if named not in expected:
                    faults.append(f"({n}): its reason names ({named}), which does not exist")
        return faults


def numbers_in(text: str) -> list[str]:
    """Numbers in parentheses."""
    return re.findall(r"\(([A-Z]?\d+)\)", text)


def page(indices: list[Index], root: Path = ROOT) -> str:
    """The text of docs/equations.md."""
    parts = [INTRODUCTION]
    for index in indices:
        errata = _errata(index.paper, root)
        reasons = sum(1 for equation in index.paper.equations if equation.none)
        count = len(index.paper.equations)
        tally = f"{count} equations: {count - reasons} implemented, {reasons} need no function."
        parts.append(f"## {index.paper.title}\n\n{index.paper.reference}\n\n{tally}\n")
        for section in dict.fromkeys(equation.section for equation in index.paper.equations):
            rows = [_row(index, equation, errata) for equation in index.paper.equations if equation.section == section]
            parts.append(f"### {section}\n\n{TABLE_HEAD}" + "".join(rows))
    return "\n".join(parts)


def _row(index: Index, equation: Equation, errata: dict[str, str]) -> str:
    number = f'<a id="{index.paper.anchor}-{equation.number.lower()}"></a>({equation.number})'
    if equation.number in errata:
        number += f" [erratum]({errata[equation.number]})"
    code = _links(index.code.get(equation.number, []), _dotted)
    tests = _links(index.tests.get(equation.number, []), lambda place: place.name)
    where = code or (f"none needed: {equation.none}" if equation.none else "**missing**")
    return f"| {number} | {equation.states} | {where} | {tests} |\n"


def _dotted(place: Place) -> str:
    """module.function without the package: "frisch.parameters.mode_parameters"."""
    return ".".join([*Path(place.path).with_suffix("").parts[1:], place.name])


def _links(places: list[Place], label: Callable[[Place], str]) -> str:
    return "<br>".join(f"[`{label(place)}`](../{place.path})" for place in places)


def _errata(paper: Paper, root: Path) -> dict[str, str]:
    """Link to the first heading in a paper's part of the errata page that names an equation."""
    links: dict[str, str] = {}
    for heading in headings(errata_of(paper, root)):
        for number in numbers_in(heading):
            links.setdefault(number, f"{paper.errata}#{anchor(heading)}")
    return links


def errata_of(paper: Paper, root: Path = ROOT) -> str:
    """A paper's part of the errata page: from the heading of first rank that ends with its title to the next such."""
    text = (root / "docs" / paper.errata).read_text(encoding="utf-8")
    (part,) = (part for part in re.split(r"^# ", text, flags=re.MULTILINE) if part.split("\n")[0].endswith(paper.title))
    return f"# {part}"


def headings(text: str) -> list[str]:
    """Headings of a Markdown text, of every rank."""
    return re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)


def anchor(heading: str) -> str:
    """The fragment under which a Markdown heading is found."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def papers() -> list[Paper]:
    """All papers that have a data file."""
    return [load_paper(path) for path in sorted((ROOT / "docs" / "equations").glob("*.toml"))]


def main() -> None:
    """Write the page and say what is still wrong."""
    indices = [Index.of(paper) for paper in papers()]
    PAGE.write_text(page(indices), encoding="utf-8")
    for index in indices:
        for fault in index.faults():
            print(fault)


if __name__ == "__main__":
    main()
