"""The scripts and the notebook of `examples/` run, their checks hold, and each writes the picture of the page."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.repo.examples import FOLDER, PICTURES, Example, examples

LARGEST = 100_000  # bytes of a picture


@pytest.mark.parametrize("example", examples(), ids=lambda example: example.file.stem)
def test_an_example_runs_draws_and_says_what_it_found(
    example: Example, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A number, and at the end the files that it has written."""
    example.run(tmp_path)
    said = capsys.readouterr().out
    assert (tmp_path / example.picture).stat().st_size > 1000
    last = said.splitlines()[-1].rpartition("wrote ")[2]
    assert set(last.replace(" and ", " ").split()) == {file.name for file in tmp_path.iterdir()}
    assert re.search(r"\d", said.replace(last, ""))


@pytest.mark.parametrize("example", examples(), ids=lambda example: example.file.stem)
def test_an_example_has_one_idea_and_ends_with_its_check(example: Example) -> None:
    """Of length and form: a title, a few lines that say what is shown, and an assertion at the end."""
    assert 0 < len(example.title) < 60 and 80 < len(example.text) < 500
    assert "\nassert " in example.code[-1] or example.code[-1].startswith("assert ")
    lines = [line for code in example.code for line in code.splitlines() if line.strip()]
    assert len(lines) <= 80 and max(len(line) for line in lines) <= 120


def test_pictures_are_those_of_the_examples_and_small() -> None:
    kept = {file.name: file.stat().st_size for file in PICTURES.iterdir()}
    assert set(kept) == {example.picture for example in examples()}
    assert not {name: size for name, size in kept.items() if size > LARGEST}


def test_a_check_that_fails_is_noticed(tmp_path: Path) -> None:
    first = examples()[0]
    wrong = tmp_path / first.file.name
    wrong.write_text(first.file.read_text(encoding="utf-8").replace("1.5 * 9.81", "1.6 * 9.81"), encoding="utf-8")
    with pytest.raises(AssertionError):
        first._replace(file=wrong).run(tmp_path)


def test_the_folder_has_nothing_else() -> None:
    """What is no example is the look of the pictures and a page that says how to run them."""
    others = {file.name for file in FOLDER.iterdir()} - {example.file.name for example in examples()}
    assert others - {"__pycache__"} == {"matplotlibrc", "README.md"}
