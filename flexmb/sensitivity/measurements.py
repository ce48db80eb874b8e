"""Measurements over time: a table of channels, from arrays or a CSV file as `Trajectory.to_csv` writes it."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexmb.output.files import from_text, plain_number
from flexmb.scene.reading import MIB, Unreadable, read_text
from flexmb.tables import arguments
from flexmb.typing import Real

TIME = "t"
LIMIT = 128 * MIB


class Measurements(NamedTuple):
    """t (T,) s, increasing, from 0 on; values (T,K) of the channels (K,), NaN where nothing was measured."""

    t: Real
    channels: tuple[str, ...]
    values: Real


def measurements(data: str | os.PathLike[str] | Mapping[str, Any]) -> Measurements:
    """The measurements in a file, or in arrays by name with the times as "t"; ValueError or TypeError for others."""
    if isinstance(data, Mapping):
        return _checked(
            "data", {str(name): arguments.array(f'data["{name}"]', column) for name, column in data.items()}
        )
    return _checked(str(data), _read(Path(data)))


def _read(path: Path) -> dict[str, Real]:
    """Columns of a CSV file by the names in its header, without units in brackets after a space."""
    try:
        reader = csv.reader(io.StringIO(read_text(path, LIMIT), newline=""), strict=True)
        rows = [(reader.line_num, row) for row in reader if row]
    except (Unreadable, csv.Error) as error:
        raise ValueError(f"{path}: it cannot be read as a CSV file: {error}") from None
    if len(rows) < 2:
        raise ValueError(f"{path}: there are no measurements: give a header and at least one row")
    names = [from_text(cell.strip()).split(" [")[0] for cell in rows[0][1]]
    if len(set(names)) < len(names):
        raise ValueError(f"{path}: two columns have one name in {', '.join(names):.200}")
    values = np.full((len(rows) - 1, len(names)), np.nan)
    for i, (line, row) in enumerate(rows[1:]):
        if len(row) != len(names):
            raise ValueError(f"{path}: line {line} has {len(row)} cells, but the header {len(names)}")
        for j, cell in enumerate(row):
            if cell.strip():
                try:
                    values[i, j] = plain_number(cell)
                except ValueError:
                    what = f"line {line} has {cell!r:.60} in column {names[j]:.60}"
                    raise ValueError(f"{path}: {what}: give numbers such as -1.25e-3") from None
    return dict(zip(names, values.T, strict=True))


def _checked(where: str, columns: dict[str, Real]) -> Measurements:
    if TIME not in columns:
        raise ValueError(f'{where}: there is no column "{TIME}" with the times in s: there are {", ".join(columns)}')
    t = columns.pop(TIME)
    if not columns:
        raise ValueError(f"{where}: there are times, but no channels")
    if (
        t.ndim != 1
        or not np.isfinite(t).all()
        or np.any(np.diff(t) <= 0.0)
        or len(t) == 0
        or t[0] < 0.0
        or t[-1] <= 0.0
    ):
        raise ValueError(f"{where}: the times must be finite and increase, from 0 s on, where the run starts")
    for name, column in columns.items():
        if column.shape != t.shape:
            raise ValueError(f'{where}: "{name}" has the shape {column.shape}, but there are {len(t)} times')
        if np.isinf(column).any():
            raise ValueError(f'{where}: "{name}" has infinite values: leave out what was not measured')
        if np.isnan(column).all():
            raise ValueError(f'{where}: "{name}" has no values')
    return Measurements(t.astype(float), tuple(columns), np.column_stack(list(columns.values())))
