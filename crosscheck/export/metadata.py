"""What archives and citation managers read of a release: CITATION.cff, DataCite, Zenodo; the DOI is theirs."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from crosscheck.export.formats.written import Written
from crosscheck.library.basis import basis
from crosscheck.library.find import Case
from crosscheck.library.reference import StoredReference
from flexmb.output.versions import version_of

KEYWORDS = ("multibody dynamics", "flexible bodies", "benchmark", "verification", "reference solution")
ABOUT = (
    "Motions of rigid and flexible multibody systems with a bound on the error of every channel, and the data from "
    "which their equations of motion are rebuilt without any code of ours."
)


def citation_cff() -> str:
    """CITATION.cff of the data."""
    lines = [
        "cff-version: 1.2.0", "message: Cite the data as below, and each case by its own line.",
        f"title: '{COLLECTION}'", "type: dataset",
        f"version: {version_of('flexmb')}", f"license: {LICENCE}", "authors:", f"  - name: {AUTHORS}",
        f"date-released: '{YEAR}-01-01'", f"abstract: '{ABOUT}'", "keywords:", *(f"  - {word}" for word in KEYWORDS),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def datacite(cases: Sequence[Case]) -> str:
    """DataCite metadata 4.5 as JSON, without the identifier that the archive assigns."""
    content: dict[str, Any] = {
        "schemaVersion": "http://datacite.org/schema/kernel-4",
        "types": {"resourceTypeGeneral": "Dataset", "resourceType": "Reference solutions"},
        "titles": [{"title": COLLECTION}],
        "creators": [{"name": AUTHORS, "nameType": "Organizational"}],
        "publisher": {"name": AUTHORS},
        "publicationYear": str(YEAR),
        "version": version_of("flexmb"),
        "language": "en",
        "subjects": [{"subject": word} for word in KEYWORDS],
        "rightsList": [{
            "rights": "Creative Commons Attribution 4.0 International", "rightsUri": LICENCE_URL,
            "rightsIdentifier": LICENCE, "rightsIdentifierScheme": "SPDX",
        }],
        "descriptions": [{"description": ABOUT, "descriptionType": "Abstract"}],
        "formats": ["application/json", "text/csv", "application/toml", "application/xml"],
        "relatedItems": [
            {"relatedItemType": "Text", "relationType": "IsDerivedFrom", "titles": [{"title": source}]}
            for source in sources_of(cases)
        ],
    }  # fmt: skip
    return _json(content)


def zenodo(cases: Sequence[Case]) -> str:
    """`.zenodo.json`, from which Zenodo fills in its form."""
    return _json({
        "title": COLLECTION, "upload_type": "dataset", "description": ABOUT, "version": version_of("flexmb"),
        "creators": [{"name": AUTHORS}], "license": LICENCE.lower(), "access_right": "open", "keywords": list(KEYWORDS),
        "references": sources_of(cases),
    })  # fmt: skip


def sources_of(cases: Sequence[Case]) -> list[str]:
    """Every source that a case names, once, in the order of the cases."""
    named = (source for case in cases if case.provenance is not None for source in case.provenance.sources)
    return list(dict.fromkeys(" ".join(source.split()) for source in named))


def _json(content: Any) -> str:
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


YEAR = 2026  # of this version
AUTHORS = "The flexmb authors"
COLLECTION = "flexmb cases: reference motions of rigid and flexible multibody systems with error bars"
LICENCE, LICENCE_URL = "CC-BY-4.0", "https://creativecommons.org/licenses/by/4.0/"


def cite(case: Case) -> str:
    """The line with which a publication cites the case, and the sources that its data or its reference come from."""
    sources = case.provenance.sources if case.provenance is not None else ()
    version = version_of("flexmb")
    own = f"{AUTHORS} ({YEAR}). {case.run.title} [case {case.name}]. In: {COLLECTION}, version {version}. {LICENCE}."
    return f"{own} After: {'; '.join(' '.join(source.split()) for source in sources)}." if sources else own


# The README of a release and of each case in it.

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
