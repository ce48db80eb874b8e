"""Records: everything a crosscheck run finds out, one JSON object a line, written as it comes.

A file of records is the archive: verdicts and report are made from it alone, with no engine installed. Signals are
stored as float64, deflated and in base64, so that replaying a verdict gives the same digits. A run that was killed
leaves at most one broken line at the end, which reading skips and resuming cuts off. Any other line that is no record
is read as a `BrokenLine`, which names it: what it held counts as lost, and a session that has one is never as expected.
Resuming moves such lines to a file of their own, and runs again what they held.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import msgspec

from crosscheck.engines.extremes import ROWS, has_extremes, width
from crosscheck.library.channels import part_of
from crosscheck.library.check import check_recorded
from crosscheck.records.kinds import BrokenLine, CaseRecord, ChartRecord, Record, RecordedReference, RunRecord, Written
from crosscheck.records.packing import Packed, packed_bytes, unpack
from flexmb.output.files import folder, whole_file, writing
from flexmb.scene.reading import MIB, allowance, regular_size

T = TypeVar("T")
LONGEST_LINE = 128 * MIB  # a hundred markers at ten thousand times fit


class BrokenRecords(UserWarning):
    """Lines were set aside from a file of records."""


class Archive:
    """A records file open for appending; a record is flushed to the file when `write` returns."""

    def __init__(self, file: Path, kind: Any = Written) -> None:
        """`kind` is the type of the file's records; other lines are moved to another file (BrokenRecords)."""
        folder(file.parent)
        self._file = file
        _set_broken_lines_aside(file, kind)
        self._stream = file.open("ab")
        self._encoder = msgspec.json.Encoder()

    def write(self, record: msgspec.Struct) -> None:
        with writing(self._file):
            self._stream.write(self._encoder.encode(record) + b"\n")
            self._stream.flush()

    def close(self) -> None:
        with writing(self._file):
            self._stream.close()


def read(file: Path) -> list[Record]:
    """All records of a file, in order; an incomplete last line is skipped, an invalid line becomes a BrokenLine.

    The records returned are consistent: arrays can be unpacked, cases can be run. OSError if the file cannot be read.
    """
    return decoded_lines(file, Written)


def decoded_lines(file: Path, kind: Any) -> list[Any]:
    """`read` for records of any tagged struct or union of them."""
    decoder = msgspec.json.Decoder(kind)
    left = allowance(regular_size(file))
    records: list[Any] = []
    with file.open("rb") as stream:
        for number, line in enumerate(_lines(stream), start=1):
            try:
                record = decoder.decode(line)
                left -= _checked(record, left)
            except (ValueError, RecursionError) as error:  # broken JSON, another schema, text that is not UTF-8
                record = BrokenLine(str(file), number, _reason(error, line))
            records.append(record)
    return records


def _reason(error: Exception, line: bytes) -> str:
    """What is wrong with a line, in words for whoever has the file."""
    if isinstance(error, RecursionError):
        return "its brackets are nested too deeply"
    try:
        line.decode()
    except UnicodeDecodeError as found:  # an error of the decoder counts from the start of a text inside the line
        return f"it is not UTF-8 (byte 0x{line[found.start]:02x} is byte {found.start + 1} of the line)"
    return str(error)


def _lines(stream: BinaryIO) -> Iterator[bytes]:
    """Complete lines; of a line longer than LONGEST_LINE only its beginning, which is not a valid record."""
    begun = b""
    while piece := stream.readline(LONGEST_LINE):
        begun = begun[:80] or piece
        if piece.endswith(b"\n"):
            yield begun
            begun = b""


