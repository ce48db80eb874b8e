"""Accepted figures: the E and U that each comparison of a case has reached, in `accepted.toml` beside its run file.

Goals are requirements; these figures are what was reached. `crosscheck run --accept` writes them, and they are
reviewed like code. `crosscheck.judging.figures` says when a later figure counts as *worse than recorded*.

The file::

    ["rigid, all engines"]            # the comparison, or for conserved quantities e.g. "energy conserved"
    "energy.total | native (rigid) | mujoco (rigid)" = { E = 1.2e-13, U = 4.5e-12, of = "0a17c5.c9d3e0.11bb40.9e8f12" }

`of` is the basis of the figure, see `crosscheck.judging.basis`; files of older versions have none.

Only the library's own engines have accepted figures.
"""

from __future__ import annotations

import json
from collections.abc import Mapping

import msgspec

FILE = "accepted.toml"
HEADER = "# The figures this case has reached. Written by `crosscheck run --accept`; review changes like code.\n"


class Figure(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """E and U of a comparison in one channel, relative to its range, with their basis; a drift has no U."""

    E: float
    U: float = 0.0
    of: str = ""


Accepted = dict[str, dict[str, Figure]]  # comparison -> channel and sides -> figure


def key(channel: str, a: tuple[str, str], b: tuple[str, str]) -> str:
    """The key of a channel and two sides, each (engine, variant)."""
    return " | ".join([channel, *(f"{engine} ({variant})" for engine, variant in (a, b))])


def merged(before: Accepted, now: Accepted) -> Accepted:
    """The figures `now` of a run of some engines, with the figures `before` of the others."""
    return {name: before.get(name, {}) | now.get(name, {}) for name in (*before, *now)}


def dumps(accepted: Mapping[str, Mapping[str, Figure]]) -> str:
    """The text of the file: sorted, one line for each figure."""
    lines = [HEADER]
    for name, table in sorted(accepted.items()):
        lines.append(f"[{_quoted(name)}]")
        for place, figure in sorted(table.items()):
            doubt = f", U = {figure.U:.1e}" if figure.U else ""
            basis = f", of = {_quoted(figure.of)}" if figure.of else ""
            lines.append(f"{_quoted(place)} = {{ E = {figure.E:.1e}{doubt}{basis} }}")
        lines.append("")
    return "\n".join(lines)


def _quoted(text: str) -> str:
    """A basic TOML string on one line: its escapes are those of JSON, except for DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
