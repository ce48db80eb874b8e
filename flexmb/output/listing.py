"""Tables for the terminal whose names and figures are never cut; see `flexmb.output.terminal` for where they appear."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions
from rich.text import Text

from flexmb.output.printable import printable

GAP = 2  # columns between two columns
LEAST_PROSE = 16  # columns that prose is given before a row is written below its name instead
INDENT = 2
ABOUT = "dim italic"  # style of a caption


@dataclass(frozen=True)
class Column:
    """A column: `whole` cells stay in one line, others are folded between words; `right` is where figures stand."""

    heading: str
    whole: bool
    right: bool = False


def names(*headings: str) -> tuple[Column, ...]:
    """Columns of names, by which a reader or a program finds a row: whole."""
    return tuple(Column(heading, whole=True) for heading in headings)


def figures(*headings: str) -> tuple[Column, ...]:
    """Columns of numbers, with their units perhaps: whole, at the right."""
    return tuple(Column(heading, whole=True, right=True) for heading in headings)


def prose(*headings: str) -> tuple[Column, ...]:
    """Columns of sentences and of lists, which are folded where there is no room."""
    return tuple(Column(heading, whole=False) for heading in headings)


class Listing:
    """A table under a title and above a caption: anything that rich prints.

    Columns of prose share the width that names and figures leave them. Where that is too little, every row is its first
    cell in a line of its own, and the other cells below it, each after its heading. Without headings, no head.
    """

    def __init__(self, *columns: Column, title: str = "", caption: str = "") -> None:
        self._columns = columns
        self._title, self._caption = title, caption
        self._rows: list[tuple[Text, ...]] = []

    def add(self, *cells: str | Text) -> None:
        """A row; text is shown literally, and as one line."""
        if len(cells) != len(self._columns):
            raise ValueError(f"a row of {len(cells)} cells in a table of {len(self._columns)} columns")
        self._rows.append(tuple(_one_line(cell) for cell in cells))

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Text]:
        widths = self._widths(options.max_width)
        if self._title:
            yield Text(self._title, "bold")
        if widths is None:
            yield from self._below_each_other(options.max_width)
        else:
            yield from self._beside_each_other(widths, "-" if options.ascii_only else "─")
        for line in _folded(Text(self._caption), options.max_width) if self._caption else ():
            yield _unbroken(line, ABOUT)

    def _widths(self, room: int) -> list[int] | None:
        """Of each column, in a table that is at most `room` wide; None where it cannot be."""
        headings = tuple(Text(column.heading) for column in self._columns)
        columns = list(zip(headings, *self._rows, strict=True))
        full = [max(cell.cell_len for cell in cells) for cells in columns]
        least = [
            width if column.whole else max(min(width, LEAST_PROSE), *map(_longest_word, cells))
            for column, width, cells in zip(self._columns, full, columns, strict=True)
        ]
        left = room - GAP * (len(full) - 1) - sum(least)
        if left < 0:
            return None
        widths = least.copy()
        for place, i in enumerate(sorted(range(len(full)), key=lambda i: full[i] - least[i])):
            more = min(full[i] - least[i], left // (len(full) - place))  # who wants little gets it, the others share
            widths[i] += more
            left -= more
        return widths

    def _beside_each_other(self, widths: Sequence[int], rule: str) -> Iterator[Text]:
        headings = tuple(Text(column.heading, "bold") for column in self._columns)
        if any(heading.plain for heading in headings):
            yield from self._row(headings, widths)
            yield _unbroken(Text((" " * GAP).join(rule * width for width in widths)), "dim")
        for row in self._rows:
            yield from self._row(row, widths)

    def _row(self, cells: Iterable[Text], widths: Sequence[int]) -> Iterator[Text]:
        folded = [
            [cell] if column.whole else _folded(cell, width)
            for cell, column, width in zip(cells, self._columns, widths, strict=True)
        ]
        for parts in zip_longest(*folded, fillvalue=Text()):
            line = Text()
            for part, column, width in zip(parts, self._columns, widths, strict=True):
                blank = " " * (width - part.cell_len)
                line.append_text(Text(blank) + part if column.right else part + Text(blank)).append(" " * GAP)
            yield _unbroken(line)

    def _below_each_other(self, room: int) -> Iterator[Text]:
        for first, *others in self._rows:
            yield _unbroken(first, "bold")
            for column, cell in zip(self._columns[1:], others, strict=True):
                told = Text(f"{column.heading}: " if column.heading else "").append_text(cell)
                for line in _folded(told, room - INDENT) if cell.plain else ():
                    yield _unbroken(Text(" " * INDENT).append_text(line))


def _one_line(cell: str | Text) -> Text:
    text = cell if isinstance(cell, Text) else Text(printable(cell))
    return Text(" ").join(text.split("\n")) if "\n" in text.plain else text


def _unbroken(text: Text, style: str = "") -> Text:
    """A line that is printed as it is, however narrow the terminal."""
    line = Text(style=style, no_wrap=True, overflow="ignore").append_text(text)
    line.rstrip()
    return line


def _folded(text: Text, width: int) -> list[Text]:
    """Lines of at most `width`, but where a single word is longer: words are not broken."""
    breaks, used = [], 0
    for word in re.finditer(r"\S+\s*", text.plain):
        if used and used + cell_len(word.group().rstrip()) > width:
            breaks.append(word.start())
            used = 0
        used += cell_len(word.group())
    lines = list(text.divide(breaks))
    for line in lines:
        line.rstrip()
    return lines


def _longest_word(text: Text) -> int:
    return max((cell_len(word) for word in text.plain.split()), default=0)
