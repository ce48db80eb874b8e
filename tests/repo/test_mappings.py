"""The page of mappings of FMUs: its examples hold, its tables have every key, its schema is the present one."""

import json
import re
import tomllib
from pathlib import Path

import jsonschema
import msgspec

from crosscheck.engines.fmu.mapping import MappingFile, Read, Set, read_mapping
from tests.crosscheck.engines.fmu.foreign import MAPPING
from tests.repo.mappings import FILE, schema
from tests.repo.project import ROOT
from tests.repo.snippets import snippets

PAGE = ROOT / "docs" / "fmu-engine.md"


def test_the_schema_is_the_present_one_and_takes_the_examples(tmp_path: Path) -> None:
    assert FILE.read_text(encoding="utf-8") == schema(), "python -m tests.repo.mappings"
    examples = [snippet.code for snippet in snippets(PAGE) if snippet.language == "toml"]
    assert examples[-1].strip() == MAPPING.strip(), "the mapping that the tests run"
    for number, example in enumerate(examples):
        jsonschema.validate(tomllib.loads(example), json.loads(schema()))
        (tmp_path / f"{number}.toml").write_text(example, encoding="utf-8")
        assert read_mapping(tmp_path / f"{number}.toml").fmu
    with_error = tomllib.loads(examples[-1]) | {"chanels": {}}
    assert not jsonschema.Draft202012Validator(json.loads(schema())).is_valid(with_error)


def test_the_page_has_every_key() -> None:
    text = PAGE.read_text(encoding="utf-8")
    keys = re.findall(r"^\| `(\w+)` \|", text, flags=re.MULTILINE)
    assert set(keys) == {field.encode_name for field in msgspec.structs.fields(MappingFile)}
    entries = {field.encode_name for kind in (Read, Set) for field in msgspec.structs.fields(kind)}
    assert not [name for name in entries if f"`{name}`" not in text]
