"""Pages that hold their data and scripts, and load no other file."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import msgspec

from flexmb.output.files import folder, write_whole
from flexmb.output.printable import printable

THREE = "three/three.iife.min.js"
PLOTLY = "plotly/plotly-basic.min.js"
SCRIPTS = (THREE, "unpack.js", "scene.js")
HEIGHT = 620  # pixels of a notebook's frame


@dataclass(frozen=True)
class Page:
    """One HTML page, which needs no network: `save` it, or show it as the last value of a notebook's cell.

    `scene` is the name of the scene, `html` the page.
    """

    scene: str
    html: str

    @property
    def kind(self) -> str:
        """What the page is, in a word."""
        return "Page"

    def __repr__(self) -> str:
        size = f"one page of {len(self.html) / 1e6:.1f} MB"
        return f"<{self.kind} of {self.scene!r}: {size}; save(path) writes it>"

    def _repr_html_(self) -> str:
        """The page in a frame of its own, for notebooks."""
        source = escape(self.html, quote=True)
        return f'<iframe srcdoc="{source}" style="width:100%;height:{HEIGHT}px;border:0" title="scene"></iframe>'

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the page, which ends in .html; returns its path. ValueError for another ending."""
        file = html_file(path)
        folder(file.parent)
        write_whole(file, self.html)
        return file


def is_html(path: str | os.PathLike[str]) -> bool:
    """Whether a path is that of a page."""
    return Path(path).suffix.lower() in (".html", ".htm")


def html_file(path: str | os.PathLike[str]) -> Path:
    """The path of a page; ValueError if it does not end in .html."""
    file = Path(path)
    if not is_html(file):
        raise ValueError(f"a view is a page of HTML, not {file.name!r}: give a name that ends in .html")
    return file


def asset(name: str) -> str:
    """A file of this folder, as text."""
    return files("flexmb.view.page").joinpath(name).read_text(encoding="utf-8")


def in_script(data: Any) -> str:
    """Data as JSON for a script element, without sequences that would end the element or a line."""
    text = msgspec.json.encode(data).decode()
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def page(title: str, animation: dict[str, Any], series: dict[str, Any]) -> str:
    """HTML of one animation, as scene.js reads it, with its packed series."""
    return filled("view.html", title, SCRIPTS, {"animations": [animation], "series": series})


def filled(template: str, title: str, scripts: Iterable[str], data: dict[str, Any]) -> str:
    """A template with its title, style sheets, scripts and data, to which the title is added."""
    elements = "\n".join(f"<script>\n{asset(name)}\n</script>" for name in scripts)
    return Template(asset(template)).substitute(
        title=escape(printable(title)),
        style=asset("page.css") + asset("scene.css"),
        scripts=elements,
        data=in_script({"title": printable(title), **data}),
    )
