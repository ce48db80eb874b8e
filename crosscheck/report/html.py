"""Templates of the report, and the ways in which text, markup and data get into a page unharmed."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import msgspec
from jinja2 import Environment, PackageLoader, select_autoescape
from markupsafe import Markup, escape

from flexmb.output.printable import printable


@cache
def templates() -> Environment:
    """The templates; what they print is escaped, and without control characters."""
    found = Environment(
        loader=PackageLoader("crosscheck.report"),
        autoescape=select_autoescape(["html.j2"], default_for_string=True, default=True),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=False,
        finalize=_shown,
    )
    found.filters["code"] = code
    found.filters["breakable"] = _breakable
    return found


def source(name: str) -> Markup:
    """A file of the templates folder as it is."""
    loader = templates().loader
    assert loader is not None
    return Markup(loader.get_source(templates(), name)[0])


def embedded(data: Any) -> Markup:
    """Data as JSON that is safe in a script element: nothing in it looks like the end of the element or of a line."""
    text = msgspec.json.encode(data).decode()
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)


def code(text: str) -> Markup:
    """Text of a README or a note with `words in backticks` set as code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(printable(text)))))


def _shown(value: Any) -> Any:
    """Text as a template prints it: plain text without control characters; markup is our own."""
    return printable(value) if type(value) is str else value


def _breakable(text: str) -> Markup:
    """Text that may be broken after a slash."""
    return Markup(str(escape(printable(text))).replace("/", "/<wbr>"))
