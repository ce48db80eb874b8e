"""Accepted figures: the E and U that each comparison of a case once reached, in `accepted.toml` beside its run file.

Goals say what is good enough; these say what was there. `crosscheck run --accept` writes them, and they are reviewed
like code. A figure has grown, and the verdict is *worse than recorded*, if

    U > 10 max(U_accepted, floor)    or    E > 10 max(E_accepted, U_accepted, floor).

E below U is noise that may be anything from 0 to U on another machine, so E is held against U too. Below the floor, the
rounding eps sqrt(N) of a million evaluations, growth is that of rounding. Factor 10: an estimate of U is no better than
a factor of a few, since an order is seen or not and a difference of two runs is large or small by chance.

The file::

    ["rigid, all engines"]            # the comparison, or for conserved quantities e.g. "energy conserved"
    "energy.total | native (rigid) | mujoco (rigid)" = { E = 1.2e-13, U = 4.5e-12 }

Foreign engines have no accepted figures: a case is not theirs.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import msgspec
import numpy as np

if TYPE_CHECKING:
    from crosscheck.judging.verdict import Verdict

FILE = "accepted.toml"
GROWTH = 10.0
FLOOR = float(np.finfo(np.float64).eps) * 1e3
HEADER = "# The figures this case has reached. Written by `crosscheck run --accept`; review changes like code.\n"


class Figure(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a comparison reached on one channel, relative to its range; a conserved quantity's drift has no U."""

    E: float
    U: float = 0.0


Accepted = dict[str, dict[str, Figure]]  # comparison -> channel and sides -> figure


def key(channel: str, a: tuple[str, str], b: tuple[str, str]) -> str:
    """How the file names a channel of two sides, each (engine, variant)."""
    return " | ".join([channel, *(f"{engine} ({variant})" for engine, variant in (a, b))])


def key_of(verdict: Verdict) -> str:
    """How the file names a verdict within its comparison."""
    return key(verdict.channel, (verdict.engine_a, verdict.variant_a), (verdict.engine_b, verdict.variant_b))


def worse(figure: Figure | None, E: float | None, U: float | None) -> str:
    """How E or U has grown beyond the accepted figure; "" if not, or if there is none."""
    if figure is None:
        return ""
    if E is None:
        return f"accepted with E {figure.E:.1e}, and now there is no figure at all"
    grown = []
    for name, now, then in (("U", U or 0.0, figure.U), ("E", E, max(figure.E, figure.U))):
        if not now <= GROWTH * max(then, FLOOR):
            grown.append(f"{name} is {now:.1e}, accepted were {getattr(figure, name):.1e}")
    return "; ".join(grown)


def figures(verdicts: Iterable[Verdict], engines: Iterable[str]) -> Accepted:
    """The figures of verdicts between some engines (the library's own); controls have none, nor what has no E."""
    own = set(engines)
    found: Accepted = {}
    for verdict in verdicts:
        if recordable(verdict, own) and verdict.E is not None:
            figure = Figure(_rounded(verdict.E), _rounded(verdict.U or 0.0))
            found.setdefault(verdict.comparison, {})[key_of(verdict)] = figure
    return found


def recordable(verdict: Verdict, own: Iterable[str]) -> bool:
    """Whether a verdict should have a figure: it compares numbers, and of the library's own engines only."""
    if verdict.kind == "control" or verdict.E is None:
        return False
    return verdict.engine_a in own and (verdict.kind == "conservation" or verdict.engine_b in own)


def merged(before: Accepted, now: Accepted) -> Accepted:
    """Figures of a run of some engines only, beside those of the others."""
    return {name: before.get(name, {}) | now.get(name, {}) for name in (*before, *now)}


def dumps(accepted: Mapping[str, Mapping[str, Figure]]) -> str:
    """The text of the file: sorted, a line a figure."""
    lines = [HEADER]
    for name, table in sorted(accepted.items()):
        lines.append(f"[{_quoted(name)}]")
        for place, figure in sorted(table.items()):
            doubt = f", U = {figure.U:.1e}" if figure.U else ""
            lines.append(f"{_quoted(place)} = {{ E = {figure.E:.1e}{doubt} }}")
        lines.append("")
    return "\n".join(lines)


def _rounded(number: float) -> float:
    return float(f"{number:.1e}")


def _quoted(text: str) -> str:
    """A basic TOML string on one line: JSON's escapes are TOML's, but for DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
