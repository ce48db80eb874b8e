"""`label.json`: the label of each case of a session, or of what was asked for.

It is made of evidence whenever it is written, and nothing reads it: a level that is written into it by hand stands
nowhere else. Keys: ``format``, ``version``, ``standard``; ``code``, the digest of the code that was labelled;
``sha256``, a seal as that of results.json; and ``subjects`` by name, each with ``title``, ``intended_use``, ``limits``
and ``waivers`` as run.toml states them, ``files``, the digests of its files, and ``factors``: by factor its ``level``
from 0 to 4, the ``criterion`` of that level, what the files say (``because``), the ``evidence`` that was looked at with
its state, and what would raise it (``next``, ``raised_by``).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated

import msgspec

from crosscheck.judging.results import Session
from crosscheck.label.evidence import Exhibits, Labelled, Piece, evidence, of_record
from crosscheck.label.factors import CRITERIA, FACTORS, HIGHEST, TITLES, Factor
from crosscheck.label.ladder import looked
from crosscheck.sealed.document import SealedResults
from crosscheck.sealed.seal import SEAL, seal_of
from flexmb.output.files import write_whole

FILE = "label.json"
FORMAT, VERSION, STANDARD = "crosscheck label", 1, "NASA-STD-7009B"
NOT_STATED = "not stated"
Level = Annotated[int, msgspec.Meta(ge=0, le=HIGHEST)]


class FactorRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A factor's level and what stands behind it; `next` is the criterion of the next level, "" at the highest."""

    level: Level
    criterion: str
    because: str
    evidence: tuple[Piece, ...]
    next: str
    raised_by: str


class SubjectLabel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The label of a case or of a measured set."""

    title: str
    intended_use: str
    limits: tuple[str, ...]
    waivers: tuple[str, ...]
    files: dict[str, str]
    factors: dict[Factor, FactorRow]

    @property
    def levels(self) -> tuple[int, ...]:
        """In the order of the factors."""
        return tuple(self.factors[factor].level for factor in FACTORS)


class LabelFile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The whole file, but for its seal."""

    format: str = FORMAT
    version: int = VERSION
    standard: str = STANDARD
    code: str
    subjects: dict[str, SubjectLabel]


def label(subject: Labelled, found: Exhibits) -> SubjectLabel:
    """The label of a subject by its evidence."""
    run = subject.run
    return SubjectLabel(
        title=subject.title,
        intended_use=(run.intended_use if run else "") or NOT_STATED,
        limits=run.limits if run else (),
        waivers=run.waivers if run else (),
        files=dict(subject.files),
        factors={factor: _row(factor, subject, found) for factor in FACTORS},
    )


def session_labels(session: Session, results: SealedResults, out: Path) -> LabelFile:
    """The labels of all cases of a judged session, with what else is on file in its folder."""
    code = results.made.code
    subjects = [of_record(case.case, code) for case in session.cases]
    return LabelFile(
        code=code, subjects={each.name: label(each, evidence(each, out, results)) for each in subjects}
    )  # fmt: skip


def label_text(labels: LabelFile) -> str:
    """The text of the file, sealed."""
    content = msgspec.to_builtins(labels)
    return json.dumps({**content, SEAL: seal_of(content)}, indent=1) + "\n"


def write_label(labels: LabelFile, file: Path) -> None:
    """Write the file."""
    write_whole(file, label_text(labels))


def heads() -> Iterator[str]:
    """The factors as heads of columns."""
    return (TITLES[factor] for factor in FACTORS)


def level_rows(labels: Mapping[str, SubjectLabel]) -> Iterable[tuple[str, ...]]:
    """A row for each subject: its name and the levels."""
    return ((name, *map(str, each.levels)) for name, each in labels.items())


def _row(factor: Factor, subject: Labelled, found: Exhibits) -> FactorRow:
    of = looked(factor, subject, found)
    met = [rung for rung in of.rungs if rung.met]
    level = met[-1].level if met else 0
    above = next((rung for rung in of.rungs if rung.level == level + 1), None)
    return FactorRow(
        level=level,
        criterion=CRITERIA[factor][level],
        because=met[-1].says if met else CRITERIA[factor][0],
        evidence=of.pieces,
        next=CRITERIA[factor][level + 1] if above else "",
        raised_by=above.remedy if above else "",
    )
