"""`crosscheck run ... | head -1`: a command whose reader goes away goes on, and ends as if all had been read."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from crosscheck.library.find import load_case
from crosscheck.sealed.seal import read_results
from tests.crosscheck.sessions import CASE, copy_case, sweep_here
from tests.repo.project import ROOT

COMMANDS = {
    "crosscheck list": 0, "crosscheck engines --json": 0, "crosscheck report GREEN --out OUT --verbose": 0,
    "crosscheck report RED --out OUT --verbose": 1, "crosscheck report no-such-file": 2, "flexmb schema": 0,
    "flexmb check SCENE": 0, "flexmb check no-such-file": 2, "flexmb": 2,
}  # fmt: skip
ALIKE = ("crosscheck engines --json", "crosscheck report no-such-file", "flexmb schema", "flexmb check no-such-file")
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "200"}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Records of a green session and of a red one, by the words that stand for them."""
    folder = tmp_path_factory.mktemp("records")
    case = load_case(copy_case(folder))
    red = msgspec.structs.replace(case.run.comparisons[0], goals={"energy": 1e-16})
    sweep_here([case], (), folder / "green.jsonl")
    object.__setattr__(case, "run", msgspec.structs.replace(case.run, comparisons=(red, *case.run.comparisons[1:])))
    sweep_here([case], (), folder / "red.jsonl")
    return {
        "GREEN": str(folder / "green.jsonl"), "RED": str(folder / "red.jsonl"), "SCENE": str(CASE / "scene.toml"),
        "OUT": str(folder / "out"),
    }  # fmt: skip


def line_of(command: str, files: dict[str, str]) -> str:
    package, *words = (files.get(word, word) for word in command.split())
    return shlex.join([sys.executable, "-c", f"from {package}.cli import main; main()", *words])


@pytest.mark.parametrize(
    "command", [pytest.param(command, marks=pytest.mark.slow if command in ALIKE else []) for command in COMMANDS]
)
def test_nobody_reads_at_all(command: str, files: dict[str, str]) -> None:
    """Both streams are closed before the first word: the exit code is that of the command, and nothing complains."""
    line = f"({line_of(command, files)}; echo $? >&3) 3>&1 1>&4 2>&4"
    gone, writer = os.pipe()
    os.close(gone)
    done = subprocess.run(
        ["bash", "-c", line.replace("&4", f"&{writer}")], env=ENVIRONMENT, stdout=subprocess.PIPE, text=True,
        pass_fds=[writer], timeout=120,
    )  # fmt: skip
    os.close(writer)
    assert done.stdout == f"{COMMANDS[command]}\n"


@pytest.mark.parametrize(("records", "code"), [("GREEN", 0), ("RED", 1)])
def test_a_pipeline_fails_where_a_verdict_does(records: str, code: int, files: dict[str, str], tmp_path: Path) -> None:
    """As continuous integration pipes, with pipefail: all files are written though nobody reads a word.

    `head -1` would do, but may read slowly enough for all to be written before it goes.
    """
    line = line_of(f"crosscheck report {records} --out OUT --verbose", files | {"OUT": str(tmp_path)})
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", f"{line} | true"], env=ENVIRONMENT, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr, done.stdout) == (code, "", "")
    assert read_results(tmp_path / "results.json").exit_code == code
    assert (tmp_path / "report" / "index.html").exists()
