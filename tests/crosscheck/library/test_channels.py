"""The table of channels says of every channel of a trajectory what it is, and of none that no trajectory has."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import flexmb
from crosscheck.engines.contract import ENERGIES, LINEAR, OUTPUTS, MarkerPath, Snapshot, Trajectory
from crosscheck.engines.linear.parts import DERIVATIVES, FREQUENCIES
from crosscheck.engines.signals import signals_of
from crosscheck.library.channels import CONSERVED, KINDS, is_judged, kind_named, known_to, part_of
from flexmb.run.channels import family, unit
from flexmb.run.trajectory import Trajectory as OwnTrajectory
from tests.flexmb.surrogate.beams import beam_scene

SAMPLES = 5
NAMED = {name: ("a.b",) for name in ("loads", "wheel_loads", "drives", "connectors", "hinge_forces")}
NAMED |= {"energy": ENERGIES, "derivatives": DERIVATIVES, "known_to": (*DERIVATIVES, FREQUENCIES)}


def everything() -> Trajectory:
    """A run with every output of the contract; the name of its items holds a dot."""
    outputs: dict[str, object] = {}
    for name, columns in OUTPUTS.items():
        values = np.ones((SAMPLES, *(2 if n is None else n for n in columns)))
        items = NAMED.get(name, ())
        outputs[name] = {item: values for item in items} if items else values
    path = MarkerPath(np.ones((SAMPLES, 3)), np.ones((SAMPLES, 4)), np.ones((SAMPLES, 6)))
    return Trajectory("finished", "", np.arange(float(SAMPLES)), {"a.b": path}, **outputs)


def test_every_channel_is_in_the_table_with_its_width_and_every_entry_is_a_channel() -> None:
    found = signals_of(everything())
    parts = {name: part_of(name) for name in found}
    for name, part in parts.items():
        assert part is not None and part.width in (None, found[name].shape[1]), name
    assert len(found) == sum(len(kind.parts) for kind in KINDS)
    assert {id(part) for part in parts.values()} == {id(part) for kind in KINDS for part in kind.parts}


def test_channels_of_one_family_have_one_title_and_one_unit() -> None:
    titles: dict[str, set[str]] = {}
    for name in signals_of(everything()):
        part = part_of(name)
        titles.setdefault(family(name), set()).add(part.title)
        if part.unit:
            assert part.unit.replace(" ", "").replace("1", "rad") == unit(name), name
    assert all(len(each) == 1 for each in titles.values()) and len(titles) == len(set.union(*titles.values()))


OTHERS = ["marker:tip.speed", "marker.position", "energy:kinetic", "energy", "works", "", "load"]


@pytest.mark.parametrize("name", OTHERS)
def test_other_names_are_no_channels(name: str) -> None:
    assert part_of(name) is None


def test_what_is_conserved_is_a_channel() -> None:
    assert set(CONSERVED.values()) <= signals_of(everything()).keys()


def test_the_outputs_of_the_contract_are_those_of_our_own_trajectories() -> None:
    """An output that one of the three lacks would be lost on its way to the judging."""
    of_runs = OUTPUTS.keys() - set(LINEAR)
    assert of_runs <= {each.name for each in dataclasses.fields(OwnTrajectory)}
    assert of_runs - {"work"} <= {each.name for each in dataclasses.fields(Snapshot)}


def test_what_an_engine_says_of_its_own_derivatives_is_a_channel_that_nobody_judges() -> None:
    found = signals_of(everything())
    told = {name for name in found if not is_judged(name)}
    assert told == {known_to(name) for name in found if name.startswith(("derivatives.", FREQUENCIES))}
    assert len(told) == 4 and not any(known_to(name) in found for name in told)


def test_the_columns_of_our_own_files_are_those_of_the_table(tmp_path: Path) -> None:
    """`trajectory.csv` calls vectors and units as the table says, or they could not be verified."""
    file = tmp_path / "trajectory.csv"
    flexmb.simulate(beam_scene(), 1e-3, samples=2).to_csv(file)
    header = file.read_text(encoding="utf-8").splitlines()[0].split(",")
    for part in (*kind_named("marker").parts, *kind_named("load").parts):
        ending = f".{part.own}.{'w' if part.width == 4 else 'x'} [{part.unit}]"
        assert any(name.endswith(ending) for name in header), ending
