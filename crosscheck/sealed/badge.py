"""A badge of the outcome: a file for endpoints of shields.io, and a picture that needs no server."""

from __future__ import annotations

import json
from pathlib import Path
from xml.sax.saxutils import escape

from crosscheck.judging.outcome import SessionOutcome
from flexmb.output.files import write_whole

LABEL = "crosscheck"
COLOURS = {"brightgreen": "#2f7d32", "red": "#b3261e", "lightgrey": "#5f6368"}  # white on them has a contrast above 5
LETTER = 6.6  # px, about the width of a letter of 11 px; `textLength` makes the text fit exactly
PADDING = 6.0


def badge_words(outcome: SessionOutcome) -> tuple[str, str]:
    """The text of the badge, and its colour by the name that shields.io uses."""
    good, count = sum(verdict.ok for verdict in outcome.all), len(outcome.all)
    if outcome.unfinished:
        return "unfinished", "lightgrey"
    if not count:
        return "nothing compared", "lightgrey"
    if outcome.ok:
        return f"{count} verdicts as expected", "brightgreen"
    text = f"{good} of {count} as expected" if good < count else "incomplete"
    return text, "red"


def write_badges(outcome: SessionOutcome, folder: Path) -> None:
    """Write badge.json and badge.svg into a folder."""
    write_whole(folder / "badge.json", badge_json(outcome))
    write_whole(folder / "badge.svg", badge_svg(outcome))


def badge_json(outcome: SessionOutcome) -> str:
    """The text of badge.json, in the schema of shields.io's endpoint badges."""
    message, colour = badge_words(outcome)
    return json.dumps({"schemaVersion": 1, "label": LABEL, "message": message, "color": colour}) + "\n"


def badge_svg(outcome: SessionOutcome) -> str:
    """The text of badge.svg."""
    message, colour = badge_words(outcome)
    left, right = (LETTER * len(text) + 2 * PADDING for text in (LABEL, message))
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + right:.0f}" height="20" role="img" '
        f'aria-label="{escape(f"{LABEL}: {message}")}">',
        f"<title>{escape(f'{LABEL}: {message}')}</title>",
        f'<rect width="{left:.1f}" height="20" fill="#3c4043"/>',
        f'<rect x="{left:.1f}" width="{right:.1f}" height="20" fill="{COLOURS[colour]}"/>',
        '<g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11">',
        *(_text(text, x, width) for text, x, width in ((LABEL, 0.0, left), (message, left, right))),
        "</g></svg>",
    ]
    return "\n".join(parts) + "\n"


def _text(text: str, x: float, width: float) -> str:
    room = width - 2 * PADDING
    return f'<text x="{x + PADDING:.1f}" y="14" textLength="{room:.1f}">{escape(text)}</text>'
