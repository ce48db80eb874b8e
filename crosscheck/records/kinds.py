"""The kinds of records: what one line of a records file says, by its key "record"."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import msgspec

from crosscheck.library.accepted import Accepted
from crosscheck.library.case import Provenance, RunFile
from crosscheck.records.drawing import Drawing
from crosscheck.records.held import RecordedReference
from crosscheck.records.packing import Packed

RunStatus = Literal["finished", "diverged", "failed", "crashed", "did not finish", "refused", "did not run"]


class _OneRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="record"):
    """Base of all records."""


class Environment(_OneRecord, frozen=True, kw_only=True, tag="environment"):
    """Machine and versions of one session of running, and what was asked for: no engines named means all.

    A session that `confirms` writes a `Confirmed` for each earlier result that it lets stand; older versions did not.
    """

    started: str
    python: str
    system: str
    processor: str
    cores: int
    packages: dict[str, str]
    cases: tuple[str, ...] = ()
    engines: tuple[str, ...] = ()
    confirms: bool = False


class VariantInfo(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the report needs of a variant's scene: levels of its bodies, how to draw it, or why it could not be made.

    `drawing` is by the markers that every run records, `film` by those of a run made to be drawn, where there is one.
    `basis` identifies scene, transformation and sample times as the case's files state them ("" in older records).
    """

    level: str
    drawing: Drawing | None
    error: str = ""
    film: Drawing | None = None
    basis: str = ""


class CaseRecord(_OneRecord, frozen=True, kw_only=True, tag="case"):
    """A case as it was run: its run file reduced to the engines asked for, provenance, README, variants, the figures
    accepted for it, its stored reference if it has one, and digests of the `files` in its folder.

    `asked` are the engines asked for by name, `joined` those among them that the case itself names nowhere.
    `unreferenced`: it has a recipe of a reference whose files were never made.
    """

    case: str
    run: RunFile
    provenance: Provenance | None
    readme: str
    variants: dict[str, VariantInfo]
    accepted: Accepted = {}
    reference: RecordedReference | None = None
    files: dict[str, str] = {}
    asked: tuple[str, ...] = ()
    joined: tuple[str, ...] = ()
    unreferenced: bool = False


class RunRecord(_OneRecord, frozen=True, kw_only=True, tag="run"):
    """One run of one engine at one effort, or why there is none (then `effort` is empty).

    `role` is "main", "refined", "control:<name>" or "film". `rung` counts the efforts of the ladder from coarse to fine
    out of `rungs`. `scene` identifies scene and sample times, `made_by` everything else that the result depends on (see
    `made_by.py`; records of older versions have none). `compile_s` is conversion and warm-up, `wall_s` the solve alone.

    `status`: "finished"; "diverged", as the engine says; "failed" where the adapter raised or broke the contract;
    "crashed" where its process died; "did not finish" within its limits of time and memory; "refused"; "did not run".
    `undetermined`: channels that the motion leaves open, of which nothing is kept.
    """

    case: str
    variant: str
    role: str
    engine: str
    version: str
    scene: str
    made_by: str = ""
    status: RunStatus
    message: str = ""
    support: str = ""
    effort: str = ""
    effort_kind: str = ""
    effort_method: str = ""
    effort_value: float = 0.0
    rung: int = 0
    rungs: int = 0
    compile_s: float = 0.0
    wall_s: float = 0.0
    evaluations: int = 0
    times: Packed | None = None
    channels: dict[str, Packed] = {}
    undetermined: tuple[str, ...] = ()

    @property
    def key(self) -> tuple[str, ...]:
        """What identifies the run: a later record with the same key replaces an earlier one."""
        return (self.case, self.variant, self.role, self.engine, self.effort)


class Confirmed(_OneRecord, frozen=True, kw_only=True, tag="confirmed"):
    """Says that what earlier sessions recorded under this key is the result of this session too."""

    case: str
    variant: str
    role: str
    engine: str
    scene: str
    made_by: str


@dataclass(frozen=True)
class BrokenLine:
    """A line of a file of records that is none, and why."""

    file: str
    number: int
    reason: str

    def __str__(self) -> str:
        return f"{self.file}, line {self.number}: not a record of this version: {self.reason}"


Written = Environment | CaseRecord | RunRecord | Confirmed
Record = Written | BrokenLine
