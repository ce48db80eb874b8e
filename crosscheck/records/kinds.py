"""The kinds of records, which are the lines of a records file; the key "record" names the kind.

The record of a case holds its stored reference, so that runs can be judged without the case's folder.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import msgspec

from crosscheck.library.accepted import Accepted
from crosscheck.library.case import Provenance, RunFile
from crosscheck.library.claims import Claims
from crosscheck.library.work import StoredWork
from crosscheck.records.packing import Packed
from flexmb.view.drawing import Drawing

FILM = "film"  # the role of a run that is made for the animation


class ReferenceGoals(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Goals and scales of an engine's comparison with the reference, by patterns of channels."""

    goals: dict[str, float]
    scales: dict[str, float] = {}


class RecordedReference(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The reference of `variant`: channels (T, k) at `times` (T,), their `uncertainties` (SI), and the engines that are
    compared with it (`asked`). `routes` say how its numbers were made, `work` what they took, and `provenance` is the
    digest of the provenance.toml that it was made with; older records have none. If the stored files cannot be used,
    `fault` says why, and there are no arrays.
    """

    variant: str
    asked: dict[str, ReferenceGoals]
    times: Packed | None = None
    channels: dict[str, Packed] = {}
    uncertainties: dict[str, float] = {}
    routes: tuple[str, ...] = ()
    work: StoredWork = {}
    made_with: tuple[str, ...] = ()
    provenance: str = ""
    fault: str = ""


ENVELOPE = "envelope"  # the role of a run that is made for its extremes over all steps
CHART = "chart"  # the role of runs that are made for charts of speed against accuracy

RunStatus = Literal["finished", "diverged", "failed", "crashed", "did not finish", "refused", "did not run"]


class _OneRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="record"):
    """Base of all records."""


class ContractState(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the contract of an outside engine stood in a session, by the last `crosscheck contract` in its folder.

    `sources` is the digest of the engine's sources in the session. `kept` is None if all clauses were never tried, else
    whether they held `at` that time, with the `headline` of the trial. `changed`: what has changed since, if anything.
    """

    sources: str
    kept: bool | None = None
    headline: str = ""
    at: str = ""
    changed: str = ""

    @property
    def good(self) -> bool:
        """Whether these very sources kept it."""
        return self.kept is True and not self.changed

    def words(self, engine: str) -> str:
        """One line on it, with the remedy."""
        remedy = f"crosscheck contract {engine}, with the same --out"
        if self.kept is None:
            return f"{engine} (sources {self.sources}): it is not known whether its contract is kept: {remedy}"
        outcome = f"contract {'kept' if self.kept else 'broken'} on {self.at[:10]}: {self.headline}"
        if self.changed:
            return f"{engine} (sources {self.sources}): {self.changed} have changed since; {outcome}: {remedy}"
        return f"{engine} (sources {self.sources}): {outcome}"


class Environment(_OneRecord, frozen=True, kw_only=True, tag="environment"):
    """Machine and versions of one session, and the cases and engines asked for; no engines means all.

    A session that `confirms` writes a `Confirmed` for each earlier result that it reuses; older versions did not.
    `contracts`: of outside engines, by name, whether they keep the contract. `code`: digest of our sources, "" in older
    records.
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
    contracts: dict[str, ContractState] = {}
    code: str = ""


class VariantInfo(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the report needs of a variant's scene: levels of its bodies, its drawing, or why it could not be made.

    `drawing` uses the markers of every run, `film` those of a run made for the animation. `basis` identifies scene,
    transformation and sample times as given in the case's files ("" in older records). `coordinates` are the names of
    those by which derivatives are given, where the variant asks for them. `undetermined` names the components that the
    motion does not determine (`crosscheck.engines.openness`), as follows from the scene
    (`crosscheck.running.undetermined`), whatever engines say. Records of earlier versions name whole channels, or say
    nothing.
    """

    level: str
    drawing: Drawing | None
    error: str = ""
    film: Drawing | None = None
    basis: str = ""
    coordinates: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET
    undetermined: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET


class CaseRecord(_OneRecord, frozen=True, kw_only=True, tag="case"):
    """A case as it was run: its run file reduced to the engines asked for, provenance, README, variants, accepted
    figures, its stored reference if it has one, and digests of the `files` in its folder.

    `asked` are the engines asked for by name, `joined` those of them that the case does not name. `unreferenced`: it
    has a recipe of a reference, but the reference was never made. `whole`: all its engines and comparisons are there,
    as none was asked for alone. `claims` are the user's own on the engines that run.
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
    whole: bool = False
    claims: Claims = Claims()


class RunRecord(_OneRecord, frozen=True, kw_only=True, tag="run"):
    """One run of one engine at one effort, or why there is none (then `effort` is empty).

    `role` is "main", "refined", "control:<name>", "film" or "envelope". `rung` is the number of the effort, from coarse
    to fine, of `rungs`. `scene` identifies scene and sample times, `made_by` everything else that the result depends on
    (see `made_by.py`; "" in older records). `compile_s` is conversion and warm-up, `wall_s` the solve alone, `cpu_s`
    the processor time of the whole call, outputs included, on all threads. `evaluations`, `steps` and `operations` are
    0 where the engine does not count them, and in older records.

    `status`: "finished"; "diverged", by the engine's statement; "failed" if the adapter raised or broke the contract;
    "crashed" if its process died; "did not finish" within its limits of time and memory; "refused"; "did not run".
    `undetermined` names components that the motion does not determine, as the engine says: they are stored as NaN, and
    channels that have no others are not stored (of earlier versions, whole channels). `events`
    are names and times (s) of what happened in the run. `envelope`, of the role "envelope", are extremes by channel, as
    rows of `crosscheck.engines.extremes`. `rounding`, of variants that ask for it, is how far (SI) each
    channel is moved by a unit in the last place of all inputs.
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
    cpu_s: float = 0.0
    evaluations: int = 0
    steps: int = 0
    operations: int = 0
    times: Packed | None = None
    channels: dict[str, Packed] = {}
    undetermined: tuple[str, ...] = ()
    events: tuple[tuple[str, float], ...] = ()
    envelope: dict[str, Packed] = {}
    rounding: dict[str, float] = {}

    @property
    def key(self) -> tuple[str, ...]:
        """The identity of the run: a later record with the same key replaces an earlier one."""
        return (self.case, self.variant, self.role, self.engine, self.effort)


class ChartRecord(_OneRecord, frozen=True, kw_only=True, tag="chart"):
    """The runs that one engine made for the charts of a variant, beside those that are judged.

    `made_by` also stands for the charts' references and targets. `message` says why there are fewer runs than targets.
    """

    case: str
    variant: str
    engine: str
    scene: str
    made_by: str = ""
    runs: tuple[RunRecord, ...] = ()
    message: str = ""
    role: str = CHART

    @property
    def key(self) -> tuple[str, ...]:
        """Its identity: a later record with the same key replaces an earlier one."""
        return (self.case, self.variant, self.role, self.engine)


class Confirmed(_OneRecord, frozen=True, kw_only=True, tag="confirmed"):
    """States that the result which an earlier session recorded under this key is also a result of this session."""

    case: str
    variant: str
    role: str
    engine: str
    scene: str
    made_by: str


@dataclass(frozen=True)
class BrokenLine:
    """A line of a records file that is not a record, and why."""

    file: str
    number: int
    reason: str

    def __str__(self) -> str:
        return f"{self.file}, line {self.number}: not a record of this version: {self.reason}"


Written = Environment | CaseRecord | RunRecord | ChartRecord | Confirmed
Record = Written | BrokenLine
