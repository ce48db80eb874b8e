"""The problems of a scene: what is wrong, where, and what to write instead."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches


@dataclass(frozen=True)
class Place:
    """A place in a scene: its path ("$.bodies[0].mass_kg") and the names on the way there (`body "hub"`)."""

    path: str = "$"
    names: tuple[str, ...] = ()

    def key(self, *steps: str | int) -> Place:
        """The place below this one: a string is a key, an integer an index."""
        return Place(self.path + "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in steps), self.names)

    def named(self, label: str) -> Place:
        """The same place with one more name on the way."""
        return Place(self.path, (*self.names, label))

    def __str__(self) -> str:
        return f"{self.path} ({', '.join(self.names)})" if self.names else self.path


@dataclass(frozen=True)
class Defect:
    """One defect of a scene: `where` is path and names, `what` the defect, `remedy` what to write instead."""

    where: str
    what: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.where}: {self.what}\n     -> {self.remedy}"


class SceneError(ValueError):
    """A scene that cannot be simulated; `problems` lists every defect found."""

    def __init__(self, scene: str, problems: Iterable[Defect]) -> None:
        self.scene = scene
        self.problems = tuple(problems)
        count = f"{len(self.problems)} problem{'s' if len(self.problems) > 1 else ''}"
        lines = [f"{number:3d}. {problem}" for number, problem in enumerate(self.problems, 1)]
        super().__init__("\n".join([f'scene "{scene}" has {count}:', *lines]))


def closest(word: str, known: Iterable[str]) -> str:
    """A remedy for an unknown word: the nearest known one, or all of them."""
    words = sorted(known)
    near = get_close_matches(word, words, n=1)
    if near:
        return f'did you mean "{near[0]}"?'
    return f"use one of: {', '.join(words)}" if words else "there is none: add it first"
