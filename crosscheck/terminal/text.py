"""Text for the terminal, shown literally whatever it contains."""

from __future__ import annotations

from rich.text import Text

from flexmb.output.printable import printable


def words(text: str, style: str = "") -> Text:
    """Text shown literally, with brackets and colons: only `Text` is safe from rich's markup and emoji."""
    return Text(printable(text), style)


def marked(mark: str, style: str, text: str) -> Text:
    """A coloured sign, and text."""
    return Text.assemble((mark, style), " ", words(text))
