"""The words by which cases are meant: one grammar, whoever reads them."""

from __future__ import annotations

import inspect
from argparse import Namespace
from pathlib import Path
from typing import get_args

import pytest
import yaml
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.cli.common import CaseWord, CaseWords
from crosscheck.library.case_error import CaseError
from crosscheck.library.case_words import chosen, meant
from crosscheck.library.claims import claims_on
from crosscheck.library.expect_file import ExpectFile, GoalEntry
from crosscheck.library.find import resolve, shipped_names
from crosscheck.pytest_plugin.request import read_request
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
