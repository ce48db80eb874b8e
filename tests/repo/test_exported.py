"""The table of docs/export-fmu.md against the case library."""

import pytest

from crosscheck.library.find import shipped_cases
from tests.repo import exported


def test_every_case_has_a_line() -> None:
    lines = exported.PAGE.read_text(encoding="utf-8").splitlines()
    for case in shipped_cases():
        assert sum(line.startswith(f"| `{case.name}` |") for line in lines) == 1, "run `python -m tests.repo.exported`"


@pytest.mark.parametrize("name", ["wheels/spin_up", "closed_chains/four_bar", "wheels/desaturation"])
def test_lines_are_what_the_generator_writes(name: str) -> None:
    found = {case.name: case for case in shipped_cases()}
    assert exported.row(found[name]) in exported.PAGE.read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_table_is_what_the_generator_writes() -> None:
    lines = "".join(f"{line}\n" for line in exported.table())
    assert exported.page(lines) == exported.PAGE.read_text(encoding="utf-8"), "run `python -m tests.repo.exported`"
