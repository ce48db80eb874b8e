"""One writer in a folder: a second is refused at once, and told who is there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.records.lock import FolderInUseError, locked
from tests.crosscheck.sessions import CASE

HOLD = "import sys; from pathlib import Path; from crosscheck.records.lock import locked\nwith locked(Path(sys.argv[1])):\n print('in', flush=True); sys.stdin.read()"  # fmt: skip  # noqa: E501


@pytest.fixture
def held(tmp_path: Path):
    """A folder that another process holds."""
    words = [sys.executable, "-c", HOLD, str(tmp_path)]
    path = os.pathsep.join(each for each in sys.path if each)
    with subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": path}
    ) as process:
        assert process.stdout is not None and process.stdout.readline() == b"in\n"
        yield tmp_path, process
        process.kill()


@pytest.mark.parametrize(
    "words",
    [
        ["run", str(CASE)],
        ["run", str(CASE), "--fresh"],
        ["stability", "free_spin"],
        ["stability", "free_spin", "--fresh"],
        ["report", "RECORDS"],
    ],
)
def test_a_second_writer_is_refused_with_who_is_there(held, words: list[str]) -> None:
    folder, process = held
    records = folder / "records.jsonl"
    records.write_text("", encoding="utf-8")
    found = [str(records) if word == "RECORDS" else word for word in words]
    result = CliRunner().invoke(cli.app, [*found, "--out", str(folder)], env={"COLUMNS": "300"})
    assert result.exit_code == 2, result.output
    assert f"is in use by process {process.pid} since 20" in result.output.replace("\n", "")
    assert {file.name for file in folder.iterdir()} == {"records.jsonl", ".crosscheck.lock", ".crosscheck.holder"}


def test_the_lock_of_a_killed_process_is_gone(held) -> None:
    folder, process = held
    with pytest.raises(FolderInUseError), locked(folder):
        pass
    process.kill()
    process.wait()
    with locked(folder):
        assert (folder / ".crosscheck.holder").read_text(encoding="utf-8").startswith(f"process {os.getpid()} since")


def test_one_after_the_other_is_fine(tmp_path: Path) -> None:
    for _ in range(2):
        with locked(tmp_path / "new"):
            pass
