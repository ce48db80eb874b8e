"""Records: exact numbers, one line each, readable after a kill, and one writer in a folder, named to a second one."""

import os
import re
import subprocess
import sys
import tempfile
import tracemalloc
import zlib
from base64 import b64encode
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.verdict import Verdict
from crosscheck.records import archive as archive_module
from crosscheck.records.archive import Archive, BrokenRecords, read
from crosscheck.records.kinds import RunRecord
from crosscheck.records.lock import FolderInUseError, locked
from crosscheck.records.machine import environment
from crosscheck.records.packing import Packed, pack, unpack
from tests.crosscheck.sessions import CASE


def record(effort: str) -> RunRecord:
    values = np.random.default_rng(1).normal(size=(7, 3))
    return RunRecord(
        case="a/b", variant="v", role="main", engine="e", version="1", scene="s", status="finished", effort=effort,
        times=pack(np.arange(7.0)), channels={"marker:tip.position": pack(values)},
    )  # fmt: skip


def test_packing_is_exact() -> None:
    values = np.array([[np.pi, -0.0, np.inf], [np.nan, 5e-324, 1.0 / 3.0]])
    assert unpack(pack(values)).tobytes() == values.tobytes()
    assert unpack(pack(values)).shape == (2, 3)


def test_a_broken_end_is_skipped_and_then_cut_off(tmp_path: Path) -> None:
    file = tmp_path / "records.jsonl"
    archive = Archive(file)
    for item in (environment(), record("one"), record("two")):
        archive.write(item)
    archive.close()
    whole = file.read_bytes()
    file.write_bytes(whole[:-40])
    assert [item.effort for item in read(file) if isinstance(item, RunRecord)] == ["one"]
    archive = Archive(file)
    archive.write(record("three"))
    archive.close()
    assert [item.effort for item in read(file) if isinstance(item, RunRecord)] == ["one", "three"]


WRONG = (
    b'{"record": "run", "case": 3}', b"", b"{", b"\xff\xfe", b"\x00" * 9, b"[" * 100_000, b'{"record": "surprise"}',
    b'{"a":' * 100_000, b"1" * 5000, b"null",
)  # fmt: skip


def changed(**changes: object) -> bytes:
    return msgspec.json.encode(msgspec.structs.replace(record("two"), **changes))


def packed(shape: tuple[int, ...], data: bytes) -> Packed:
    return Packed(shape=shape, data=b64encode(zlib.compress(data)).decode())


SEVEN = pack(np.arange(7.0))
CONTRADICTIONS = {
    "fewer numbers than the shape": changed(channels={"drive:a": packed((7, 3), bytes(80))}),
    "more numbers than the shape": changed(channels={"drive:a": packed((7, 3), bytes(8 * 22))}),
    "a bomb in a small shape": changed(channels={"drive:a": packed((7, 3), bytes(10**8))}),
    "a bomb of its own shape": changed(times=packed((2**24,), bytes(2**27))),
    "an impossible size": changed(channels={"drive:a": Packed(shape=(7, 10**30), data="")}),
    "a negative shape": changed(channels={"drive:a": Packed(shape=(-1, -1), data=pack(np.ones((1, 1))).data)}),
    "three dimensions": changed(channels={"drive:a": packed((7, 1, 1), bytes(56))}),
    "other times": changed(channels={"drive:a": pack(np.ones((6, 3)))}),
    "a vector of four": changed(channels={"marker:tip.position": pack(np.ones((7, 4)))}),
    "a part that markers do not have": changed(channels={"marker:tip.colour": pack(np.ones((7, 3)))}),
    "no channel": changed(channels={"a": pack(np.ones((7, 3)))}),
    "no times": changed(times=None),
    "text that is no base64": changed(channels={"drive:a": Packed(shape=(7, 3), data="!" + SEVEN.data)}),
    "base64 that is not deflated": changed(channels={"drive:a": Packed(shape=(7, 3), data="AAAA")}),
    "a cut text": changed(times=Packed(shape=(7,), data=SEVEN.data[:8])),
    "a rung above the ladder": changed(rung=4, rungs=4),
    "a step of nothing": changed(rung=1, rungs=4, effort_value=0.0),
    "a negative tolerance": changed(effort_value=-1e-6),
    "an unknown key": changed().replace(b'"engine"', b'"surprise":1,"engine"'),
}


