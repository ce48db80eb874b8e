"""Bad plug-ins, installed as plug-ins are: each gets its one status, none is green, none takes others with it."""

import json
from pathlib import Path
from typing import Any

import psutil
import pytest
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.records.archive import read
from crosscheck.records.kinds import RunRecord
from crosscheck.report.ci import WORK
from crosscheck.running.installed import describe_engines
from crosscheck.running.scheduler import Limits
from crosscheck.running.sweep import sweep
from tests.crosscheck.engines.bad_engines import (
    ANSWERS,
    CRASHES,
    ENDLESS,
    GALLERY,
    HANGING_MODULES,
    HUNGRY,
    MODULES,
    TIDY,
    UNTIDY,
)  # fmt: skip
from tests.crosscheck.sessions import copy_case, here

SOUND = ("fine", "stepper")
EXPECTED = {name: (bad.status, bad.words) for name, bad in (GALLERY | ENDLESS | HUNGRY).items()}
EXPECTED |= {name: (status, words) for name, (status, words, _) in (MODULES | HANGING_MODULES).items()}
DEADLY = ("leaves_at_import", "falls_at_import", "interrupts_at_import")  # of the modules
MILD = (*ANSWERS, *TIDY, *(name for name in MODULES if name not in DEADLY))
HARD = (*CRASHES, *DEADLY, *UNTIDY)
LATE = (*ENDLESS, *HANGING_MODULES)
NEEDED = ("prints_megabytes", "leaves_children")  # by tests that name none
LIMIT_S = 8.0  # for those that wait; who eats is to be stopped by what it holds, however slow the machine
LIMIT_BYTES = 700e6


def install(folder: Path, names: tuple[str, ...]) -> None:
    """A distribution of plug-ins in a folder of the path."""
    texts = MODULES | HANGING_MODULES
    own = {name: f"{name}:make" for name in texts if name in names}
    for name in own:
        (folder / f"{name}.py").write_text(texts[name][2] + "\n", encoding="utf-8")
    known = {name: f"tests.crosscheck.engines.bad_engines:{name}" for name in names if name not in own}
    info = folder / "bad_engines-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: bad-engines\nVersion: 1.0\n", encoding="utf-8")
    lines = [f"{name} = {value}" for name, value in (known | own).items()]
    (info / "entry_points.txt").write_text("\n".join(["[crosscheck.engines]", *lines, ""]), encoding="utf-8")


class Ran:
    """A session of `fine` against each of some engines: its exit code, records and verdicts."""

    def __init__(
        self, folder: Path, names: tuple[str, ...], patch: pytest.MonkeyPatch, limits: Limits | None = None
    ) -> None:
        plugs = folder / "plugs"
        plugs.mkdir(parents=True)
        install(plugs, (*SOUND, *names))
        pairs = "".join(
            f'[[comparison]]\nname = "{name}"\ngoals = {{ "marker:tip.position" = 1e-4 }}\n'
            f'a = {{ variant = "rigid", engine = "fine" }}\nb = {{ variant = "rigid", engine = "{name}" }}\n'
            for name in ("stepper", *names)
        )
        case = copy_case(folder, f'[[variant]]\nname = "rigid"\nengines = {json.dumps([*SOUND, *names])}\n{pairs}')
        with patch.context() as inner:
            inner.syspath_prepend(plugs)
            inner.setenv("CHILDREN", str(folder / "children"))
            if limits:
                few = {"limits": limits}
                inner.setattr("crosscheck.running.sweep.sweep", lambda *words, **more: sweep(*words, **(more | few)))
            result = CliRunner().invoke(cli.app, ["run", str(case), "--out", str(folder / "out"), "--jobs", "2"])
        assert result.exception is None or isinstance(result.exception, SystemExit), result.output
        self.code, self.folder = result.exit_code, folder
        self.records = [each for each in read(folder / "out" / "records.jsonl") if isinstance(each, RunRecord)]
        verdicts = json.loads((folder / "out" / "verdicts.json").read_text(encoding="utf-8"))
        self.verdicts = {verdict["engine_b"]: verdict for verdict in verdicts}


@pytest.fixture(scope="module")
def patch() -> pytest.MonkeyPatch:
    return pytest.MonkeyPatch()


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory, patch: pytest.MonkeyPatch) -> Ran:
    return Ran(tmp_path_factory.mktemp("alone"), (), patch)


