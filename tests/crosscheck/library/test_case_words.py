"""The words by which cases are meant, whoever reads them; and the table of channels, which knows each and no other."""

import dataclasses
import inspect
from argparse import Namespace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import flexmb
from crosscheck import cli
from crosscheck.cli.common import CaseWord, CaseWords
from crosscheck.engines.contract import ENERGIES, LINEAR, OUTPUTS, MarkerPath, Snapshot, Trajectory
from crosscheck.engines.linear.parts import DERIVATIVES, FREQUENCIES
from crosscheck.engines.trajectories import signals_of
from crosscheck.library.case_error import CaseError
from crosscheck.library.case_words import chosen, meant
from crosscheck.library.channels import CONSERVED, KINDS, is_judged, kind_named, known_to, part_of
from crosscheck.library.claims import claims_on
from crosscheck.library.expect_file import ExpectFile, GoalEntry
from crosscheck.library.find import resolve, shipped_names
from crosscheck.pytest_plugin.request import read_request
from flexmb.run.channels import family, unit
from flexmb.run.trajectory import Trajectory as OwnTrajectory
from tests.flexmb.surrogate.beams import beam_scene
from tests.repo.project import ROOT

TAGS = {"pendulums/double": ["chaotic"], "pendulums/plain": ["first"], "tops/heavy": ["first", "pendulums"]}


def means(*words: str) -> tuple[str, ...]:
    return chosen(words, lambda word: meant(word, TAGS, lambda: TAGS))


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (("all",), tuple(TAGS)),
        (("pendulums/double",), ("pendulums/double",)),
        (("double",), ("pendulums/double",)),
        (("pendulums/*",), ("pendulums/double", "pendulums/plain")),
        (("*/[dh]*",), ("pendulums/double", "tops/heavy")),
        (("tops",), ("tops/heavy",)),
        (("pendulums",), tuple(TAGS)),  # a family and a tag: both
        (("first",), ("pendulums/plain", "tops/heavy")),
        (("all", "!first"), ("pendulums/double",)),
        (("all", "!pendulums/*", "double"), ("tops/heavy", "pendulums/double")),
    ],
)
def test_what_words_mean(words: tuple[str, ...], names: tuple[str, ...]) -> None:
    assert means(*words) == names


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("pendulum/*",), "is a pattern of names that no case has"),
        (("penduluns",), 'did you mean "pendulums"'),
        (("!first", "all"), '"!first" leaves out nothing'),
        (("all", "!secnd"), '"secnd" is no case'),
        (("first", "!*/*"), "no case remains"),
        (("",), "is no case"),
        (("!",), "is no case"),
    ],
)
def test_words_that_mean_nothing_are_refused(words: tuple[str, ...], message: str) -> None:
    with pytest.raises(CaseError) as caught:
        means(*words)
    assert message in str(caught.value)


def test_names_and_patterns_read_no_tags() -> None:
    def tags() -> dict[str, list[str]]:
        raise AssertionError("tags are read")

    for word in ("all", "double", "pendulums/double", "tops/*"):
        assert meant(word, TAGS, tags)


def test_patterns_of_the_library() -> None:
    pendulums = tuple(name for name in shipped_names() if name.startswith("pendulums/"))
    assert tuple(case.name for case in resolve(("pendulums/*",))) == pendulums
    assert "pendulums/double" not in [case.name for case in resolve(("pendulums/*", "!double"))]


PATTERN = "no_such_family/*"
BESIDES = {"csv": ["x.csv"], "out": ["--out", "new"]}  # for what else a command demands


def readers() -> dict[str, list[str]]:
    """Every command with an argument of cases, by its annotation, with what it needs besides."""
    found = {}
    for command in cli.app.registered_commands:
        assert command.callback is not None
        hints = inspect.get_annotations(command.callback, eval_str=True)
        if any(hint in (CaseWords, CaseWord) for hint in hints.values()):
            taken = inspect.signature(command.callback).parameters.items()
            needed = [name for name, each in taken if each.default is each.empty]
            name = command.name or command.callback.__name__
            found[name] = [word for each in needed for word in BESIDES.get(each, [])]
    return found


def test_the_commands_that_take_cases_are_all_that_name_them() -> None:
    """A command that took cases by another annotation would be missed below."""
    named = {
        command.name or command.callback.__name__
        for command in cli.app.registered_commands
        if command.callback is not None and {"case", "cases"} & set(inspect.signature(command.callback).parameters)
    }
    assert named == set(readers()) >= {"run", "verify", "chart", "bench", "mutate", "invariance", "regenerate"}
    assert get_args(CaseWords)[0] == list[str]


@pytest.mark.parametrize("command", sorted(readers()))
def test_every_command_reads_patterns_alike(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(cli.app, [command, PATTERN, *readers()[command]], env={"COLUMNS": "300"})
    assert result.exit_code == 2
    assert f'"{PATTERN}" is a pattern of names that no case has' in result.output


def test_the_plug_in_the_action_and_expectations_read_patterns_alike(tmp_path: Path) -> None:
    options = Namespace(
        crosscheck=[PATTERN], crosscheck_engine=["native"], crosscheck_contract=False, crosscheck_strict=False,
        crosscheck_allow_missing=False, crosscheck_expect=None,
    )  # fmt: skip
    message = f'"{PATTERN.replace("*", "[*]")}" is a pattern of names that no case has'
    with pytest.raises(pytest.UsageError, match=message):
        read_request(options, tmp_path, "s")
    entry = GoalEntry(engine="native", cases=(PATTERN,), goals={"load": 1e-3}, reason="why")
    with pytest.raises(CaseError, match=message):
        claims_on((), {"f": ExpectFile(goals=(entry,))}, names=("a/b",), tags=lambda: {"a/b": ()}, engines=["native"])
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    script = action["runs"]["steps"][0]["run"]
    assert "crosscheck run $CASES" in script and "set +e -o pipefail -f" in script  # -f: patterns reach it


SAMPLES = 5
BY_ITEM = "loads", "total_loads", "wheel_loads", "drives", "connectors", "hinge_forces"
NAMED = {name: ("a.b",) for name in BY_ITEM}
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
    assert all(len(title) == 1 for title in titles.values()) and len(titles) == len(set.union(*titles.values()))


OTHERS = ["marker:tip.speed", "marker.position", "energy:kinetic", "energy", "works", "", "load"]


@pytest.mark.parametrize("name", OTHERS)
def test_other_names_are_no_channels(name: str) -> None:
    assert part_of(name) is None


def test_what_is_conserved_is_a_channel() -> None:
    assert set(CONSERVED.values()) <= signals_of(everything()).keys()


def test_the_outputs_of_the_contract_are_those_of_our_own_trajectories() -> None:
    """An output that one of the three lacks would be lost on its way to the judging."""
    of_runs = OUTPUTS.keys() - set(LINEAR)
    assert of_runs <= {field.name for field in dataclasses.fields(OwnTrajectory)}
    assert of_runs - {"work"} <= {field.name for field in dataclasses.fields(Snapshot)}


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
