"""What stands behind a label: files, each found to be fresh, stale, broken or absent.

Evidence is *fresh* if it is about the files and the code of today. What is *stale* (a scene, a reference, the code or
anything else of which it has a digest is another now) or *broken* (its seal does not fit, it cannot be read) counts as
none, and the label says so by name.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, Literal, TypeVar

import msgspec

from crosscheck.library.basis import Basis, basis
from crosscheck.library.case import CaseError, Provenance, RunFile
from crosscheck.library.digests import case_digests
from crosscheck.library.find import Case
from crosscheck.library.own_files import code_here
from crosscheck.library.reference import KNOWLEDGE, current_reference, digest, has_reference
from crosscheck.records.kinds import CaseRecord
from crosscheck.sealed.document import SealedCase, SealedResults
from crosscheck.sealed.seal import FILE as RESULTS
from crosscheck.sealed.seal import LIMIT, ResultsError, opened, read_finished, unlike
from flexmb.scene.reading import Unreadable, read_bytes

SPREADS, BUDGETS, PROVENANCE, MEASURED = "sensitivity.json", "validation.json", "provenance.toml", "measured.toml"
NO_PROVENANCE = digest("")
State = Literal["fresh", "stale", "broken", "absent"]
T = TypeVar("T")


class Piece(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A file that is evidence, or is missing: its name, in which state it is, and why if it is not fresh."""

    file: str
    state: State
    why: str = ""

    @property
    def words(self) -> str:
        return f"{self.file}: {self.state}{f' ({self.why})' if self.why else ''}"


@dataclass(frozen=True)
class Exhibit(Generic[T]):
    """A piece of evidence with what it says; None unless it is fresh."""

    piece: Piece
    content: T | None = None


@dataclass(frozen=True)
class Labelled:
    """What is labelled: a case, or a measured set, which has no `run`.

    `files` and `code` are the digests that evidence must have; `reference` is the case's stored one.
    """

    name: str
    title: str
    run: RunFile | None
    provenance: Provenance | None
    files: Mapping[str, str]
    code: str
    reference: Exhibit[Basis]

    @property
    def measured(self) -> bool:
        """Whether readings are in its folder."""
        return MEASURED in self.files


class _Spread(msgspec.Struct):
    """A channel's spread relative to its size; None where it is no number."""

    digits: float | None


class _VariantSpreads(msgspec.Struct):
    moved: int
    held: tuple[str, ...]
    failed: tuple[str, ...]
    channels: dict[str, _Spread]


class Spreads(msgspec.Struct):
    """What `sensitivity.json` says of a case."""

    variants: dict[str, _VariantSpreads]


class _Input(msgspec.Struct):
    name: str
    stated: bool


class _Series(msgspec.Struct):
    name: str
    standing: Literal["validated", "model error"]
    stated: bool
    ok: bool
    points: int


class Budgets(msgspec.Struct):
    """What `validation.json` says of a measured set."""

    samples: int
    inputs: tuple[_Input, ...]
    series: tuple[_Series, ...]
    sources: tuple[str, ...]

    @property
    def points(self) -> int:
        return sum(series.points for series in self.series)


@dataclass(frozen=True)
class SessionEvidence:
    """A case in a session, and what the session was."""

    case: SealedCase
    strict: bool
    green: bool


@dataclass(frozen=True)
class Exhibits:
    """All that may stand behind a label."""

    provenance: Exhibit[Provenance]
    reference: Exhibit[Basis]
    session: Exhibit[SessionEvidence]
    spreads: Exhibit[Spreads]
    budgets: Exhibit[Budgets]


def of_case(case: Case) -> Labelled:
    """A case as its folder and the code are now."""
    return Labelled(
        case.name, case.run.title, case.run, case.provenance, case_digests(case.folder), code_here(), _stored(case)
    )


def of_record(record: CaseRecord, code: str) -> Labelled:
    """A case as a session ran it, by code with this digest."""
    stored = record.reference
    if stored is None:
        reference = Exhibit[Basis](_absent(KNOWLEDGE))
    else:
        provenance = record.files.get(PROVENANCE, NO_PROVENANCE)
        why = stored.fault or _of_another_provenance(stored.provenance, provenance)
        reference = _unless(why, KNOWLEDGE, basis(stored.routes))
    return Labelled(record.case, record.run.title, record.run, record.provenance, record.files, code, reference)


