"""Mutated files of every kind: refused in words or read as they stand, in bounded time and memory."""

import ast
import os
import re
import sys
import zipfile
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import CodeType, FrameType

import msgspec
import numpy as np
import pytest

import crosscheck
import flexmb
from crosscheck.verify.columns import Columns
from tests.fuzz import kinds as subject
from tests.fuzz.campaign import campaign, table
from tests.fuzz.worker import BAD, content, read

MUTANTS = 650  # some ten of most kinds
BY_LINES = {"records", "map records"}  # a broken line is set aside, and a file hardly ever refused
ENOUGH = 40
"""Mutants of a kind among which some are accepted, and some refused: of ten of a seldom one all may come out alike."""
BOTH = {"refused", "accepted"}


@pytest.mark.parametrize("times", [1, pytest.param(8, marks=pytest.mark.slow)])
def test_no_mutant_is_bad(tmp_path: Path, times: int) -> None:
    """A run on request: python -m tests.fuzz --mutants 50000."""
    results = campaign(times * MUTANTS, seed=1, workers=min(2, os.cpu_count() or 1), keep=tmp_path / "bad")
    bad = [result for result in results if result["outcome"] in BAD]
    assert not bad, f"\n{table(results)}\n" + "\n".join(f"{each['kind']} {each['number']}: {each}" for each in bad[:10])
    assert len(results) == times * MUTANTS
    for kind in {result["kind"] for result in results}:  # a kind whose mutants all come out alike is not tested
        outcomes = [result["outcome"] for result in results if result["kind"] == kind]
        if len(outcomes) >= ENOUGH:
            assert set(outcomes) >= ({"accepted"} if kind in BY_LINES else BOTH), kind
    counts = Counter(result["kind"] for result in results)
    assert min(counts.values()) >= (ENOUGH if times > 1 else 5), "kinds have grown: try more mutants"


@pytest.fixture(scope="module")
def kinds(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, subject.Kind]]:
    folder = tmp_path_factory.mktemp("kinds")
    return folder, subject.kinds(folder)


def test_every_seed_is_accepted(kinds: tuple[Path, dict[str, subject.Kind]]) -> None:
    folder, found = kinds
    for name, kind in found.items():
        for seed in kind.seeds:
            (folder / kind.file).write_bytes(seed)
            assert read(kind, folder / kind.file) == ("accepted", ""), name
        subject._prepare(folder)


def columns_by(columns: Columns, change: Callable[..., object]) -> Columns:
    return Columns({name: change(values) for name, values in columns.channels.items()})


def first(channels: dict[str, object]) -> dict[str, object]:
    return dict(list(channels.items())[:1])


PLANTED: dict[str, tuple[str, str, Callable[..., object]]] = {
    "a name that changes": ("scene", "load_scene", lambda scene: msgspec.structs.replace(scene, name="x")),
    "a NaN that passes": ("verify csv", "read_columns", lambda columns: columns_by(columns, lambda v: v * np.nan)),
    "a number that is rounded": ("verify csv", "read_columns", lambda columns: columns_by(columns, np.round)),
    "a channel that is dropped": ("verify csv", "read_columns", lambda columns: Columns(first(columns.channels))),
    "a record that is dropped": ("records", "read", lambda records: records[:-1]),
    "a line that is taken for another": ("records", "read", lambda records: [*records[:-1], records[-2]]),
    "an array that is cut": ("npz", "modal_arrays", lambda arrays: arrays._replace(mass=arrays.mass[:-1])),
}


@pytest.mark.parametrize("fault", PLANTED)
def test_a_planted_fault_is_seen(kinds, monkeypatch: pytest.MonkeyPatch, fault: str) -> None:
    folder, found = kinds
    name, reader, spoil = PLANTED[fault]
    true = getattr(subject, reader)
    monkeypatch.setattr(subject, reader, lambda *words: spoil(true(*words)))
    kind = found[name]
    (folder / kind.file).write_bytes(kind.seeds[0])
    assert read(kind, folder / kind.file)[0] == "wrong accept"


def _hang() -> None:
    while True:
        pass


def _raise() -> None:
    raise KeyError("x")


def _bare() -> None:
    raise subject.SceneError("", [])


@pytest.mark.parametrize(("does", "outcome"), [(_hang, "hang"), (_raise, "traceback"), (_bare, "no file named")])
def test_a_reader_that_misbehaves_is_seen(kinds, monkeypatch: pytest.MonkeyPatch, does, outcome: str) -> None:
    monkeypatch.setattr("tests.fuzz.worker.ASLEEP_S", 1.0)
    folder, found = kinds
    spoiled = replace(found["scene"], accept=lambda path: does(), place="")
    assert read(spoiled, folder / "scene.toml")[0] == outcome


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_mutants_of_archives_are_whole_archives(kinds) -> None:
    """Else all that is tested is the checksum."""
    folder, found = kinds
    kind, whole = found["npz"], 0
    for number in range(40):
        _, data = content(kind, "npz", 1, number)
        if isinstance(data, bytes):
            (folder / "probe.npz").write_bytes(data)
            whole += zipfile.is_zipfile(folder / "probe.npz")
    assert whole > 20


