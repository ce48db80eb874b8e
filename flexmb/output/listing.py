"""Tables for the terminal in which names and numbers are never truncated (`flexmb.output.terminal` prints them)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions
from rich.text import Text

from flexmb.output.printable import printable

_GAP = 2  # spaces between two columns
_PROSE_MIN_WIDTH = 16  # narrower columns of prose are not printed: rows are then printed as blocks
_INDENT = 2  # of the cells of a row that is printed as a block
_CAPTION_STYLE = "dim italic"


@dataclass(frozen=True)
class Column:
    """A column. Cells of a `whole` column stay in one line, others are wrapped; `right` aligns them to the right."""

    heading: str
    whole: bool
    right: bool = False


def names(*headings: str) -> tuple[Column, ...]:
    """Columns of names, by which a reader or a program finds a row; never wrapped."""
    return tuple(Column(heading, whole=True) for heading in headings)


def figures(*headings: str) -> tuple[Column, ...]:
    """Columns of numbers, possibly with units; never wrapped, aligned to the right."""
    return tuple(Column(heading, whole=True, right=True) for heading in headings)


def prose(*headings: str) -> tuple[Column, ...]:
    """Columns of sentences and lists, which are wrapped to the available width."""
    return tuple(Column(heading, whole=False) for heading in headings)


class Listing:
    """A table with a title above and a caption below, which rich can print.

    Columns of prose share the width that names and figures leave. If that is too little, each row is printed as its
    first cell in a line of its own, and the other cells below it, each after its heading. If all headings are empty,
    no head is printed.
    """

    def __init__(self, *columns: Column, title: str = "", caption: str = "") -> None:
        self._columns = columns
        self._title, self._caption = title, caption
        self._rows: list[tuple[Text, ...]] = []

    def add(self, *cells: str | Text) -> None:
        """Add a row; text is shown literally and as one line. ValueError unless there is a cell for each column."""
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
            yield _unbroken(line, _CAPTION_STYLE)

    def _widths(self, room: int) -> list[int] | None:
        """Widths of the columns in a table that is at most `room` wide; None if it cannot be so narrow."""
        headings = tuple(Text(column.heading) for column in self._columns)
        columns = list(zip(headings, *self._rows, strict=True))
        full = [max(cell.cell_len for cell in cells) for cells in columns]
        least = [
            width if column.whole else max(min(width, _PROSE_MIN_WIDTH), *map(_longest_word, cells))
            for column, width, cells in zip(self._columns, full, columns, strict=True)
        ]
        left = room - _GAP * (len(full) - 1) - sum(least)
        if left < 0:
            return None
        widths = least.copy()
        for place, i in enumerate(sorted(range(len(full)), key=lambda i: full[i] - least[i])):
            more = min(full[i] - least[i], left // (len(full) - place))  # in ascending order of need, equal shares
            widths[i] += more
            left -= more
        return widths

    def _beside_each_other(self, widths: Sequence[int], rule: str) -> Iterator[Text]:
        headings = tuple(Text(column.heading, "bold") for column in self._columns)
        if any(heading.plain for heading in headings):
            yield from self._row(headings, widths)
            yield _unbroken(Text((" " * _GAP).join(rule * width for width in widths)), "dim")
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
                line.append_text(Text(blank) + part if column.right else part + Text(blank)).append(" " * _GAP)
            yield _unbroken(line)

    def _below_each_other(self, room: int) -> Iterator[Text]:
        for first, *others in self._rows:
            yield _unbroken(first, "bold")
            for column, cell in zip(self._columns[1:], others, strict=True):
                told = Text(f"{column.heading}: " if column.heading else "").append_text(cell)
                for line in _folded(told, room - _INDENT) if cell.plain else ():
                    yield _unbroken(Text(" " * _INDENT).append_text(line))


def _one_line(cell: str | Text) -> Text:
    text = cell if isinstance(cell, Text) else Text(printable(cell))
    return Text(" ").join(text.split("\n")) if "\n" in text.plain else text


def _unbroken(text: Text, style: str = "") -> Text:
    """A line that is printed unchanged at any width of the terminal."""
    line = Text(style=style, no_wrap=True, overflow="ignore").append_text(text)
    line.rstrip()
    return line


def _folded(text: Text, width: int) -> list[Text]:
    """The text as lines of at most `width`, except where a single word is longer: words are not broken."""
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
