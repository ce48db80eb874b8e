"""Every block of Python and of shell in the documentation runs, or says why not; its options exist in any case."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from typer.main import get_command

import crosscheck.cli
import flexmb.cli
from tests.repo.project import ROOT
from tests.repo.snippets import PAGES, Snippet, snippets

RUN = ("python", "sh")
COMMANDS = {"crosscheck": get_command(crosscheck.cli.app), "flexmb": get_command(flexmb.cli.app)}
MOST_S = 120.0
WITH_CODE = [page for page in PAGES if any(snippet.language in RUN and not snippet.why for snippet in snippets(page))]


@pytest.mark.filterwarnings("error:.*more than its points can follow")  # an example would teach it
@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_page_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One block after the other, in a folder that has the cases; Python's blocks see the names of those before them."""
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "__main__"}
    for snippet in snippets(page):
        if snippet.language == "python" and not snippet.why:
            blank = "\n" * (snippet.line - 1)  # so that a traceback shows the line of the page
            exec(compile(blank + snippet.code, str(page), "exec"), names)
        elif snippet.language == "sh" and not snippet.why:
            _in_shell(snippet)


def _in_shell(snippet: Snippet) -> None:
    programs = str(Path(sys.executable).parent)
    environment = os.environ | {"PATH": f"{programs}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    command = ["bash", "-euo", "pipefail", "-c", snippet.code]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=MOST_S)
    assert done.returncode == 0, f"{snippet.page}:{snippet.line}\n{done.stdout}\n{done.stderr}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_and_options_exist(page: Path) -> None:
    """Of all blocks, those that are not run above all."""
    for snippet in snippets(page):
        if snippet.language == "sh":
            for line in snippet.code.replace("\\\n", " ").splitlines():
                if line.startswith(tuple(COMMANDS)):
                    _check(snippet, shlex.split(line, comments=True))


def _check(snippet: Snippet, words: list[str]) -> None:
    program = words[0]
    commands = COMMANDS[program].commands  # type: ignore[attr-defined]
    assert len(words) < 2 or words[1].startswith("-") or words[1] in commands, f"{snippet.page}: {words}"
    if len(words) > 1 and words[1] in commands:
        known = {"--help"}.union(*(param.opts + param.secondary_opts for param in commands[words[1]].params))
        asked = {word.partition("=")[0] for word in words[2:] if re.match(r"--?[a-z]", word)}
        assert asked <= known, f"{snippet.page}:{snippet.line}: {words[1]} has no {asked - known}"


def test_a_wrong_option_and_a_failing_block_are_noticed() -> None:
    page = PAGES[0]
    with pytest.raises(AssertionError, match="has no"):
        _check(Snippet(page, 1, "sh", "", ""), ["crosscheck", "run", "--quick"])
    with pytest.raises(AssertionError, match="docs"):
        _in_shell(Snippet(page, 1, "sh", "crosscheck run nowhere", ""))


def test_a_block_says_why_it_is_not_run(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("<!-- not run: takes an hour -->\n```sh\nsleep 3600\n```\n\n```python\n1 / 0\n```\n")
    first, second = snippets(page)
    assert (first.why, first.language, first.code, first.line) == ("takes an hour", "sh", "sleep 3600\n", 3)
    assert (second.why, second.language) == ("", "python")
