"""Records of maps: one line for the machine, one for the map and one for each cell."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import msgspec

from crosscheck.records.archive import decoded_lines
from crosscheck.records.kinds import BrokenLine, Environment
from crosscheck.records.made_by import made_by
from crosscheck.records.sources import imported
from crosscheck.stability.map import Axis, CellStatus, StabilityMap
from crosscheck.stability.refine import Cell

RECORDING = ("crosscheck.stability.map", "crosscheck.stability.run")  # a part of what makes a cell's record


class MapRecord(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="record", tag="map"):
    """A map as it was run. `identity` changes with its definition; cells of another identity are not used."""

    map: str
    identity: str
    quantity: str
    x: Axis
    y: Axis


class CellRecord(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="record", tag="cell"):
    """The result of one cell (`Cell`) of the map of that identity, at its middle x, y."""

    identity: str
    level: int
    i: int
    j: int
    x: float
    y: float
    status: CellStatus
    value: float | None = None
    message: str = ""
    cpu_s: float = 0.0

    @property
    def cell(self) -> Cell:
        return Cell(self.level, self.i, self.j)


Written = Environment | MapRecord | CellRecord
Record = Written | BrokenLine


def identity(what: StabilityMap, file: Path | None = None) -> str:
    """A digest of the map's axes and of everything its cells depend on: sources, libraries, machine (`made_by`).

    A map of one's own is in a `file` that is no module: its text counts, and what it imports.
    """
    if file is None:
        code = made_by({what.scene.__module__, what.measure.__module__}, RECORDING)
    else:
        own_text = hashlib.sha256(file.read_bytes()).hexdigest()
        code = f"{own_text} {made_by(imported(file.stem, file), RECORDING)}"
    text = f"{what.name} {what.x} {what.y} {code}"
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def read(file: Path) -> list[Record]:
    """All records of a file, in order; an invalid line becomes a BrokenLine, and its cell is run again."""
    return decoded_lines(file, Written)


def cells_of(records: Sequence[Record], wanted: str) -> dict[Cell, CellRecord]:
    """Cells recorded for the map of one identity, without those that did not run, which are run again."""
    found = [record for record in records if isinstance(record, CellRecord) and record.identity == wanted]
    return {record.cell: record for record in found if record.status != "did not run"}
