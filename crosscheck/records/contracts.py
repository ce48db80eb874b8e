"""Whether outside engines kept the contract when they were last tried, and by which sources: `contract.json`.

`crosscheck contract` keeps the outcome of all clauses in its folder, with a digest of the engine's sources and one of
the clauses. A session in the same folder tells it of every engine that comes from elsewhere. What an engine says of
itself does not count, and an outcome of other sources is told as such.
"""

from __future__ import annotations

from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from crosscheck.engines.registry import BUILT_IN, home, is_fmu
from crosscheck.library.own_files import source_folder
from crosscheck.records.kinds import ContractState
from crosscheck.records.made_by import made_by
from flexmb.output.files import write_whole

FILE = "contract.json"
CLAUSES = "conformance"  # the package whose files are the clauses


class Tried(msgspec.Struct, frozen=True, kw_only=True):
    """The outcome of all clauses: the `engine` and the `clauses` as digests of their sources, the time in UTC."""

    kept: bool
    headline: str
    engine: str
    clauses: str
    at: str


def tried(name: str, kept: bool, headline: str) -> Tried:
    """The outcome of a trial of the engine called `name` as its sources are now."""
    at = datetime.now(UTC).isoformat(timespec="seconds")
    return Tried(kept=kept, headline=headline, engine=_engine(name), clauses=_clauses(), at=at)


def keep(out: Path, name: str, outcome: Tried) -> Path:
    """Keep the outcome in a folder, in place of an earlier one of the same engine; returns the file."""
    file = out / FILE
    out.mkdir(parents=True, exist_ok=True)
    write_whole(file, msgspec.json.format(msgspec.json.encode(_read(file) | {name: outcome}), indent=1) + b"\n")
    return file


def contracts(out: Path, engines: Iterable[str]) -> dict[str, ContractState]:
    """By name how the contract of each outside engine stands by what the folder keeps; built-in ones are left out."""
    outside = [name for name in dict.fromkeys(engines) if is_outside(name)]
    known = _read(out / FILE) if outside else {}
    return {name: _state(name, known.get(name)) for name in outside}


def is_outside(name: str) -> bool:
    """Whether an engine of that name comes from another distribution. An FMU is a model of one scene, and no code that
    the clauses, which have scenes of their own, could be tried on."""
    return name not in BUILT_IN and not is_fmu(name) and bool(home(name))


def _state(name: str, last: Tried | None) -> ContractState:
    now = _engine(name)
    if last is None:
        return ContractState(sources=now)
    changed = "its sources, or libraries," if last.engine != now else "clauses" if last.clauses != _clauses() else ""
    return ContractState(sources=now, kept=last.kept, headline=last.headline, at=last.at, changed=changed)


def _read(file: Path) -> dict[str, Tried]:
    """What the file keeps; nothing if it cannot be read, since a trial that is not known was none."""
    try:
        return msgspec.json.decode(file.read_bytes(), type=dict[str, Tried])
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError):
        return {}


def _engine(name: str) -> str:
    return made_by((home(name),), ())


def _clauses() -> str:
    files = (source_folder("crosscheck") / CLAUSES).glob("*.py")
    return made_by((), [f"crosscheck.{CLAUSES}.{file.stem}" for file in files if file.stem != "__init__"])