def of_measured_set(name: str, title: str, folder: Path) -> Labelled:
    """A measured set without a case, as its folder and the code are now."""
    nothing = Exhibit[Basis](Piece(file=KNOWLEDGE, state="absent", why="a measured set has none"))
    return Labelled(name, title, None, None, case_digests(folder), code_here(), nothing)


def evidence(subject: Labelled, folder: Path, results: SealedResults | None = None) -> Exhibits:
    """What is on file of a subject: in its own folder, and in the folder of a session; `results` are the session's
    where they were not read from there."""
    set_name = subject.name.rpartition("/")[2]
    spreads = _stamped(folder / SPREADS, subject.name, subject, Spreads)
    budgets = (
        _stamped(folder / BUDGETS, set_name, subject, Budgets)
        if subject.measured
        else Exhibit[Budgets](Piece(file=BUDGETS, state="absent", why=f"there is no {MEASURED} in its folder"))
    )
    absent = Exhibit[Provenance](_absent(PROVENANCE))
    provenance = absent if subject.provenance is None else _unless("", PROVENANCE, subject.provenance)
    return Exhibits(provenance, subject.reference, _session(subject, folder / RESULTS, results), spreads, budgets)


def _session(subject: Labelled, file: Path, results: SealedResults | None) -> Exhibit[SessionEvidence]:
    if results is None:
        if not file.exists():
            return Exhibit(_absent(RESULTS))
        try:
            results = read_finished(file)
        except ResultsError as error:
            return Exhibit(Piece(file=RESULTS, state="broken", why=str(error).removeprefix(f"{file} ")))
    case = results.cases.get(subject.name)
    if case is None:
        return Exhibit(Piece(file=RESULTS, state="absent", why="the case is not in this session"))
    why = unlike(subject.files, subject.code, case.files, results.made.code)
    return _unless(why, RESULTS, SessionEvidence(case, results.strict, results.exit_code == 0))


def _stored(case: Case) -> Exhibit[Basis]:
    if not has_reference(case.folder):
        return Exhibit(_absent(KNOWLEDGE))
    try:
        known = current_reference(case).knowledge
    except CaseError as error:
        return _unless(str(error).replace(f"{case.folder}/", ""), KNOWLEDGE, None)
    provenance = case_digests(case.folder).get(PROVENANCE, NO_PROVENANCE)
    return _unless(_of_another_provenance(known.provenance, provenance), KNOWLEDGE, basis(known.routes))


def _of_another_provenance(then: str, now: str) -> str:
    return "" if then == now else f"{PROVENANCE} changed since"


def _stamped(file: Path, name: str, subject: Labelled, kind: type[T]) -> Exhibit[T]:
    """What a stamped file says of a name."""
    try:
        every = json.loads(read_bytes(file, LIMIT).decode())
    except FileNotFoundError:
        return Exhibit(_absent(file.name))
    except (OSError, Unreadable, ValueError, RecursionError) as error:
        return Exhibit(Piece(file=file.name, state="broken", why=f"it cannot be read: {error}"))
    content = every.get(name) if isinstance(every, dict) else None
    if content is None:
        return Exhibit(Piece(file=file.name, state="absent", why=f"it says nothing of {name}"))
    broken, changed = opened(content, subject.files, subject.code)
    if broken:
        return Exhibit(Piece(file=file.name, state="broken", why=broken))
    try:
        return _unless(changed, file.name, msgspec.convert(content, kind))
    except msgspec.ValidationError as error:
        return Exhibit(Piece(file=file.name, state="broken", why=str(error)))


def _absent(file: str) -> Piece:
    return Piece(file=file, state="absent")


def _unless(why: str, file: str, content: T | None) -> Exhibit[T]:
    """Fresh evidence, or stale for a reason."""
    if why:
        return Exhibit(Piece(file=file, state="stale", why=why))
    return Exhibit(Piece(file=file, state="fresh"), content)