@pytest.fixture(scope="module")
def mild(tmp_path_factory: pytest.TempPathFactory, patch: pytest.MonkeyPatch) -> Ran:
    """What does no harm to its process, all in this one, which is quicker."""
    with patch.context() as inner:
        inner.setattr(cli.run, "scheduler_at", lambda address: here)
        return Ran(tmp_path_factory.mktemp("mild"), MILD, inner)


@pytest.fixture(scope="module")
def hard(tmp_path_factory: pytest.TempPathFactory, patch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Ran:
    return Ran(tmp_path_factory.mktemp("hard"), asked(HARD, request), patch)


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory, patch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Ran:
    return Ran(tmp_path_factory.mktemp("late"), asked(LATE, request), patch, Limits(workers=2, time_s=LIMIT_S))


@pytest.fixture(scope="module")
def hungry(tmp_path_factory: pytest.TempPathFactory, patch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Ran:
    names, limits = asked(tuple(HUNGRY), request), Limits(workers=2, memory_bytes=LIMIT_BYTES)
    return Ran(tmp_path_factory.mktemp("hungry"), names, patch, limits)


def asked(names: tuple[str, ...], request: pytest.FixtureRequest) -> tuple[str, ...]:
    """Those of whom a selected test asks: each of them costs processes."""
    calls = [item.callspec for item in request.session.items if item.path == request.path and hasattr(item, "callspec")]
    wanted = {call.params.get("name") for call in calls}
    return tuple(name for name in names if name in wanted or name in NEEDED)


def of(name: str, request: pytest.FixtureRequest) -> Ran:
    sessions = {"mild": MILD, "hard": HARD, "late": LATE, "hungry": HUNGRY}
    ran: Ran = request.getfixturevalue(next(session for session, names in sessions.items() if name in names))
    return ran


def test_the_gallery_is_large_enough() -> None:
    assert len(EXPECTED) >= 30


@pytest.mark.parametrize("name", EXPECTED)
def test_each_gets_its_one_status_with_the_reason_and_is_not_green(name: str, request: pytest.FixtureRequest) -> None:
    ran, (status, words) = of(name, request), EXPECTED[name]
    last = [record for record in ran.records if record.engine == name][-1]
    assert (last.status, words in last.message) == (status, True), last.message
    assert not ran.verdicts[name]["ok"]
    assert words in ran.verdicts[name]["reason"]
    assert ran.code == 1


def without_times(verdict: dict[str, Any]) -> dict[str, Any]:
    """What its runs took is the machine's."""
    work = {side: {key: value for key, value in verdict[side].items() if not key.endswith("_s")} for side in WORK}
    return {**verdict, **work}


@pytest.mark.parametrize("which", ["mild", "hard", "late", "hungry"])
def test_the_sound_pair_has_the_verdict_it_has_alone(alone: Ran, which: str, request: pytest.FixtureRequest) -> None:
    assert alone.code == 0
    assert without_times(request.getfixturevalue(which).verdicts["stepper"]) == without_times(alone.verdicts["stepper"])


@pytest.mark.parametrize("name", [*TIDY, *UNTIDY])
def test_what_is_odd_but_right_runs_and_agrees(name: str, request: pytest.FixtureRequest) -> None:
    """Single precision runs; whether it agrees is for its uncertainty to say."""
    ran = of(name, request)
    assert [record.status for record in ran.records if record.engine == name] == ["finished"] * 3
    assert ran.verdicts[name]["status"] == "agree" or name == "single_precision", ran.verdicts[name]["reason"]


def test_no_process_of_an_engine_survives(hard: Ran, late: Ran) -> None:
    children = [int(line) for line in (hard.folder / "children").read_text(encoding="utf-8").split()]
    assert children
    assert not [pid for pid in children if psutil.pid_exists(pid) and psutil.Process(pid).status() != "zombie"]
    left = [process.cmdline() for process in psutil.Process().children(recursive=True)]
    assert not [words for words in left if "resource_tracker" not in " ".join(words)]


def test_what_engines_print_goes_to_the_log(hard: Ran) -> None:
    assert (hard.folder / "out" / "records.log").stat().st_size > 2**22


def test_engines_lists_bad_plug_ins_with_the_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("module_missing", "exits_at_import", "leaves_at_import", "falls_at_import", "version_none")
    install(tmp_path, (*names, "fine"))
    monkeypatch.syspath_prepend(tmp_path)
    states = {state.name: state for state in describe_engines()}
    assert states["fine"].version == "1.0"
    for name in names:
        assert states[name].version is None
        assert EXPECTED[name][1] in states[name].advice
    assert states["native"].version is not None
