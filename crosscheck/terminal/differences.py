"""Differences of two sessions on the terminal."""

from __future__ import annotations

from rich.console import Console

from crosscheck.sealed.compare import Differences, Direction, ResultChange
from crosscheck.terminal.text import marked, words
from crosscheck.terminal.verbosity import Verbosity

MARKS: dict[Direction, tuple[str, str]] = {
    "worse": ("✕", "red"), "gone": ("–", "red"), "better": ("✓", "green"), "new": ("+", "cyan"),
}  # fmt: skip
LINES = 8  # of changes, without --verbose
FEW_LINES = 3  # of times and of notes


def print_differences(console: Console, differences: Differences, verbosity: Verbosity) -> None:
    """The changes, the gravest first; notes and times after them; the headline last."""
    if verbosity is not Verbosity.QUIET:
        everything = verbosity is Verbosity.VERBOSE
        changes = [marked(*MARKS[change.direction], _told(change)) for change in differences.changes]
        times = [
            words(f"time: {each.case}, {each.what}: {each.before_s:.3g} s -> {each.now_s:.3g} s")
            for each in differences.times
        ]
        notes = [words(f"note: {note}", "dim") for note in differences.notes]
        kinds = (changes, LINES, "changes"), (times, FEW_LINES, "times"), (notes, FEW_LINES, "notes")
        for lines, limit, what in kinds:
            shown = lines if everything else lines[:limit]
            for line in shown:
                console.print(line, soft_wrap=True)
            if len(shown) < len(lines):
                console.print(words(f"... and {len(lines) - len(shown)} {what} more: --verbose shows all", "dim"))
    colour = "red" if differences.regressed else "green"
    console.print(words(differences.headline, f"bold {colour}"), soft_wrap=True)


def _told(change: ResultChange) -> str:
    where = ", ".join(part for part in (change.case, change.comparison, change.what) if part)
    return f"{change.direction}: {where}: {change.how}"
