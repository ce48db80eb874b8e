"""The code blocks of the documentation, page by page, as a reader would type them.

A block that cannot be run in a test says why, in a comment on the line before it: `<!-- not run: takes an hour -->`.
"""

import re
from pathlib import Path
from typing import NamedTuple

from tests.repo.project import ROOT

PAGES = sorted(page for page in (ROOT / "docs").rglob("*.md") if "engine-template" not in page.parts)
BLOCK = re.compile(r"(?:<!-- not run: (?P<why>[^\n]+?) -->\n+)?^```(?P<language>\w+)\n(?P<code>.*?)^```$", re.M | re.S)


class Snippet(NamedTuple):
    """A block of code on a page, with the line at which it begins; `why` it is not run, "" if it is."""

    page: Path
    line: int
    language: str
    code: str
    why: str


def snippets(page: Path) -> list[Snippet]:
    """All blocks of a page, in their order."""
    text = page.read_text(encoding="utf-8")
    return [
        Snippet(page, _line(text, found.start("code")), found["language"], found["code"], found["why"] or "")
        for found in BLOCK.finditer(text)
    ]


def _line(text: str, place: int) -> int:
    return text.count("\n", 0, place) + 1
