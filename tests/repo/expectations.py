"""Writes `docs/crosscheck-expect.schema.json`, by `python -m tests.repo.expectations`."""

import json

import msgspec

from crosscheck.library.expect_file import ExpectFile
from tests.repo.project import ROOT

FILE = ROOT / "docs" / "crosscheck-expect.schema.json"


def schema() -> str:
    """The text of the file."""
    found = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "crosscheck-expect.toml"}
    return json.dumps(found | msgspec.json.schema(ExpectFile), indent=1) + "\n"


if __name__ == "__main__":
    FILE.write_text(schema(), encoding="utf-8")
