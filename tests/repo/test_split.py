"""The table of how long `.ci/run` takes has its place on the page, and what is written there is what was measured."""

import pytest

from tests.repo.project import spliced
from tests.repo.split import PAGE, START, table

LINES = ["installation of the sources\t216", "tests of the sources\t102"]


def test_the_page_takes_the_table() -> None:
    made = table(LINES, "102 kernels, 6.7 MiB, in 200 s", "2")
    page = spliced(PAGE.read_text(encoding="utf-8"), START, made)
    assert made in page and "| in all | 318 |" in page and "(102 kernels, 6.7 MiB, in 200 s of installing)" in page
    assert spliced(page, START, made) == page


def test_a_page_without_its_place_is_refused() -> None:
    with pytest.raises(ValueError, match="no place"):
        spliced("no table here", START, "one")