PRIMITIVES = re.compile(
    r"(.+\.)?(read_text|read_bytes|parse_toml|ZipFile)|(np|numpy)\.load|(json|tomllib|pickle)\.loads?"
    r"|(.+\.)?json\.decode|csv\.(reader|DictReader)|.*fromstring|(.+\.)?open"
)
"""Calls that turn a file or its text into values."""
NOT_OF_USERS = {
    "crosscheck/cli/baseline.py:hold_against": "copies what `read_finished` has read",
    "crosscheck/cli/label.py:label": "shows what it has just computed",
    "crosscheck/cli/run.py:_conclude": "shows what it has just written",
    "crosscheck/cli/stability.py:stability": "shows what it has just written",
    "crosscheck/engines/kratos/library.py:_silence": "the file that takes everything",
    "crosscheck/export/archive.py:archive": "files of the package",
    "crosscheck/export/metadata.py:collection_page": "files of the package", "crosscheck/library/digests.py": "digests",
    "crosscheck/library/find.py:shipped_tags": "tags of the shipped cases",
    "crosscheck/library/reference.py:scene_digest": "a digest of a scene that is read before",
    "crosscheck/pytest_plugin/runs.py": "what this very session has written, under a lock",
    "crosscheck/records/archive.py:_ended": "the last byte of records",
    "crosscheck/records/archive.py:_set_broken_lines_aside": "bytes of records, after `read`",
    "crosscheck/records/contracts.py:_read": "an outcome that cannot be read is none",
    "crosscheck/records/lock.py:_who": "words for a message",
    "crosscheck/records/machine.py": "the kernel's words on the processor", "crosscheck/records/made_by.py": "digests",
    "crosscheck/records/sources.py": "installed packages and their sources",
    "crosscheck/references/files.py:write_both": "compares stored files with new ones byte by byte",
    "crosscheck/references/regenerate.py:_provenance": "a digest",
    "crosscheck/report/ci.py:add_differences": "adds to a page of its own",
    "crosscheck/report/site.py": "a listing of its own pages, and scripts of the package",
    "crosscheck/library/own_files.py": "a digest", "crosscheck/running/plan.py:scene_identity": "a digest",
    "flexmb/ready/make.py": "digests of sources and kernels, and the list of these that it has written itself",
    "crosscheck/running/worker.py:memory_limit": "the kernel's words on memory",
    "crosscheck/sampling/printed.py": "scenes of cases that are read before, with other numbers",
    "crosscheck/running/worker.py:_serve": "a log, and nothing",
    "crosscheck/sealed/seal.py:add_stamped": "replaces what is no table, and says nothing of it",
    "crosscheck/sealed/seal.py:stamped": "what it has just encoded",
    "crosscheck/stability/map_records.py:identity": "a digest",
    "flexmb/control/user.py": "sources of users' functions, which are run anyhow",
    "flexmb/export/sources.py:_shared": "files of the package",
    "flexmb/export/web.py:wasm": "what the compiler has just written",
    "crosscheck/engines/fmu/engine.py:_mapping_digest": "a digest",
    "flexmb/export/writing.py:_library": "what the compiler has just written",
    "flexmb/jit/": "kernels and their sources", "flexmb/output/readers.py:write": "writes",
    "flexmb/output/files.py:_settle": "writes",
    "flexmb/run/warm_up.py:main": "what the process that started it has written",
    "flexmb/scene/values.py": "words of an option",
}  # fmt: skip
"""Where functions call one of these without being tried here, and why that is right."""


PACKAGES = [Path(str(package.__file__)).parent for package in (flexmb, crosscheck)]  # as installed, side by side


def _place(file: Path) -> str:
    return file.as_posix().removeprefix(f"{PACKAGES[0].parent.as_posix()}/")


def _writes(call: ast.Call) -> bool:
    words = [argument.value for argument in call.args if isinstance(argument, ast.Constant)]
    return any(isinstance(word, str) and word in ("w", "wb", "a", "ab") for word in words)


def _readers() -> set[tuple[str, str]]:
    """Files and names of all functions of both packages that call a primitive.

    Cases lie in the package once it is installed; the tables that their own code reads come with them.
    """
    found = set[tuple[str, str]]()
    for file in sorted(file for package in PACKAGES for file in package.rglob("*.py")):
        if _place(file).startswith("crosscheck/cases/"):
            continue
        for function in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(function, ast.FunctionDef):
                calls = [node for node in ast.walk(function) if isinstance(node, ast.Call)]
                if any(PRIMITIVES.fullmatch(ast.unparse(call.func)) and not _writes(call) for call in calls):
                    found.add((_place(file), function.name))
    return found


def test_every_reader_of_files_is_tried(kinds: tuple[Path, dict[str, subject.Kind]]) -> None:
    """Readers are found by what they call; those that no kind reaches are listed with a reason."""
    folder, found = kinds
    codes = dict[int, CodeType]()  # by identity: their hash reads all of them

    def seen(frame: FrameType, event: str, _: object) -> None:  # of calls alone
        codes[id(frame.f_code)] = frame.f_code

    for kind in found.values():
        for seed in (*kind.seeds[:2], kind.seeds[-1]):
            (folder / kind.file).write_bytes(seed)
            sys.settrace(seen)
            try:
                read(kind, folder / kind.file)
            finally:
                sys.settrace(None)
        subject._prepare(folder)
    reached = {(_place(Path(code.co_filename)), code.co_name) for code in codes.values()}
    readers = _readers()
    missing = [":".join(place) for place in sorted(readers - reached)]
    idle = [place for place in NOT_OF_USERS if not any(":".join(reader).startswith(place) for reader in readers)]
    assert not idle, f"{idle} is said of no function that reads"
    missing = [place for place in missing if not place.startswith(tuple(NOT_OF_USERS))]
    assert not missing, f"no kind of file reaches {missing}: add a kind, or say why there is none"
