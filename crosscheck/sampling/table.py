"""The table of samples: a line for each sample in each engine, appended as they come, sorted at the end."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self, TextIO

from crosscheck.sampling.file import SweepFile
from crosscheck.sampling.sample import SampleRecord
from flexmb.output.csv_cells import as_text
from flexmb.output.whole import whole_file
from flexmb.output.writing import writing


class SamplesTable:
    """A CSV file: sample, engine, status, parameters, quantities (empty without a result), message.

    Until its context ends without an error the lines are in `<name>.unfinished.csv`, in the order in which they came.
    """

    def __init__(self, file: Path, sweep: SweepFile) -> None:
        self._file = file
        self._growing = file.with_suffix(f".unfinished{file.suffix}")
        self._parameters = [parameter.title for parameter in sweep.parameters]
        self._quantities = [quantity.name for quantity in sweep.quantities]
        self._records: list[SampleRecord] = []
        self._header = ["sample", "engine", "status", *self._parameters, *self._quantities, "message"]

    def __enter__(self) -> Self:
        with writing(self._growing):
            self._stream = self._growing.open("w", encoding="utf-8", newline="")
            self._write(self._stream, self._header)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        with writing(self._growing):
            self._stream.close()
        if error is None:
            self._complete()

    def add(self, record: SampleRecord) -> None:
        """Append a line and flush it to the file."""
        self._records.append(record)
        with writing(self._growing):
            self._write(self._stream, self._line(record))

    def _complete(self) -> None:
        """Sort the lines by sample and engine."""
        with whole_file(self._file) as beside, beside.open("w", encoding="utf-8", newline="") as stream:
            self._write(stream, self._header)
            for record in sorted(self._records, key=lambda each: (each.sample, each.engine)):
                self._write(stream, self._line(record))
        self._growing.unlink()

    def _line(self, record: SampleRecord) -> list[object]:
        parameters = [record.parameters[name] for name in self._parameters]
        quantities = [record.quantities.get(name, "") for name in self._quantities]
        return [record.sample, record.engine, record.status, *parameters, *quantities, record.message]

    @staticmethod
    def _write(stream: TextIO, line: Sequence[object]) -> None:
        """One line: texts are quoted and no formulas, numbers have all their digits."""
        csv.writer(stream, quoting=csv.QUOTE_NONNUMERIC, lineterminator="\n").writerow(
            [as_text(cell) if isinstance(cell, str) else cell for cell in line]
        )
        stream.flush()
