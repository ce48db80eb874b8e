"""Text that is shown literally on the terminal, and how much of it."""

from __future__ import annotations

from enum import Enum

from rich.text import Text

from flexmb.output.printable import printable


class Verbosity(Enum):
    """QUIET: the last line, and errors; NORMAL: some ten lines; VERBOSE: every comparison and every run."""

    QUIET = 0
    NORMAL = 1
    VERBOSE = 2


def words(text: str, style: str = "") -> Text:
    """Literal text: only rich's `Text` interprets no markup and emoji."""
    return Text(printable(text), style)


def marked(mark: str, style: str, text: str) -> Text:
    """A coloured sign, and text."""
    return Text.assemble((mark, style), " ", words(text))
