"""The archive as files: the same bytes twice, checksums, a folder that is not empty, all that a case has, schemas."""

import csv
import hashlib
import json
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from crosscheck.cli import app
from crosscheck.export.archive import SUMS, archive, case_files, uncertainty_text, write_archive
from crosscheck.export.metadata import cite
from crosscheck.export.model import model_data
from crosscheck.export.schemas import FILES, FOLDER, schema_files, schema_text
from crosscheck.library.case_error import CaseError
from crosscheck.library.find import Case, load_case, resolve, shipped_folder
from crosscheck.library.reference import load_reference, parse_values
from tests.crosscheck.export.exported import scene_of
from tests.crosscheck.sessions import CASE, run_case, shipped
from tests.repo.project import ROOT

SOME = ("pendulums/double", "flexible_mechanisms/double_pendulum")


def cases(*names: str) -> list[Case]:
    return [load_case(shipped_folder() / name) for name in names]


def contents(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_the_same_cases_give_the_same_bytes_and_their_checksums_hold(tmp_path: Path) -> None:
    for folder in ("one", "two"):
        write_archive(archive(cases(*SOME)), tmp_path / folder)
    one, two = (contents(tmp_path / folder) for folder in ("one", "two"))
    assert one == two
    sums = dict(line.split("  ", 1)[::-1] for line in one.pop(SUMS).decode().splitlines())
    assert sums == {name: hashlib.sha256(content).hexdigest() for name, content in one.items()}


def test_a_folder_that_is_not_empty_is_refused_and_stays(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    done = CliRunner().invoke(app, ["export", SOME[0], "--out", str(tmp_path)])
    assert done.exit_code == 2 and "name a new one" in done.output
    assert [each.name for each in tmp_path.iterdir()] == ["mine"]


def test_the_command_writes_what_a_pattern_names(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["export", "sliders/*", "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    found = {str(file.parent.relative_to(tmp_path / "out")) for file in (tmp_path / "out").rglob("model.json")}
    assert found == {case.name for case in shipped() if case.name.startswith("sliders/")}


def test_patterns_name_cases_everywhere() -> None:
    assert [case.name for case in resolve(("tops/*e*",))] == [
        case.name for case in shipped() if case.name.startswith("tops/") and "e" in case.name[5:]
    ]
    with pytest.raises(CaseError, match="a pattern of names that no case has"):
        resolve(("nothing/*",))


def test_every_case_of_the_library_can_be_exported() -> None:
    for case in shipped():
        data, modal = model_data(scene_of(case.name))
        json.dumps([data, modal], allow_nan=False)
        assert len(data["bodies"]) == len(data["joints"]) and cite(case).startswith("The flexmb authors")


def test_the_reference_comes_back_with_its_error_bars() -> None:
    (case,) = cases(SOME[1])
    files, _ = case_files(case)
    stored = load_reference(case.folder)
    times, channels = parse_values(files["reference.csv"], "here")
    assert np.array_equal(times, stored.times)
    assert all(np.array_equal(channels[name], stored.channels[name]) for name in stored.channels)
    rows = list(csv.DictReader(files["uncertainty.csv"].splitlines()))
    assert {row["channel"]: float(row["uncertainty"]) for row in rows} == {
        name: known.uncertainty for name, known in stored.knowledge.channels.items()
    }
    assert uncertainty_text(stored) == files["uncertainty.csv"]
    assert all(row["unit"] and row["how"] for row in rows)


def test_metadata_are_what_archives_read() -> None:
    texts = archive(cases(*SOME))
    datacite, zenodo = json.loads(texts["datacite.json"]), json.loads(texts[".zenodo.json"])
    assert {"creators", "titles", "publisher", "publicationYear", "types", "version"} <= datacite.keys()
    assert datacite["rightsList"][0]["rightsIdentifier"] == "CC-BY-4.0" and zenodo["license"] == "cc-by-4.0"
    citation = yaml.safe_load(texts["CITATION.cff"])
    assert citation["type"] == "dataset" and citation["version"] == datacite["version"] == zenodo["version"]
    assert "Attribution 4.0 International" in texts["LICENSE"]
    shinbrot = "Chaos in a double pendulum"
    assert any(shinbrot in each["titles"][0]["title"] for each in datacite["relatedItems"])
    assert shinbrot in texts["pendulums/double/README.md"] and "CC-BY-4.0" in texts["pendulums/double/README.md"]


def test_a_stale_reference_is_not_exported(tmp_path: Path) -> None:
    folder = tmp_path / "pendulums" / "double"
    folder.mkdir(parents=True)
    for file in (shipped_folder() / "pendulums" / "double").iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    scene = (folder / "scene.toml").read_text(encoding="utf-8").replace("mass_kg = 1.0", "mass_kg = 1.1", 1)
    (folder / "scene.toml").write_text(scene, encoding="utf-8")
    with pytest.raises(CaseError, match="changed after the reference was made"):
        case_files(load_case(folder))


def test_levels_that_the_data_cannot_say_are_refused() -> None:
    from msgspec.structs import replace

    scene = scene_of("wheel_gyrostat/flexible_appendage")
    bodies = tuple(replace(body, level="ruthless") if hasattr(body, "points") else body for body in scene.bodies)
    with pytest.raises(CaseError, match="truncated mass matrix"):
        model_data(replace(scene, bodies=bodies))


def test_beams_of_level_exact_are_as_in_the_scene() -> None:
    data, modal = model_data(scene_of("frames/right_angle"))
    assert not modal
    assert [(body["name"], body["kind"]) for body in data["bodies"]] == [("leg", "beam"), ("arm", "beam")]
    assert [beam["level"] for beam in data["beams"]] == ["exact", "exact"]
    assert data["beams"][0]["stations"][1]["x_m"] == 0.24


def test_the_page_in_docs_has_the_keys_that_every_release_has() -> None:
    from importlib.resources import files

    from tests.repo.project import ROOT

    keys = files("crosscheck.export").joinpath("keys.md").read_text(encoding="utf-8")
    assert keys in (ROOT / "docs" / "export.md").read_text(encoding="utf-8")


OF_SCENES = ("beams", "closures", "connectors", "sensors", "controllers", "events")  # their keys are a scene's
BY_NAME = ("nodes", "modal_states")  # their keys are names


def keys_in(data: object) -> set[str]:
    """The keys of exported data, but for those that are names."""
    match data:
        case dict():
            own = {key for key in data if isinstance(key, str)}
            inner = (keys_in(list(each.values()) if key in BY_NAME else each) for key, each in data.items())
            return own.union(*inner)
        case list() | tuple():
            return set().union(*map(keys_in, data)) if data and isinstance(data[0], dict) else set()
    return set()


def test_every_key_is_explained() -> None:
    from tests.repo.project import ROOT

    page = (ROOT / "docs" / "export.md").read_text(encoding="utf-8")
    found: set[str] = set()
    for case in shipped():
        data, modal = model_data(scene_of(case.name))
        own = {key: each for key, each in data.items() if key not in OF_SCENES}
        found |= keys_in(own).union(*map(keys_in, modal.values()))
    assert len(found) > 60
    assert not sorted(key for key in found if f"`{key}`" not in page and f".{key}`" not in page)


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
    file = next(file for file, case in OF_CASES.items() if case == name)
    content = _read(next(case.folder / file for case in shipped() if (case.folder / file).exists()))
    with pytest.raises(jsonschema.ValidationError, match=what):
        validator(name).validate(content | wrong)


def _read(file: Path) -> Any:
    return json.loads(json.dumps(tomllib.loads(file.read_text(encoding="utf-8"))))