NAMES = [*(f"broken {i}" for i in range(len(WRONG))), *CONTRADICTIONS]


@pytest.mark.parametrize("line", [*WRONG, *CONTRADICTIONS.values()], ids=NAMES)
def test_a_broken_line_costs_that_line_and_is_named(tmp_path: Path, line: bytes) -> None:
    file = tmp_path / "records.jsonl"
    first, last = (msgspec.json.encode(record(effort)) + b"\n" for effort in ("one", "three"))
    file.write_bytes(first + line + b"\n" + last)
    tracemalloc.start()
    one, broken, three = read(file)
    assert tracemalloc.get_traced_memory()[1] < 1e7
    tracemalloc.stop()
    assert (one.effort, three.effort) == ("one", "three")
    assert str(broken).startswith(f"{file}, line 2: not a record of this version: ")
    with pytest.warns(BrokenRecords, match="line 2"):
        Archive(file).close()
    assert [item.effort for item in read(file)] == ["one", "three"]
    assert (tmp_path / "records.jsonl.broken").read_bytes() == line + b"\n"


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (WRONG[3], "it is not UTF-8 (byte 0xff is byte 1 of the line)"),
        (b'{"record": "run\xfe"}', "it is not UTF-8 (byte 0xfe is byte 16 of the line)"),
        (WRONG[7], "nested too deeply"),
        (CONTRADICTIONS["text that is no base64"], "drive:a: its array is damaged: the text is not base64"),
        (CONTRADICTIONS["base64 that is not deflated"], "drive:a: its array is damaged: the text was changed or cut"),
        (CONTRADICTIONS["a cut text"], "times: its array"),
        (CONTRADICTIONS["fewer numbers than the shape"], "drive:a: its array of shape (7, 3) does not hold"),
    ],
)
def test_what_is_wrong_with_a_line_is_told_in_words_of_the_file(tmp_path: Path, line: bytes, said: str) -> None:
    """With the array, and without the words of the libraries that unpack it."""
    (tmp_path / "records.jsonl").write_bytes(line + b"\n")
    (broken,) = read(tmp_path / "records.jsonl")
    assert said in str(broken)
    assert not any(word in str(broken) for word in ("codec", "compress", "Error -"))


@given(st.lists(st.binary(max_size=30).map(lambda line: line.replace(b"\n", b"")), max_size=4))
def test_any_bytes_between_records_cost_only_themselves(lines: list[bytes]) -> None:
    whole = msgspec.json.encode(record("one")) + b"\n"
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "records.jsonl"
        file.write_bytes(whole + b"".join(line + b"\n" + whole for line in lines))
        found = read(file)
    assert [isinstance(item, RunRecord) for item in found] == [True] + [False, True] * len(lines)


def test_a_line_without_end_is_read_in_bounded_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archive_module, "LONGEST_LINE", 10_000)
    file = tmp_path / "records.jsonl"
    file.write_bytes(b"x" * 1_000_000 + b"\n" + msgspec.json.encode(record("one")) + b"\n")
    broken, one = read(file)
    assert (broken.number, one.effort) == (1, "one")


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "pipe", Path("/dev/zero"), tmp_path / "missing"):
        with pytest.raises(OSError, match=re.escape(str(path))):
            read(path)


def test_a_session_with_a_broken_line_is_not_green() -> None:
    """Whatever the line held is lost: a verdict may have hung on it."""
    verdict = Verdict(
        case="a", comparison="c", kind="comparison", channel="x", variant_a="v", engine_a="e", variant_b="v",
        engine_b="f", level="", status="agree", expected="agree", E=0.0, U=0.0, goal=1.0, scale=1.0, reason="",
    )  # fmt: skip
    assert SessionOutcome({"a": [verdict]}, []).ok
    lost = SessionOutcome({"a": [verdict]}, [], ("records.jsonl, line 3: broken",))
    assert not lost.ok
    assert "1 line is no record" in lost.headline


def test_the_environment_names_machine_and_versions() -> None:
    found = environment()
    assert found.processor
    assert found.packages["numpy"] == np.__version__


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
