"""Text from files and from other people's code on its way to a terminal, a report or a chart."""

from __future__ import annotations


def printable(text: str) -> str:
    """`text` with whatever does not print (escape sequences, changes of direction, lone surrogates) written out.

    Line breaks stay.
    """
    if text.isprintable():
        return text
    shown = (c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode("ascii") for c in text)
    return "".join(shown)


def chart_text(text: str) -> str:
    """`text` as matplotlib shows it: dollars are no formula, and a legend leaves out nothing."""
    shown = printable(text).replace("$", r"\$")
    return f" {shown}" if shown.startswith("_") else shown
