"""Tables keep names and figures whole, fold sentences between words, and go below each other where there is no room."""

from __future__ import annotations

import io

import pytest
from rich.console import Console
from rich.text import Text

from flexmb.output.listing import Listing, figures, names, prose
from flexmb.output.terminal import Terminal

NAME = "a/name_of_thirty_three_characters"
SENTENCE = "the quick brown fox jumps over the lazy dog"


def table() -> Listing:
    listing = Listing(*names("case"), *prose("title"), *figures("figures"), title="All", caption="No more.")
    listing.add(NAME, SENTENCE, "12")
    listing.add("b", "short", "-1.25e-10")
    return listing


def lines(width: int, listing: Listing | None = None) -> list[str]:
    console = Console(file=io.StringIO(), width=width, legacy_windows=False)
    console.print(listing or table(), crop=False)
    return console.file.getvalue().splitlines()


def test_where_there_is_room_every_row_is_a_line() -> None:
    assert lines(100) == [
        "All",
        f"{'case':33}  {'title':43}    figures",
        f"{'─' * 33}  {'─' * 43}  {'─' * 9}",
        f"{NAME}  {SENTENCE}         12",
        f"{'b':33}  {'short':43}  -1.25e-10",
        "No more.",
    ]


def test_where_there_is_less_sentences_are_folded() -> None:
    narrow = lines(66)
    assert max(map(len, narrow)) <= 66
    assert narrow[3:6] == [
        f"{NAME}  {'the quick brown fox':20}         12",
        f"{'':33}  jumps over the lazy",
        f"{'':33}  dog",
    ]


def test_where_there_is_none_the_cells_are_below_the_name() -> None:
    assert lines(30) == [
        "All",
        NAME,
        "  title: the quick brown fox",
        "  jumps over the lazy dog",
        "  figures: 12",
        "b",
        "  title: short",
        "  figures: -1.25e-10",
        "No more.",
    ]


@pytest.mark.parametrize("width", range(1, 120))
def test_no_word_is_ever_broken(width: int) -> None:
    found = lines(width)
    assert set(f"{NAME} {SENTENCE} 12 b short -1.25e-10".split()) <= set(" ".join(found).split())


def test_wide_characters_count_twice_and_line_breaks_not_at_all() -> None:
    listing = Listing(*names("", ""))
    listing.add("二本", "x")
    listing.add("abcd\nef", Text("y\nz", "red"))
    assert lines(40, listing) == ["二本     x", "abcd ef  y z"]


def test_an_empty_table_is_its_head() -> None:
    assert lines(40, Listing(*names("case"), *prose("title"))) == ["case  title", "────  ─────"]


def test_a_row_of_another_length_is_an_error() -> None:
    with pytest.raises(ValueError, match="a row of 1 cells in a table of 3 columns"):
        table().add("alone")


def test_a_pipe_has_no_columns(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("COLUMNS", "20")
    monkeypatch.setenv("FORCE_COLOR", "1")  # as jobs of continuous integration set it: colours, but no screen
    console = Terminal()
    console.print(Text(SENTENCE * 10), table())
    out = capsys.readouterr().out
    assert SENTENCE * 10 in out and f"{NAME}\x1b[0m  {SENTENCE}" in out or f"{NAME}  {SENTENCE}" in out
