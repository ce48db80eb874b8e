"""Cells of CSV files: numbers, and names that no spreadsheet may take for formulas.

A cell that begins with =, +, - or @ is calculated when a table is opened, quoted or not, and can start programs. An
apostrophe before it makes it a text: writers add one, readers take one away, so that every name is read as it was.
"""

from __future__ import annotations

import re

NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_FORMULA = re.compile(r"'*[=+\-@]")


def as_text(name: str) -> str:
    """The cell for a name."""
    return f"'{name}" if _FORMULA.match(name) else name


def from_text(cell: str) -> str:
    """The name in a cell."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


def plain_number(cell: str) -> float:
    """The number in a cell, NaN too; ValueError for what only Python takes for one, such as 1_0 or other digits."""
    word = cell.strip()
    if not NUMBER.fullmatch(word) and word.lower() != "nan":
        raise ValueError(word)
    return float(word)
