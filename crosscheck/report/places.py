"""The place of each case in the report: a page of its own, or a section of the single file."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

INDEX = "index.html"


@dataclass(frozen=True)
class CasePlace:
    """`page` is the path of the case's page from the index ("" in a single file), `anchor` its section there."""

    page: str
    anchor: str

    def link(self, part: str = "") -> str:
        """The address, from the index, of the case or of a part of it."""
        return f"{self.page}#{self.anchor}{'-' if part else ''}{part}"

    @property
    def root(self) -> str:
        """The relative path from the case's page to the folder of the index."""
        return "../" * self.page.count("/")

    @property
    def data(self) -> str:
        """The path of the case's data from the index."""
        return self.page.removesuffix(".html") + ".data.js"


def places(cases: Iterable[str], single: bool) -> dict[str, CasePlace]:
    """The place of every case: `<family>/<case>.html`, in letters that are valid in all file systems and addresses."""
    place_of: dict[str, CasePlace] = {}
    taken = {INDEX}
    for number, case in enumerate(cases):
        stem = "/".join(_plain(part) for part in case.split("/")[-2:])
        page = f"{stem}.html"
        while page.lower() in taken:  # different names may become the same by replacement
            page = f"{stem}-{number}.html"
            stem += "-"
        taken.add(page.lower())
        place_of[case] = CasePlace("" if single else page, f"case-{number}")
    return place_of


def _plain(part: str) -> str:
    return re.sub(r"[^A-Za-z0-9_-]+", "-", part).strip("-")[:80] or "case"
