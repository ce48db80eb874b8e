"""What both command lines print on."""

from __future__ import annotations

from typing import Any

from rich.console import Console, ConsoleDimensions

ENDLESS = 1_000_000  # columns: no line of ours is as long


class Terminal(Console):
    """A console that folds lines to the width of a terminal, and neither folds nor cuts where nobody watches.

    What goes into a pipe or a file is read by programs: a line stays a line there, whatever COLUMNS says. On a terminal
    too nothing is cut: a word that is longer than the screen goes on in its next line.
    """

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, markup=False, emoji=False)  # names and paths stand in what it prints

    @property
    def size(self) -> ConsoleDimensions:
        """Of the screen, or without an end to its lines where there is none."""
        found = super().size
        return found if self.file.isatty() else ConsoleDimensions(ENDLESS, found.height)

    @size.setter
    def size(self, new: tuple[int, int]) -> None:
        self._width, self._height = new

    def print(self, *objects: Any, crop: bool = False, **others: Any) -> None:
        """As of rich, which would crop by default."""
        super().print(*objects, crop=crop, **others)
