"""Text from files and other code made safe for a terminal, a report or a chart."""

from __future__ import annotations


def printable(text: str) -> str:
    """`text` with unprintable characters (escape sequences, changes of direction, lone surrogates) as escapes.

    Line breaks are kept.
    """
    if text.isprintable():
        return text
    shown = (c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode("ascii") for c in text)
    return "".join(shown)


def chart_text(text: str) -> str:
    """`text` escaped for matplotlib, which reads dollars as formulas and hides legend entries that begin with "_"."""
    shown = printable(text).replace("$", r"\$")
    return f" {shown}" if shown.startswith("_") else shown
