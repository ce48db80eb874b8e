"""docs/cases.md: every shipped case, who runs it, what anchors it, and how well its numbers are known;
docs/library: a page of what its cases show for each folder of them. Write them with

python -m tests.repo.catalogue
"""

import re
from collections.abc import Iterator
from pathlib import Path

from crosscheck.export.metadata import cite
from crosscheck.library.basis import basis
from crosscheck.library.find import Case, shipped_cases
from crosscheck.library.reference import has_reference, load_reference
from tests.repo.holders import words
from tests.repo.project import ROOT

PAGE = ROOT / "docs" / "cases.md"
FOLDER = ROOT / "docs" / "library"
FAMILIES = {
    "closed_form": "Closed form: a formula gives the motion or a part of it.",
    "published": "Published: numbers of a paper or a benchmark.",
    "agreed": "Agreed: independent codes agree, or a code and equations of the case's own.",
    "converged": "Native alone: two formulations with two integrators of this library agree.",
}
INTRODUCTION = """# Cases

Every case with what anchors it. This page is generated from the folders in `cases`: `python -m tests.repo.catalogue`.
`crosscheck run NAME` runs a case, `crosscheck verify NAME my.csv` holds your own code's results against it.

```{toctree}
:hidden:
:glob:

library/*
```

*Rests on* is read from the stored routes: the closed form and the codes that agree, or native alone with its
formulations.
*Held* says for every channel that native gives in a variant which other codes agree with it, by the accepted figures
and the routes of the reference; a number is that of the channels of a kind.
*Known to* is the least and the largest uncertainty of the stored numbers, relative to each channel's range.

The data are licensed under CC BY 4.0 (`cases/LICENSE`); *Cite* is how a case is cited. `crosscheck export
cases` writes them for those who use other programs: [the library without our code](export.md).
"""


def page() -> str:
    """The text of docs/cases.md."""
    cases = shipped_cases()
    parts = [INTRODUCTION]
    for family, meaning in FAMILIES.items():
        members = [case for case in cases if case.provenance is not None and case.provenance.family == family]
        rows = [_row(case) for case in members]
        head = ["| case | what | engines | rests on | known to |", "|---|---|---|---|---|"]
        name, _, text = meaning.partition(": ")
        parts += [f"## {name}\n\n{text[0].upper()}{text[1:]}\n", "\n".join([*head, *rows]) + "\n"]
    return "\n".join(parts)


def pages() -> dict[Path, str]:
    """The pages of the folders of cases, by their paths."""
    folders = dict[str, list[Case]]()
    for case in shipped_cases():
        folders.setdefault(_folder(case), []).append(case)
    return {
        FOLDER / f"{folder}.md": "\n".join([_head(folder), *(part for case in cases for part in _section(case))])
        for folder, cases in folders.items()
    }


def _folder(case: Case) -> str:
    return case.name.partition("/")[0]


def _head(folder: str) -> str:
    title = folder.replace("_", " ").capitalize()
    return f"# {title}\n\nThe cases of `cases/{folder}`, see [all cases](../cases.md).\n"


def _row(case: Case) -> str:
    engines = dict.fromkeys(engine for variant in case.run.variants for engine in variant.engines)
    link = f"[{case.name}](library/{_folder(case)}.md#{_anchor(case.name)})"
    return f"| {link} | {case.run.title} | {', '.join(engines)} | {_basis(case)} | {_known(case)} |"


def _basis(case: Case) -> str:
    """What the stored reference rests on."""
    return basis(load_reference(case.folder).knowledge.routes).words if has_reference(case.folder) else "–"


def _known(case: Case) -> str:
    """Least and largest relative uncertainty of the stored channels."""
    if not has_reference(case.folder):
        return "–"
    channels = load_reference(case.folder).knowledge.channels.values()
    known = [channel.uncertainty / channel.scale for channel in channels if channel.scale > 0.0]
    return f"{min(known):.0e} to {max(known):.0e}" if known else "–"


def _anchor(name: str) -> str:
    """The anchor of a heading as pages make it."""
    return re.sub(r"[^\w-]", "", name.lower().replace(" ", "-"))


def _section(case: Case) -> Iterator[str]:
    """The case's own page, its headings one level down, its picture from the case's folder."""
    assert case.provenance is not None
    text = re.sub(r"\A# .*\n", "", case.readme)
    text = re.sub(r"^(#+) ", r"#\1 ", text, flags=re.M)
    text = re.sub(r"\]\((?!https?:|#)([^)]+)\)", rf"](../../cases/{case.name}/\1)", text)
    yield f"## {case.name}\n"
    known = case.provenance.uncertainty.rstrip(".")
    yield f"**{case.run.title}.** Tags: {', '.join(case.run.tags) or 'none'}. Known: {known}.\n"
    yield f"{text.strip()}\n"
    yield f"Rests on: {_basis(case)}. Sources: {'; '.join(case.provenance.sources)}\n"
    if held := "\n".join(words(case)):
        yield f"Held, by variant:\n\n{held}\n"
    yield f"Cite: {cite(case)}\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    FOLDER.mkdir(exist_ok=True)
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")
