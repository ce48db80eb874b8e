"""The console of both command lines."""

from __future__ import annotations

from typing import Any

from rich.console import Console, ConsoleDimensions

_UNLIMITED = 1_000_000  # columns, more than any line has


class Terminal(Console):
    """A console that never truncates text, and wraps it only on a terminal.

    Output to a pipe or a file is read by programs: there every line stays one line, whatever COLUMNS says. On a
    terminal tables wrap sentences to its width; other long lines continue in the next line of the terminal.
    """

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, markup=False, emoji=False)  # names and paths may contain [ ] and : :

    @property
    def size(self) -> ConsoleDimensions:
        """The size of the terminal; lines of unlimited width if the output is not a terminal."""
        size = super().size
        return size if self.file.isatty() else ConsoleDimensions(_UNLIMITED, size.height)

    @size.setter
    def size(self, new: tuple[int, int]) -> None:
        self._width, self._height = new

    def print(self, *objects: Any, soft_wrap: bool | None = True, **others: Any) -> None:
        """rich's `print` with soft wrapping as default; rich's own breaks words longer than the terminal's width."""
        super().print(*objects, soft_wrap=soft_wrap, **others)
