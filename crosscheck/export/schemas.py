"""JSON schemas of a case's files, of `results.json` and of `label.json`, from their structs. Write them with

    python -m crosscheck.export.schemas [FOLDER]

by default to `docs/schemas`. The schema of a scene is `docs/scene.schema.json` (`flexmb.scene.reference`).
"""

from __future__ import annotations

import json
import sys
from inspect import cleandoc
from pathlib import Path

import msgspec

from crosscheck.label.document import LabelFile
from crosscheck.library.accepted import Accepted
from crosscheck.library.case import Provenance, RunFile
from crosscheck.library.reference import Knowledge
from crosscheck.sealed.document import SealedResults
from flexmb.output.files import write_whole
from flexmb.scene.reference import json_schema

FOLDER = Path("docs") / "schemas"
DIALECT = "https://json-schema.org/draft/2020-12/schema"
SEAL = {"type": "string", "description": "Hex digest of the file without this key and the line end."}
FILES = {
    "run": (RunFile, "run.toml of a case"),
    "provenance": (Provenance, "provenance.toml of a case"),
    "reference": (Knowledge, "reference.toml of a case"),
    "accepted": (Accepted, "accepted.toml of a case"),
    "results": (SealedResults, "results.json of a session"),
    "label": (LabelFile, "label.json of a session"),
}
"""The schemas by name: the struct, and the file that it reads."""


def schema_text(name: str) -> str:
    """The JSON schema of one kind of file."""
    struct, what = FILES[name]
    schema = {"$schema": DIALECT, "title": what} | msgspec.json.schema(struct)
    for part in schema.get("$defs", {}).values():
        if "description" in part:  # a docstring, whose indentation is removed by Python 3.13 only
            part["description"] = cleandoc(part["description"])
    if struct in (SealedResults, LabelFile):  # the seal is set on the encoded file, and is no field of the struct
        schema["$defs"][struct.__name__]["properties"]["sha256"] = SEAL
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def schema_files() -> dict[str, str]:
    """Every schema by the name of its file, that of a scene included."""
    return {f"{name}.schema.json": schema_text(name) for name in FILES} | {"scene.schema.json": json_schema()}


def write(folder: Path) -> None:
    """Write the schemas; that of a scene has a place of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in FILES:
        write_whole(folder / f"{name}.schema.json", schema_text(name))


if __name__ == "__main__":
    write(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
