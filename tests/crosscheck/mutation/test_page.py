"""docs/mutations.md has the catalogue as it is: a row for each mutation, fault and invariance, in order."""

from __future__ import annotations

from crosscheck.library.mutations import CATALOGUE
from crosscheck.mutation.answers import FAULTS
from crosscheck.mutation.invariances import INVARIANCES
from tests.repo.project import ROOT

PAGE = (ROOT / "docs" / "mutations.md").read_text(encoding="utf-8")


def test_the_page_has_every_row_and_no_other() -> None:
    expected = [f"| `{each.name}` | {each.what} | {each.slip} |" for each in (*CATALOGUE.values(), *FAULTS)]
    expected += [f"| `{each.name}` | {each.what} |" for each in INVARIANCES]
    assert [line for line in PAGE.splitlines() if line.startswith("| `")] == expected
