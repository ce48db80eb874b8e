"""What both command lines print on."""

from __future__ import annotations

from typing import Any

from rich.console import Console, ConsoleDimensions

ENDLESS = 1_000_000  # columns: no line of ours is as long


class Terminal(Console):
    """A console that cuts nothing, and where nobody watches folds nothing either.

    What goes into a pipe or a file is read by programs: a line stays a line there, whatever COLUMNS says. On a terminal
    tables fold sentences to its width; a line that is longer goes on in the terminal's next.
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

    def print(self, *objects: Any, soft_wrap: bool | None = True, **others: Any) -> None:
        """As of rich, which by default would break words that are longer than the terminal is wide."""
        super().print(*objects, soft_wrap=soft_wrap, **others)
