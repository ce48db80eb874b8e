"""Folders in which nothing can be written and full disks: one line each, and no result is lost."""

import errno
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.records import archive as archive_module
from crosscheck.records.archive import Archive, read
from crosscheck.records.kinds import RunRecord
from crosscheck.report import ci
from flexmb import cli as flexmb_cli
from flexmb.output.files import check_folder
from tests.crosscheck.sessions import CASE, sweep_here

WIDE = {"COLUMNS": "200"}
SCENE = str(CASE / "scene.toml")
COMMANDS = {
    "crosscheck run": (cli.app, ["run", str(CASE), "--out"]),
    "crosscheck stability": (cli.app, ["stability", "definiteness", "--depth", "0", "--out"]),
    "flexmb simulate": (flexmb_cli.app, ["simulate", SCENE, "--t-end", "0.1", "--out"]),
    "flexmb advise": (flexmb_cli.app, ["advise", SCENE, "--out"]),
    "flexmb vibrate": (flexmb_cli.app, ["vibrate", SCENE, "--density", "1:1,2:1", "--picture"]),
    "flexmb view": (flexmb_cli.app, ["view", SCENE, "--out"]),
    "flexmb campbell": (flexmb_cli.app, ["campbell", SCENE, "pivot", "--rates", "0:1:2", "--picture"]),
}
FILES = ("advise", "campbell", "vibrate", "view")  # these write one file, whose folder is asked for


@pytest.fixture
def runner(monkeypatch: pytest.MonkeyPatch) -> CliRunner:
    monkeypatch.setattr("crosscheck.running.sweep.sweep", sweep_here)
    return CliRunner()


def is_one_line(result, path: str) -> None:
    assert result.exit_code == 2, (result.output, result.exception)
    (line,) = result.output.strip().splitlines()
    assert path in line
    assert "Traceback" not in line and "[Errno" not in line


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("below", [".", "deeper"])
def test_an_out_path_with_a_file_in_the_way_is_one_line(
    runner: CliRunner, tmp_path: Path, command: str, below: str
) -> None:
    (tmp_path / "taken").write_text("mine", encoding="utf-8")
    app, words = COMMANDS[command]
    file = "file.html" if command.endswith("view") else "file.png"
    given = tmp_path / "taken" / below / (file if command.endswith(FILES) else ".")
    is_one_line(runner.invoke(app, [*words, str(given)], env=WIDE), str(tmp_path / "taken"))
    assert (tmp_path / "taken").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("command", ["crosscheck run", "crosscheck stability"])
def test_a_file_system_that_takes_no_folders_is_one_line(runner: CliRunner, command: str) -> None:
    app, words = COMMANDS[command]
    is_one_line(runner.invoke(app, [*words, "/proc/nothing"], env=WIDE), "/proc/nothing")


def test_a_folder_that_forbids_writing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.access", lambda path, mode: False)
    with pytest.raises(PermissionError, match="cannot be written to: name another"):
        check_folder(tmp_path / "new")


def test_a_template_that_cannot_be_written_is_one_line(runner: CliRunner, tmp_path: Path) -> None:
    result = runner.invoke(cli.app, ["verify", str(CASE), str(tmp_path / "no" / "my.csv"), "--template"], env=WIDE)
    is_one_line(result, str(tmp_path / "no" / "my.csv"))


def test_a_record_on_a_full_disk_names_the_file(tmp_path: Path) -> None:
    """/dev/full takes nothing: what was there before is as it was."""
    archive = Archive(tmp_path / "records.jsonl")
    archive._stream.close()
    archive._stream = open("/dev/full", "ab")  # noqa: SIM115
    blank = RunRecord(case="c", variant="v", role="main", engine="e", version="1", scene="s", status="did not run")
    with pytest.raises(OSError, match="No space left.*free some space") as full:
        archive.write(blank)
    assert full.value.filename == str(tmp_path / "records.jsonl")
    with pytest.raises(OSError, match="No space left"):
        archive.close()


def test_a_disk_that_fills_up_keeps_what_was_recorded(
    runner: CliRunner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = Archive.write

    def write(self: Archive, record) -> None:
        if isinstance(record, RunRecord) and sum(isinstance(each, RunRecord) for each in read(self._file)) == 3:
            with archive_module.writing(self._file):
                raise OSError(errno.ENOSPC, "No space left on device")
        whole(self, record)

    monkeypatch.setattr(Archive, "write", write)
    is_one_line(runner.invoke(cli.app, ["run", str(CASE), "--out", str(tmp_path)], env=WIDE), "records.jsonl")
    monkeypatch.setattr(Archive, "write", whole)
    assert sum(isinstance(each, RunRecord) for each in read(tmp_path / "records.jsonl")) == 3
    result = runner.invoke(cli.app, ["run", str(CASE), "--out", str(tmp_path)], env=WIDE)
    assert result.exit_code == 0, result.output


def test_a_report_on_a_full_disk_is_one_line(runner, tmp_path, monkeypatch) -> None:
    runner.invoke(cli.app, ["run", str(CASE), "--out", str(tmp_path)], env=WIDE)

    def full(*_, **__) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(ci.Path, "write_text", full)
    words = ["report", str(tmp_path / "records.jsonl"), "--out", str(tmp_path)]
    is_one_line(runner.invoke(cli.app, words, env=WIDE), str(tmp_path))


@pytest.mark.filterwarnings("default")  # what a command warns of is printed, no error
def test_a_broken_record_is_named_and_run_again(runner: CliRunner, tmp_path: Path) -> None:
    run = ["run", str(CASE), "--out", str(tmp_path)]
    runner.invoke(cli.app, run, env=WIDE)
    file = tmp_path / "records.jsonl"
    lines = file.read_bytes().splitlines(keepends=True)
    lines[4] = b'{"record": "run"}\n'
    file.write_bytes(b"".join(lines))
    reported = runner.invoke(cli.app, ["report", str(file), "--out", str(tmp_path / "b")], env=WIDE)
    assert reported.exit_code == 1
    assert "line 5: not a record of this version" in reported.output
    for name in ("report/index.html", "summary.md", "junit.xml"):
        assert "line 5" in (tmp_path / "b" / name).read_text(encoding="utf-8"), name
    again = runner.invoke(cli.app, run, env=WIDE)
    assert again.exit_code == 0, again.output
    assert "warning: " in again.output
    assert "records.jsonl.broken" in again.output
    assert (tmp_path / "records.jsonl.broken").read_bytes() == lines[4]


def test_a_full_disk_takes_the_files_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The summary of a simulation is printed before it is written, and a trajectory that was there is as it was."""
    from flexmb.run.trajectory import Trajectory

    def full(self: Trajectory, path: Path) -> None:
        shutil.copyfile(SCENE, path)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Trajectory, "to_csv", full)
    words = ["simulate", SCENE, "--t-end", "0.1", "--out", str(tmp_path / "out")]
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "trajectory.csv").write_text("earlier", encoding="utf-8")
    result = CliRunner().invoke(flexmb_cli.app, words, env=WIDE)
    assert result.exit_code == 2
    assert "energy drift" in result.output
    file = tmp_path / "out" / "trajectory.csv"
    assert f"error: {file}: No space left on device: it was not written" in result.output
    assert {each.name: each.read_text("utf-8") for each in file.parent.iterdir()} == {"trajectory.csv": "earlier"}