def _checked(record: Any, limit: int) -> int:
    """Bytes of memory that a record's arrays need; ValueError if it is inconsistent or they exceed `limit`."""
    if isinstance(record, CaseRecord):
        check_recorded(record.run)
        if record.variants.keys() != {variant.name for variant in record.run.variants}:
            raise ValueError("its variants are not those of its run file")
        return 0 if record.reference is None else _checked_arrays(_arrays(record.reference), limit)
    if isinstance(record, ChartRecord):
        return sum(_checked(run, limit) for run in record.runs)
    if not isinstance(record, RunRecord):
        return 0
    sized = 0.0 < record.effort_value < math.inf or (record.effort_value == 0.0 and record.rungs < 2)
    if not (0 <= record.rung <= max(record.rungs - 1, 0) and sized):
        raise ValueError(f"effort {record.effort_value} on rung {record.rung} of {record.rungs} is none")
    _check_shapes(record)
    envelope = {f"envelope of {name}": packed for name, packed in record.envelope.items()}
    return _checked_arrays({**_arrays(record), **envelope}, limit)


def _arrays(record: RunRecord | RecordedReference) -> dict[str, Packed]:
    """All arrays by name, for messages."""
    return {**record.channels, **({} if record.times is None else {"times": record.times})}


def _checked_arrays(arrays: Mapping[str, Packed], limit: int) -> int:
    """Bytes of memory that arrays need; ValueError, with its name, if one is damaged, or if they exceed `limit`."""
    size = sum(_named(name, packed_bytes, packed) for name, packed in arrays.items())
    if size > limit:
        raise ValueError(f"its arrays would take {size / MIB:.3g} MiB, more than a file of this size can hold")
    for name, packed in arrays.items():
        _named(name, unpack, packed)
    return size


def _named(name: str, read: Callable[[Packed], T], packed: Packed) -> T:
    """What is read from an array; a ValueError tells which array it is."""
    try:
        return read(packed)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _check_shapes(record: RunRecord) -> None:
    """Every channel must be an array (T, k) at T times; ValueError names one that is not."""
    rows = None if record.times is None else record.times.shape
    if record.status == "finished" and not (rows and rows[0]):
        raise ValueError("it is finished but has no times")
    if rows is not None and len(rows) != 1:
        raise ValueError(f"its times have the shape {rows}")
    for name, packed in record.channels.items():
        if rows is None or len(packed.shape) != 2 or packed.shape[:1] != rows or packed.shape[1] == 0:
            raise ValueError(f"{name} of shape {packed.shape} does not belong to times of shape {rows}")
        part = part_of(name)
        if part is None:
            raise ValueError(f'there is no channel "{name}"')
        if part.width not in (None, packed.shape[1]):
            raise ValueError(f"{name} has {packed.shape[1]} columns")
    for name, packed in record.envelope.items():
        part = part_of(name)
        if part is None or not has_extremes(name):
            raise ValueError(f'there is no envelope of a channel "{name}"')
        columns = None if part.width is None else width(name, part.width)
        if len(packed.shape) != 2 or packed.shape[0] != ROWS or packed.shape[1] != (columns or packed.shape[1]):
            raise ValueError(f"the envelope of {name} has the shape {packed.shape}")


def _set_broken_lines_aside(file: Path, kind: Any) -> None:
    """Leave only valid records in a file; broken lines move to `<file>.broken`, with a warning.

    An incomplete last line, which a killed session leaves, is removed without a warning.
    """
    if not file.exists():
        return
    broken = {record.number: record for record in decoded_lines(file, kind) if isinstance(record, BrokenLine)}
    if not broken and _ended(file):
        return
    aside = file.with_name(file.name + ".broken")
    with whole_file(file) as kept, file.open("rb") as stream, kept.open("wb") as whole:
        for number, line in enumerate(stream, start=1):
            if number in broken:
                with aside.open("ab") as lost:
                    lost.write(line)
            elif line.endswith(b"\n"):
                whole.write(line)
    for trouble in broken.values():
        warnings.warn(f"{trouble}; moved to {aside.name}, and what it held is run again", BrokenRecords, stacklevel=3)


def _ended(file: Path) -> bool:
    """Whether the last line is whole."""
    with file.open("rb") as stream:
        stream.seek(max(0, stream.seek(0, os.SEEK_END) - 1))
        return stream.read() in (b"", b"\n")
