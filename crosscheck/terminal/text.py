"""Text that is shown literally on the terminal."""

from __future__ import annotations

from rich.text import Text

from flexmb.output.printable import printable


def words(text: str, style: str = "") -> Text:
    """Literal text: only rich's `Text` interprets no markup and emoji."""
    return Text(printable(text), style)


def marked(mark: str, style: str, text: str) -> Text:
    """A coloured sign, and text."""
    return Text.assemble((mark, style), " ", words(text))
