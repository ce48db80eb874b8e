"""The table of samples: a line for each in each engine, added as they come, in order when the table is closed."""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

from crosscheck.sampling.file import SweepFile
from crosscheck.sampling.sample import SampleRecord
from flexmb.output.writing import writing


class SamplesTable:
    """A CSV file: sample, engine, status, parameters, quantities (empty where there is no result), message."""

    def __init__(self, file: Path, sweep: SweepFile) -> None:
        self._file = file
        self._parameters = [parameter.title for parameter in sweep.parameters]
        self._quantities = [quantity.name for quantity in sweep.quantities]
        self._records: list[SampleRecord] = []
        header = ["sample", "engine", "status", *self._parameters, *self._quantities, "message"]
        with writing(file):
            self._stream = file.open("w", encoding="utf-8", newline="")
            self._write(self._stream, header)

    def add(self, record: SampleRecord) -> None:
        """Append a line; it is on disk when this returns."""
        self._records.append(record)
        with writing(self._file):
            self._write(self._stream, self._line(record))

    def close(self) -> None:
        """Leave the lines in the order of samples and engines."""
        with writing(self._file):
            self._stream.close()
            header, *_ = self._file.read_text(encoding="utf-8").splitlines(keepends=True)
            ordered = self._file.with_name(self._file.name + ".ordered")
            with ordered.open("w", encoding="utf-8", newline="") as stream:
                stream.write(header)
                for record in sorted(self._records, key=lambda each: (each.sample, each.engine)):
                    self._write(stream, self._line(record))
            os.replace(ordered, self._file)

    def _line(self, record: SampleRecord) -> list[object]:
        parameters = [record.parameters[name] for name in self._parameters]
        quantities = [record.quantities.get(name, "") for name in self._quantities]
        return [record.sample, record.engine, record.status, *parameters, *quantities, record.message]

    @staticmethod
    def _write(stream: TextIO, line: Sequence[object]) -> None:
        """One line: texts are quoted, numbers in as many digits as give them back."""
        csv.writer(stream, quoting=csv.QUOTE_NONNUMERIC, lineterminator="\n").writerow(line)
        stream.flush()
