"""The table of `crosscheck verify`: a line for each channel of a CSV."""

from __future__ import annotations

from crosscheck.terminal.text import words
from crosscheck.verify.outcome import CsvOutcome
from flexmb.output.listing import Listing, figures, names, prose


def channels_table(checked: CsvOutcome) -> Listing:
    """Every channel of a CSV: how far off, with which uncertainty, when worst, and why, where there is a guess."""
    table = Listing(
        *names("channel", "status"), *figures("E", "U", "goal", "worst at, s"), *prose("it looks as if")
    )  # fmt: skip
    for verdict in checked.all:
        detail = checked.details.get(verdict.channel)
        numbers = ("" if value is None else f"{value:.2g}" for value in (verdict.E, verdict.U, verdict.goal))
        when, why = ("", "") if detail is None else (f"{detail.worst_s:.6g}", detail.cause)
        status = words(verdict.status, "green" if verdict.ok else "red")
        table.add(verdict.channel, status, *numbers, when, why)
    return table
