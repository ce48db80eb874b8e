"""Problems of a scene: what is wrong or doubtful, its place, and the remedy."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

SEARCHED = 5_000  # known words among which a near one is looked for: of more it takes seconds for each unknown one
LISTED = 24  # known words that a message lists; of more it names the nearest


@dataclass(frozen=True)
class Place:
    """A place in a scene: its path ("$.bodies[0].mass_kg") and the names on the way there (`body "hub"`)."""

    path: str = "$"
    names: tuple[str, ...] = ()

    def key(self, *steps: str | int) -> Place:
        """The place below this one: a string is a key, an integer an index."""
        return Place(self.path + "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in steps), self.names)

    def named(self, label: str) -> Place:
        """The same place with one more name."""
        return Place(self.path, (*self.names, label))

    def __str__(self) -> str:
        return f"{self.path} ({', '.join(self.names)})" if self.names else self.path


@dataclass(frozen=True)
class Defect:
    """A defect of a scene: `where` has path and names, `what` is the defect, `remedy` says what to write instead."""

    where: str
    what: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.where}: {self.what}\n     -> {self.remedy}"


@dataclass(frozen=True)
class Doubt(Defect):
    """A value that is valid but unusual, such as an error of units causes; the scene runs.

    `waiver` in the scene's `allow` declares it as intended, for example in a scene in millimetres.
    """

    waiver: str

    def __str__(self) -> str:
        return f'{super().__str__()}; if it is intended, write allow = ["{self.waiver}"] in the scene'


class SceneWarning(UserWarning):
    """A scene that runs but has doubtful values; the message says where, and how to waive the warning."""


class SceneError(ValueError):
    """A scene that cannot be simulated; `problems` lists all defects found."""

    def __init__(self, scene: str, problems: Iterable[Defect]) -> None:
        self.scene = scene
        self.problems = tuple(problems)
        count = f"{len(self.problems)} problem{'s' if len(self.problems) > 1 else ''}"
        lines = [f"{number:3d}. {problem}" for number, problem in enumerate(self.problems, 1)]
        super().__init__("\n".join([f'scene "{scene}" has {count}:', *lines]))


def in_short(scene: str, doubts: Sequence[Doubt]) -> str:
    """The text of a warning: the first doubt of each kind in full, and the number of the others."""
    kinds: dict[str, list[Doubt]] = {}
    for doubt in doubts:
        kinds.setdefault(doubt.waiver, []).append(doubt)
    more = {kind: f" (and {len(alike) - 1} more like it)" if len(alike) > 1 else "" for kind, alike in kinds.items()}
    lines = [f"{number:3d}. {alike[0]}{more[kind]}" for number, (kind, alike) in enumerate(kinds.items(), 1)]
    return "\n".join([f'scene "{scene}" is doubtful:', *lines])


def closest(word: str, known: Iterable[str]) -> str:
    """The remedy for an unknown word: the nearest known word; if none is near, all known words, if they are few."""
    words = list(known)
    if len(words) > SEARCHED:
        return f"there are {len(words)}, too many to look for one that is near"
    words.sort()
    near = get_close_matches(word, words, n=1)
    if near:
        return f'did you mean "{near[0]}"?'
    if len(words) > LISTED:
        nearest = get_close_matches(word, words, n=1, cutoff=0.0)
        return f'none of the {len(words)} that there are is near; the nearest is "{nearest[0]}"'
    return f"use one of: {', '.join(words)}" if words else "there is none: add it first"
