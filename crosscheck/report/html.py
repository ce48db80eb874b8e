"""Templates of the report, and the escaping of text, markup and data."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, select_autoescape
from markupsafe import Markup, escape

from crosscheck.judging.work import seconds
from flexmb.output.printable import printable
from flexmb.view.page import in_script


@cache
def templates() -> Environment:
    """The templates; their output is escaped and has no control characters."""
    environment = Environment(
        loader=ChoiceLoader([PackageLoader("crosscheck.report"), PackageLoader("flexmb.view", "page")]),
        autoescape=select_autoescape(["html.j2"], default_for_string=True, default=True),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=False,
        finalize=_shown,
    )
    environment.filters["code"] = code
    environment.filters["breakable"] = _breakable
    environment.filters["power"] = _power
    environment.filters["seconds"] = seconds
    return environment


def source(name: str) -> Markup:
    loader = templates().loader
    assert loader is not None
    return Markup(loader.get_source(templates(), name)[0])


def style() -> Markup:
    """The style sheet of the report, with that of animations."""
    return source("scene.css") + source("style.css")


def embedded(data: Any) -> Markup:
    """Data as JSON for a script element, without sequences that would end the element or a line."""
    return Markup(in_script(data))


def code(text: str) -> Markup:
    """Text of a README or a note with `words in backticks` set as code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(printable(text)))))


def _power(number: float) -> str:
    """A power of ten in short: 1e-6, not 1e-06."""
    return re.sub(r"e([+-])0", r"e\1", f"{number:.0e}")


def _shown(value: Any) -> Any:
    """Text without control characters; markup is our own and unchanged."""
    return printable(value) if type(value) is str else value


def _breakable(text: str) -> Markup:
    """Text that may be broken after a slash."""
    return Markup(str(escape(printable(text))).replace("/", "/<wbr>"))


# The place of each case in the report: a page of its own, or a section of the single file.

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
