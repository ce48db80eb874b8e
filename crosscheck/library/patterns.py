"""Patterns of channels in a run file: the most specific pattern of a channel, and errors in patterns."""

from __future__ import annotations

from collections.abc import Iterable
from fnmatch import fnmatchcase

from crosscheck.engines.signals import KNOWN_TO
from crosscheck.library.channels import KINDS
from flexmb.run.channels import matches

PARTS = {kind.name: tuple(part.name for part in kind.parts if part.name) for kind in KINDS if kind.of_items}
WHOLE = {
    kind.name: tuple(part.name for part in kind.parts if part.name)
    for kind in KINDS
    if not kind.of_items and kind.name != KNOWN_TO
}


def most_specific(patterns: Iterable[str], channel: str) -> str | None:
    """The first of the longest patterns that match the channel; None if none does."""
    return max((pattern for pattern in patterns if matches(pattern, channel)), key=len, default=None)


def fault(pattern: str) -> str:
    """Why no channel can match the pattern; "" if one can.

    A pattern is a kind (`load`), a kind and a name (`load:elbow`), or these and a part (`load:elbow.torque`). A name
    with a dot needs its part, or `.*`.
    """
    kind, named, rest = pattern.partition(":")
    if named:
        parts = _matching(PARTS, kind)
        if not parts:
            return f'there is no kind "{kind}:"; it is one of {", ".join(f"{part}:" for part in PARTS)}'
        name, dot, part = rest.rpartition(".")
        if not (name if dot else rest):
            return f"it names no {kind}"
        known = [kind for group in parts for kind in group]
        if dot and known and not any(fnmatchcase(kind, part) for kind in known):
            return f'there is no "{part}" of a {kind}; it is one of {", ".join(known)}'
        return ""
    kind, dotted, part = pattern.partition(".")
    if not dotted:
        known = [*PARTS, *WHOLE]
        return "" if any(fnmatchcase(each, kind) for each in known) else f"it is none of {', '.join(known)}"
    parts = _matching(WHOLE, kind)
    known = [kind for group in parts for kind in group]
    if any(fnmatchcase(kind, part) for kind in known):
        return ""
    whole = ", ".join(f"{kind}.{part}" for kind, group in WHOLE.items() for part in group)
    return f"channels with a dot alone are {whole}"


def _matching(table: dict[str, tuple[str, ...]], kind: str) -> list[tuple[str, ...]]:
    return [parts for each, parts in table.items() if fnmatchcase(each, kind)]
