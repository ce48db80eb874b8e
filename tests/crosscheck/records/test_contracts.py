"""A session says of an outside engine whether its contract is kept, by which sources; what it claims is no matter."""

import io
from importlib.metadata import EntryPoint
from pathlib import Path

import msgspec
import pytest
from rich.console import Console
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.engines import registry
from crosscheck.judging.outcome import conclude
from crosscheck.judging.results import collect
from crosscheck.library.find import load_case
from crosscheck.records import contracts as module
from crosscheck.records.archive import read
from crosscheck.records.contracts import FILE, contracts, keep, tried
from crosscheck.records.kinds import ContractState, Environment
from crosscheck.report import write_all
from crosscheck.sealed.seal import read_results
from crosscheck.terminal.verdicts import print_outcome
from tests.crosscheck.sessions import copy_case, sweep_here

MINE = "fine"  # a fake engine, which an entry point offers too
HOME = "tests.crosscheck.fake_engines"


@pytest.fixture(autouse=True)
def plugged(monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint(MINE, f"{HOME}:engines", registry.GROUP)
    monkeypatch.setattr(registry, "_plug_ins", lambda: {MINE: [point]})


def state(folder: Path) -> ContractState:
    (found,) = contracts(folder, ("native", MINE, "nowhere", MINE)).values()
    return found


def test_it_is_kept_by_these_sources_broken_or_not_known(tmp_path: Path) -> None:
    unknown = state(tmp_path)
    assert (unknown.kept, unknown.good, len(unknown.sources)) == (None, False, 16)
    assert f"not known whether its contract is kept: crosscheck contract {MINE}" in unknown.words(MINE)
    keep(tmp_path / "new", MINE, tried(MINE, True, "58 of 60 clauses hold"))
    good = state(tmp_path / "new")
    assert good.good and good.changed == "" and good.sources == unknown.sources
    assert f"{MINE} (sources {good.sources}): contract kept on 20" in good.words(MINE)
    keep(tmp_path / "new", "other", tried(MINE, True, "all hold"))
    keep(tmp_path / "new", MINE, tried(MINE, False, "2 broken"))
    broken = state(tmp_path / "new")
    assert not broken.good and "contract broken on 20" in broken.words(MINE) and "2 broken" in broken.words(MINE)


@pytest.mark.parametrize("changed, words", [("_engine", "its sources, or libraries,"), ("_clauses", "clauses")])
def test_what_has_changed_since_makes_it_stale(
    changed: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep(tmp_path, MINE, tried(MINE, True, "all clauses hold"))
    monkeypatch.setattr(module, changed, lambda *_: "0123456789abcdef")
    found = state(tmp_path)
    assert not found.good and found.changed == words
    assert f"{words} have changed since; contract kept on" in found.words(MINE)
    assert f"crosscheck contract {MINE}" in found.words(MINE)


@pytest.mark.parametrize("text", [b"", b"[]", b"{", b'{"fine": {"kept": 1}}', b"\xff\xfe"])
def test_a_spoilt_file_is_no_trial(text: bytes, tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(text)
    assert state(tmp_path).kept is None
    keep(tmp_path, MINE, tried(MINE, True, "all clauses hold"))
    assert state(tmp_path).good


def test_a_session_tells_it_everywhere(tmp_path: Path) -> None:
    keep(tmp_path, MINE, tried(MINE, True, "60 of 60 clauses hold, 0 broken"))
    records = tmp_path / "records.jsonl"
    sweep_here([load_case(copy_case(tmp_path))], (MINE,), records)
    outcome, page = write_all(records, tmp_path)
    said = state(tmp_path).words(MINE)
    assert outcome.contracts == {MINE: state(tmp_path)}
    shown = io.StringIO()
    print_outcome(Console(file=shown, width=400), outcome)
    assert f"✓ {said}" in shown.getvalue()
    assert "60 of 60 clauses hold" in page.read_text(encoding="utf-8")
    assert "## Contracts of outside engines" in (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert read_results(tmp_path / "results.json").contracts == outcome.contracts
    older = [msgspec.structs.replace(each, contracts={}) if isinstance(each, Environment) else each
             for each in read(records)]  # fmt: skip
    assert conclude(collect(older)).contracts == {}


def test_the_command_keeps_the_outcome_of_all_clauses_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("crosscheck.cli.common.require_engines", lambda *_, **__: None)
    monkeypatch.setattr("crosscheck.conformance.trial.try_engine", lambda *_, **__: iter(()))

    def ask(*words: str) -> list[str]:
        CliRunner().invoke(cli.app, ["contract", *words, "--out", str(tmp_path / "out")], catch_exceptions=False)
        return sorted(each.name for each in tmp_path.glob("out/*"))

    assert ask(MINE, "--clause", "*pendulum*") == [] and ask("native") == []
    assert ask(MINE) == [FILE]
    assert state(tmp_path / "out").kept is False  # nothing was shown
