"""Records: exact numbers, one line each, readable after a kill."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crosscheck.records import Archive, RunRecord, environment, pack, read, unpack


def record(effort: str) -> RunRecord:
    values = np.random.default_rng(1).normal(size=(7, 3))
    return RunRecord(
        case="a/b",
        variant="v",
        role="main",
        engine="e",
        version="1",
        scene="s",
        status="finished",
        effort=effort,
        times=pack(np.arange(7.0)),
        channels={"marker:tip.position": pack(values)},
    )


def test_packing_is_exact() -> None:
    values = np.array([[np.pi, -0.0, np.inf], [np.nan, 5e-324, 1.0 / 3.0]])
    assert unpack(pack(values)).tobytes() == values.tobytes()
    assert unpack(pack(values)).shape == (2, 3)


def test_a_broken_end_is_skipped_and_then_cut_off(tmp_path: Path) -> None:
    file = tmp_path / "records.jsonl"
    archive = Archive(file)
    for item in (environment(), record("one"), record("two")):
        archive.write(item)
    archive.close()
    whole = file.read_bytes()
    file.write_bytes(whole[:-40])
    assert [item.effort for item in read(file) if isinstance(item, RunRecord)] == ["one"]
    archive = Archive(file)
    archive.write(record("three"))
    archive.close()
    assert [item.effort for item in read(file) if isinstance(item, RunRecord)] == ["one", "three"]


def test_a_wrong_line_is_named(tmp_path: Path) -> None:
    file = tmp_path / "records.jsonl"
    file.write_text('{"record": "run", "case": 3}\n', encoding="utf-8")
    with pytest.raises(ValueError, match="line 1"):
        read(file)


def test_the_environment_names_machine_and_versions() -> None:
    found = environment()
    assert found.processor
    assert found.packages["numpy"] == np.__version__
