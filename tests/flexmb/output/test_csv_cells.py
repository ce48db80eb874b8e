"""Names in CSV files are no formulas of spreadsheets, and are read as they were."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from crosscheck.verify.columns import read_columns
from flexmb.output.files import as_text, from_text, plain_number, write_csv
from flexmb.sensitivity.measurements import measurements

NAMES = ("=1+1", "@SUM(A1)", "+x panel", "-y panel", "'=quoted", "''-twice", "'plain", "plain", "a=b", "")
FORMULAS = "=+-@"


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_read_as_it_was(name: str) -> None:
    assert from_text(as_text(name)) == name
    assert as_text(name)[:1] not in FORMULAS or not name


def test_tables_that_are_written_begin_no_cell_as_a_formula(tmp_path: Path) -> None:
    header = ["t [s]", *(f"{name}.position.{letter} [m]" for name in ("=cmd|x", "-y") for letter in "xyz")]
    times = np.linspace(0.0, 1.0, 9)
    write_csv(tmp_path / "table.csv", header, [[t, *range(6)] for t in times])
    with (tmp_path / "table.csv").open(newline="") as file:
        assert not [cell for cell in next(csv.reader(file)) if cell[0] in FORMULAS]
    assert measurements(tmp_path / "table.csv").channels == tuple(name.split(" [")[0] for name in header[1:])
    assert set(read_columns(tmp_path / "table.csv", times).channels) == {
        "marker:=cmd|x.position", "marker:-y.position",
    }  # fmt: skip


@pytest.mark.parametrize("cell", ["=1+1", "1_0", "inf", "0x10", "\u0661", "1,5", ""])
def test_what_is_no_plain_number_is_refused(cell: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(cell)}$"):
        plain_number(cell)
    assert plain_number(" -1.5e3 ") == -1500.0


@pytest.mark.parametrize(
    ("content", "what"),
    [(b"t,x\n0,1\n1,\xff\n", "line 3 is not UTF-8"), (b't,x\n0,1\n1,"2\n', "CSV"), (b"t,x\n0,1\n1,1_0\n", "'1_0'")],
)
def test_measurements_that_cannot_be_read_name_their_file(content: bytes, what: str, tmp_path: Path) -> None:
    (tmp_path / "ring.csv").write_bytes(content)
    with pytest.raises(ValueError, match=f"ring.csv.*{what}"):
        measurements(tmp_path / "ring.csv")
