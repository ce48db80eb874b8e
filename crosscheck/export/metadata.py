"""What archives and citation managers read of a release: CITATION.cff, DataCite, Zenodo; the DOI is theirs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from crosscheck.library.find import Case
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
