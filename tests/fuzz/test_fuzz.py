"""Mutated files of every kind: refused in words or read as they stand, in bounded time and memory."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from crosscheck.verify.columns import Columns
from tests.fuzz import kinds as subject
from tests.fuzz.campaign import campaign, table
from tests.fuzz.worker import BAD, content, read

MUTANTS = 1000  # some forty of each kind
BY_LINES = {"records", "map records"}  # a broken line is set aside, and a file hardly ever refused


def test_no_mutant_is_bad(tmp_path: Path) -> None:
    """A run on request: python -m tests.fuzz --mutants 50000."""
    results = campaign(MUTANTS, seed=1, workers=min(2, os.cpu_count() or 1), keep=tmp_path / "bad")
    bad = [each for each in results if each["outcome"] in BAD]
    assert not bad, f"\n{table(results)}\n" + "\n".join(f"{each['kind']} {each['number']}: {each}" for each in bad[:10])
    assert len(results) == MUTANTS
    for kind in {result["kind"] for result in results}:  # a kind whose mutants all come out alike is not tested
        outcomes = {result["outcome"] for result in results if result["kind"] == kind}
        assert outcomes >= ({"accepted"} if kind in BY_LINES else {"refused", "accepted"}), kind


@pytest.fixture(scope="module")
def kinds(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, subject.Kind]]:
    folder = tmp_path_factory.mktemp("kinds")
    return folder, subject.kinds(folder)


def test_every_seed_is_accepted(kinds: tuple[Path, dict[str, subject.Kind]]) -> None:
    folder, found = kinds
    for name, kind in found.items():
        for seed in kind.seeds:
            (folder / kind.file).write_bytes(seed)
            assert read(kind, folder / kind.file) == ("accepted", ""), name
        subject._prepare(folder)


def columns_by(columns: Columns, change: Callable[..., object]) -> Columns:
    return Columns({name: change(values) for name, values in columns.channels.items()})


def first(channels: dict[str, object]) -> dict[str, object]:
    return dict(list(channels.items())[:1])


PLANTED: dict[str, tuple[str, str, Callable[..., object]]] = {
    "a name that changes": ("scene", "load_scene", lambda scene: msgspec.structs.replace(scene, name="x")),
    "a NaN that passes": ("verify csv", "read_columns", lambda columns: columns_by(columns, lambda v: v * np.nan)),
    "a number that is rounded": ("verify csv", "read_columns", lambda columns: columns_by(columns, np.round)),
    "a channel that is dropped": ("verify csv", "read_columns", lambda columns: Columns(first(columns.channels))),
    "a record that is dropped": ("records", "read", lambda records: records[:-1]),
    "a line that is taken for another": ("records", "read", lambda records: [*records[:-1], records[-2]]),
    "an array that is cut": ("npz", "modal_arrays", lambda arrays: arrays._replace(mass=arrays.mass[:-1])),
}


@pytest.mark.parametrize("fault", PLANTED)
def test_a_planted_fault_is_seen(kinds, monkeypatch: pytest.MonkeyPatch, fault: str) -> None:
    folder, found = kinds
    name, reader, spoil = PLANTED[fault]
    true = getattr(subject, reader)
    monkeypatch.setattr(subject, reader, lambda *words: spoil(true(*words)))
    kind = found[name]
    (folder / kind.file).write_bytes(kind.seeds[0])
    assert read(kind, folder / kind.file)[0] == "wrong accept"


def _hang() -> None:
    while True:
        pass


def _raise() -> None:
    raise KeyError("x")


def _bare() -> None:
    raise subject.SceneError("", [])


@pytest.mark.parametrize(("does", "outcome"), [(_hang, "hang"), (_raise, "traceback"), (_bare, "no file named")])
def test_a_reader_that_misbehaves_is_seen(kinds, monkeypatch: pytest.MonkeyPatch, does, outcome: str) -> None:
    monkeypatch.setattr("tests.fuzz.worker.ALARM_S", 1)
    folder, found = kinds
    spoiled = replace(found["scene"], accept=lambda path: does(), place="")
    assert read(spoiled, folder / "scene.toml")[0] == outcome


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_mutants_of_archives_are_whole_archives(kinds) -> None:
    """Else all that is tested is the checksum."""
    folder, found = kinds
    kind, whole = found["npz"], 0
    for number in range(40):
        _, data = content(kind, "npz", 1, number)
        if isinstance(data, bytes):
            (folder / "probe.npz").write_bytes(data)
            whole += zipfile.is_zipfile(folder / "probe.npz")
    assert whole > 20
