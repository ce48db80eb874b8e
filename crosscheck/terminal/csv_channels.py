"""The table of `crosscheck verify`: a line for each channel of a CSV."""

from __future__ import annotations

from rich.table import Table

from crosscheck.terminal.text import words
from crosscheck.verify.against_case import CsvOutcome


def channels_table(checked: CsvOutcome) -> Table:
    """Every channel of a CSV: how far off, with which uncertainty, when worst, and why, where there is a guess."""
    table = Table("channel", "status", "E", "U", "goal", "worst at, s", "it looks as if", header_style="bold")
    for verdict in checked.all:
        detail = checked.details.get(verdict.channel)
        numbers = ("" if value is None else f"{value:.2g}" for value in (verdict.E, verdict.U, verdict.goal))
        when, why = ("", "") if detail is None else (f"{detail.worst_s:.6g}", detail.cause)
        status = words(verdict.status, "green" if verdict.ok else "red")
        table.add_row(words(verdict.channel), status, *numbers, when, words(why))
    return table
