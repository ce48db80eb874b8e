"""An engine that joins a case is judged in every channel that the case's own engines are: spoiled ones, kind by kind.

The engine is native under another name, spoiled in its records in one channel at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np
import pytest

from crosscheck.engines.registry import PROVIDER
from crosscheck.judging.outcome import SessionOutcome, conclude
from crosscheck.judging.results import collect
from crosscheck.library.channels import LINEAR_KINDS, is_judged, part_of
from crosscheck.library.find import load_case, shipped_folder
from crosscheck.records.archive import read
from crosscheck.records.kinds import CaseRecord, RunRecord
from crosscheck.records.packing import Packed, pack, unpack
from crosscheck.running.plan import plan
from flexmb.typing import Real
from tests.crosscheck.sessions import run_here

MINE = "mine"
SPOILED: dict[str, Callable[[Real], Real]] = {
    "reversed": lambda values: -values, "zero": np.zeros_like, "doubled": lambda values: 2.0 * values,
    "off by one": lambda values: values + 1.0,
}  # fmt: skip
LINEARISED = tuple(sorted(f"linearised/{folder.name}" for folder in (shipped_folder() / "linearised").iterdir()))
ROUNDING = 1e-9  # SI: a channel that is zero up to it cannot be told from its negative
OTHERS = ("pendulums/compound", "tops/sleeping")


@cache
def session(name: str) -> tuple[CaseRecord, tuple[RunRecord, ...]]:
    """The record of a case that an engine joins, and native's runs of it."""
    asked = ("native", MINE)
    record, jobs = plan(load_case(shipped_folder() / name), asked, PROVIDER)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "records.jsonl"
        run_here([(record, [job for job in jobs if job.engine == "native"])], asked, file)
        return record, tuple(each for each in read(file) if isinstance(each, RunRecord))


def joined(name: str, spoil: Callable[[str, Packed], Packed] = lambda channel, packed: packed) -> SessionOutcome:
    """The strict outcome of a session of native and a spoiled copy of it."""
    record, runs = session(name)
    copies = [
        msgspec.structs.replace(
            run, engine=MINE, channels={channel: spoil(channel, packed) for channel, packed in run.channels.items()}
        )
        for run in runs
        if run.role == "main"
    ]
    return conclude(collect([record, *runs, *copies]), strict=True)


def spoilt(name: str, channel: str) -> list[str]:
    """The ways of spoiling a channel that change it, and are not noticed."""
    _, runs = session(name)
    unnoticed = []
    for how, change in SPOILED.items():

        def spoil(each: str, packed: Packed, change: Callable[[Real], Real] = change) -> Packed:
            return pack(change(unpack(packed))) if each == channel else packed

        changes = any(np.max(np.abs(change(values) - values)) > ROUNDING for values in _values(runs, channel))
        changes = changes and not (how == "reversed" and channel.endswith(".orientation"))  # it is the same one
        if changes and joined(name, spoil).ok:
            unnoticed.append(how)
    return unnoticed


def _values(runs: Sequence[RunRecord], channel: str) -> list[Real]:
    return [unpack(run.channels[channel]) for run in runs if run.role == "main" and channel in run.channels]


def channels(name: str) -> list[str]:
    """The channels that native offers in the variants that it runs."""
    _, runs = session(name)
    return sorted({channel for run in runs if run.role == "main" for channel in run.channels if is_judged(channel)})


@pytest.mark.parametrize("name", [*LINEARISED, *OTHERS])
def test_a_wrong_derivative_of_an_engine_that_joins_is_noticed(name: str) -> None:
    assert joined(name).ok, joined(name).headline
    linear = [channel for channel in channels(name) if channel.startswith(LINEAR_KINDS)]
    assert len(linear) == 4
    assert {channel: spoilt(name, channel) for channel in linear} == {channel: [] for channel in linear}


@pytest.mark.parametrize("name", [*LINEARISED, *OTHERS])
def test_a_wrong_channel_of_an_engine_that_joins_is_noticed(name: str) -> None:
    """One of each part of each kind, in a strict session also where the case has no goal: it is held against others."""
    others = [channel for channel in channels(name) if not channel.startswith(LINEAR_KINDS)]
    each = {part_of(channel): channel for channel in others}.values()
    assert {channel: spoilt(name, channel) for channel in each} == {channel: [] for channel in each}
