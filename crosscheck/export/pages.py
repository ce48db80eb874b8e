"""The README of a release and of each case in it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from importlib.resources import files

from crosscheck.export.formats.written import Written
from crosscheck.export.metadata import COLLECTION, LICENCE, cite
from crosscheck.library.basis import basis
from crosscheck.library.find import Case
from crosscheck.library.reference import StoredReference

PROGRAMS = {"urdf": "URDF", "mjcf": "MJCF (MuJoCo)", "exudyn": "Exudyn"}


def case_page(
    case: Case, reference: StoredReference, others: Mapping[str, Written], names: Mapping[str, str]
) -> str:
    """README.md of a case: what it is, its files, how well it is known, how it is cited."""
    known = reference.knowledge
    text = re.sub(r"\A# .*\n", "", case.readme)
    text = re.sub(r"^!\[.*?\]\(.*?\)\n*", "", text, flags=re.M | re.S)  # pictures are not part of a release
    uncertainty = case.provenance.uncertainty if case.provenance is not None else "see uncertainty.csv"
    parts = [
        f"# {case.run.title}",
        f"Case `{case.name}`, variant `{known.variant}`, {known.horizon_s:g} s.",
        text.strip(),
        "## Files",
        "\n".join(_files(others, names)),
        "## How well it is known",
        f"The reference rests on: {basis(known.routes).words}. {uncertainty}",
        "\n".join(f"- {route}" for route in known.routes),
        f"Made with {', '.join(known.made_with)}. `uncertainty.csv` bounds the error of every sample of each channel.",
        "## Cite",
        cite(case),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _files(others: Mapping[str, Written], names: Mapping[str, str]) -> list[str]:
    lines = [
        "- `model.json`, and `modal/*.json` for flexible bodies: the equations of motion as data",
        "- `reference.csv`: the motion, SI, World axes, a unit in every header",
        "- `uncertainty.csv`: the error bar of each channel",
    ]
    for kind, written in others.items():
        if written.text:
            beside = f"; not in it: {'; '.join(written.left_out)}" if written.left_out else ""
            lines.append(f"- `{names[kind]}`: the tree as {PROGRAMS[kind]}{beside}")
        else:
            lines.append(f"- no {PROGRAMS[kind]}: {written.refused}")
    return lines


def collection_page(rows: Sequence[tuple[Case, Mapping[str, Written]]]) -> str:
    """README.md of the release: what each key means, and a table of the cases."""
    keys = files("crosscheck.export").joinpath("keys.md").read_text(encoding="utf-8")
    table = ["| case | what | " + " | ".join(PROGRAMS.values()) + " |", "|---|---|" + "---|" * len(PROGRAMS)]
    for case, others in rows:
        marks = " | ".join("yes" if others[kind].text else "" for kind in PROGRAMS)
        table.append(f"| [{case.name}]({case.name}/README.md) | {case.run.title} | {marks} |")
    licence = f"The data are licensed under {LICENCE} (`LICENSE`). Each case says how it is cited."
    return "\n\n".join([f"# {COLLECTION}", licence, keys.strip(), "## Cases", "\n".join(table)]) + "\n"
