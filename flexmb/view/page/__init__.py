"""The page of an animation: one file that holds its data and scripts, and loads no other."""

from __future__ import annotations

from html import escape
from importlib.resources import files
from string import Template
from typing import Any

import msgspec

from flexmb.output.printable import printable

THREE = "three/three.iife.min.js"
SCRIPTS = (THREE, "unpack.js", "scene.js")


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
    scripts = "\n".join(f"<script>\n{asset(name)}\n</script>" for name in SCRIPTS)
    data = in_script({"title": printable(title), "animations": [animation], "series": series})
    return Template(asset("view.html")).substitute(
        title=escape(printable(title)), style=asset("scene.css"), scripts=scripts, data=data
    )
