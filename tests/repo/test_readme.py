"""The README's quick start is two commands that do all their own set-up and name options that exist."""

import re
from typing import Any

import pytest
from typer.main import get_command

from crosscheck.cli import app
from tests.repo.project import PYPROJECT, ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
QUICK_START = README.partition("## Quick start")[2].partition("\n## ")[0]
COMMANDS = [block.strip() for block in re.findall(r"```sh\n(.*?)```", QUICK_START, flags=re.DOTALL)]


def test_exactly_two_commands() -> None:
    assert len(COMMANDS) == 2
    assert all(len(command.splitlines()) == 1 for command in COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_command_sets_itself_up(command: str) -> None:
    """Every program it starts is `python3` or something the command has put into .venv before."""
    steps = [re.sub(r"^([A-Z_]+=\S+ )+", "", step).split()[0] for step in command.split(" && ")]
    assert steps[0] == "python3"
    assert all(step.startswith(".venv/bin/") for step in steps[1:])
    extras = re.search(r"'\.\[(.*?)\]'", command)
    assert extras is not None
    assert set(extras[1].split(",")) <= set(PYPROJECT["project"]["optional-dependencies"])


def test_crosscheck_options_exist() -> None:
    words = COMMANDS[0].rpartition(".venv/bin/crosscheck ")[2].split()
    run = get_command(app).commands[words[0]]  # type: ignore[attr-defined]
    options = {name for parameter in run.params for name in parameter.opts}
    assert {word for word in words if word.startswith("--")} <= options


CONTINUOUS_INTEGRATION = (ROOT / ".ci" / "run").read_text(encoding="utf-8")


def test_the_test_command_is_what_continuous_integration_runs() -> None:
    (pattern,) = re.findall(r'grep -E "(.*)" README.md', CONTINUOUS_INTEGRATION)
    assert [line for line in README.splitlines() if re.search(pattern, line)] == [COMMANDS[1]]


def test_continuous_integration_leaves_no_tests_out() -> None:
    """What the command gets on the sources is what the suite on the wheel leaves out, and its words are the same."""
    (sources,) = re.findall(r'^step .*"\$\{command##\* && \} (\S+)" ', CONTINUOUS_INTEGRATION, flags=re.MULTILINE)
    (left_out,) = re.findall(r"--ignore=(\S+) \|\|", CONTINUOUS_INTEGRATION)
    assert sources == left_out and (ROOT / sources).is_dir()
    (start,) = re.findall(r"^words=\$\{command##\*(\S+) \}", CONTINUOUS_INTEGRATION, flags=re.MULTILINE)
    assert COMMANDS[1].rpartition(f"{start} ")[2].startswith("-m pytest ")


PAGES = ("README.md", "CONTRIBUTING.md", "SECURITY.md", "CODE_OF_CONDUCT.md", "examples/README.md")


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_somewhere(name: str) -> None:
    """Those to files; the site's build checks the pages of docs."""
    page = ROOT / name
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    assert not [link for link in links if not (page.parent / link).exists()]


def test_the_python_examples_run() -> None:
    """One after the other, as a reader would type them."""
    names: dict[str, Any] = {}
    for example in re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL):
        exec(compile(example, "README.md", "exec"), names)
    assert names["run"].t[-1] == 1.0
    assert names["loads"].shape == (6,)


READ_A_MINUTE = 240  # words of prose, silently, by adults (Brysbaert 2019: 238)


def minutes(page: str) -> float:
    """Time to read the prose of a page: without blocks of code, and of links the words alone."""
    prose = re.sub(r"```.*?```", "", page, flags=re.DOTALL)
    words = re.sub(r"\]\([^)]*\)", "]", prose)
    return len(re.findall(r"[A-Za-z][\w'.-]*", words)) / READ_A_MINUTE


def test_it_is_read_in_two_minutes_and_its_tables_in_half_of_one() -> None:
    table = "\n".join(line for line in README.splitlines() if line.startswith("|"))
    assert minutes(README.replace(table, "")) <= 2.0 and minutes(table) <= 0.5
    assert minutes(README + README) > 2.5  # a longer one is noticed
