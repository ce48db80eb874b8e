"""The JSON schemas are those of the structs, and hold for every file of the library and for a results.json."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from crosscheck.export.schemas import FILES, FOLDER, schema_files, schema_text
from tests.crosscheck.sessions import CASE, run_case, shipped
from tests.repo.project import ROOT

OF_CASES = {f"{name}.toml": name for name in ("run", "provenance", "reference", "accepted")}


def validator(name: str) -> jsonschema.protocols.Validator:
    schema = json.loads(schema_files()[f"{name}.schema.json"])
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.mark.parametrize("name", FILES)
def test_the_files_in_docs_are_up_to_date(name: str) -> None:
    """Write them with `python -m crosscheck.export.schemas`."""
    assert (ROOT / FOLDER / f"{name}.schema.json").read_text(encoding="utf-8") == schema_text(name)


@pytest.mark.parametrize("file, name", OF_CASES.items())
def test_every_file_of_a_case_fits_its_schema(file: str, name: str) -> None:
    found, check = 0, validator(name)
    for case in shipped():
        if (case.folder / file).exists():
            found += 1
            check.validate(_read(case.folder / file))
    assert found > 0.9 * len(shipped())


def test_every_scene_fits_its_schema() -> None:
    check = validator("scene")
    for case in shipped():
        for scene in sorted({variant.scene for variant in case.run.variants}):
            check.validate(_read(case.folder / scene))


def test_results_fit_their_schema(tmp_path: Path) -> None:
    from crosscheck.judging.outcome import SessionOutcome
    from crosscheck.judging.results import collect
    from crosscheck.records.archive import read
    from crosscheck.sealed.document import results_of
    from crosscheck.sealed.seal import sealed_text

    records = tmp_path / "records.jsonl"
    outcome: SessionOutcome = run_case(CASE, records)
    content = json.loads(sealed_text(results_of(collect(read(records)), outcome, records)))
    check = validator("results")
    check.validate(content)
    with pytest.raises(jsonschema.ValidationError, match="'broken'"):
        check.validate(content | {"broken": "none"})


@pytest.mark.parametrize("name, wrong, what", [
    ("run", {"titel": "x"}, "titel"),
    ("provenance", {"reference": "a guess"}, "a guess"),
    ("reference", {"horizon_s": "long"}, "long"),
    ("accepted", {"a comparison": {"a | b": {"E": 1.0, "V": 2.0}}}, "V"),
])  # fmt: skip
def test_a_wrong_file_does_not_fit(name: str, wrong: dict[str, Any], what: str) -> None:
    file = next(file for file, each in OF_CASES.items() if each == name)
    content = _read(next(case.folder / file for case in shipped() if (case.folder / file).exists()))
    with pytest.raises(jsonschema.ValidationError, match=what):
        validator(name).validate(content | wrong)


def _read(file: Path) -> Any:
    return json.loads(json.dumps(tomllib.loads(file.read_text(encoding="utf-8"))))
