"""The page of crosscheck-expect.toml: its example holds, its table has every key, its schema is the present one."""

import re
from pathlib import Path

import msgspec

from crosscheck.library.claims import claims_on
from crosscheck.library.expect_file import EffortsEntry, FailureEntry, GoalEntry, read_expect_file
from crosscheck.library.find import shipped_cases
from tests.repo.expectations import FILE, schema
from tests.repo.project import ROOT
from tests.repo.snippets import snippets

PAGE = ROOT / "docs" / "expectations.md"


def test_the_schema_is_the_present_one() -> None:
    assert FILE.read_text(encoding="utf-8") == schema(), "python -m tests.repo.expectations"


def test_the_example_means_cases_of_the_library(tmp_path: Path) -> None:
    (example,) = (snippet.code for snippet in snippets(PAGE) if snippet.language == "toml")
    file = tmp_path / "crosscheck-expect.toml"
    file.write_text(example, encoding="utf-8")
    tags = {case.name: case.run.tags for case in shipped_cases()}
    claims = claims_on(
        tuple(tags), {"f": read_expect_file(file)}, names=tuple(tags), tags=lambda: tags, engines=["mycode"]
    )
    assert claims["pendulums/compound"].goals and claims["pendulums/double"].efforts
    assert not claims["wheel_gyrostat/torque_free"].failures
    assert any(claim.failures for claim in claims.values())


def test_the_table_has_every_key() -> None:
    keys = set(re.findall(r"^\| [^|]+\| `(\w+)` \|", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE))
    fields = (field for entry in (GoalEntry, FailureEntry, EffortsEntry) for field in msgspec.structs.fields(entry))
    assert keys == {field.encode_name for field in fields}
