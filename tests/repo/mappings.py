"""Writes `docs/fmu-mapping.schema.json`, by `python -m tests.repo.mappings`."""

import json

import msgspec

from crosscheck.engines.fmu.mapping import MappingFile
from tests.repo.project import ROOT

FILE = ROOT / "docs" / "fmu-mapping.schema.json"


def schema() -> str:
    """The text of the file."""
    found = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "a mapping of an FMU"}
    return json.dumps(found | msgspec.json.schema(MappingFile), indent=1) + "\n"


if __name__ == "__main__":
    FILE.write_text(schema(), encoding="utf-8")
