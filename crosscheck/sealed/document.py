"""The contents of results.json: verdicts, figures, statuses and times of runs, digests of their sources.

The file is one JSON object. Every key:

- ``format`` "crosscheck results" and ``version`` 1; a reader refuses others;
- ``sha256``: hex digest of the file without this key and the line end (`crosscheck.sealed.seal`);
- ``unfinished`` (left out: false): the session has not ended, and the file contains no verdicts;
- ``exit_code`` of the session (0 or 1), ``headline`` in words, ``strict``, the ``engines`` asked for (none: all);
- ``made``: ``at`` (UTC), ``python``, ``system``, ``processor``, ``packages`` and ``engines`` with their versions, and
  ``code``, a digest of all sources of flexmb and crosscheck (left out: the session is of an older version);
- ``contracts`` (left out if empty): of outside engines by name whether they keep the contract: digest of their
  ``sources``, ``kept`` (left out: all clauses were never tried), ``at``, ``headline`` and what has ``changed`` since;
- ``records``: SHA-256 of the records.jsonl that was judged, "" if there was none; ``broken``: the number of its invalid
  lines;
- ``cases``, by name, each with

  - ``files``: SHA-256 of the case's files (run.toml, scenes, provenance, reference.csv ...) when it was run;
  - ``scenes``: digest of the scene and the sample times of each variant;
  - ``verdicts``: by comparison and "channel | engine (variant) | engine (variant)": ``kind`` (left out: "comparison"),
    ``status``, ``expected`` (left out: "agree"), ``ok`` (left out: true), ``E``, ``U`` (relative; left out where there
    is none), ``goal``, ``worse`` (E or U is beyond the accepted figure), ``stale`` (what is another than it was when
    that was accepted) and, where it is not as expected, ``reason``; where an engine claims a goal of its own
    ``case_goal``, that of the case; where the user expects it to fail ``own_failure``, the place that says so;
  - ``claims`` (left out if there are none): the user's ``goals``, ``failures`` and ``efforts`` for engines, by which it
    was judged, each with its ``place`` (`crosscheck.library.claims`);
  - ``not_applicable`` (left out if empty): the engine's reason by "variant | engine", or "variant | engine | channel"
    where it is one channel, of engines that the case names nowhere; ``unreferenced`` (left out: false): it has a recipe
    of a reference and no reference;
  - ``unjudged`` (left out if empty): the reason by "variant | engine | channel" of channels that are offered and judged
    by nothing, as `[[open]]` of the case gives it; a strict session demands one for each channel of the case's engines,
    and of engines that joined that theirs are as others have them;
  - ``peaks`` (left out unless the session had ``--envelope``): by "variant | engine | channel" the largest magnitude
    over all steps of a run, and its time (s);
  - ``runs``: by "variant | engine | role": ``status``, ``effort``, ``wall_s`` and ``compile_s`` of the finest effort,
    ``cpu_s`` (of the whole call, on all threads), ``evaluations``, ``steps`` and ``operations``; what the engine does
    not count is left out and named in ``uncounted``. They are the work of every verdict whose key names engine and
    variant, with the role "control:<comparison>" for the first side of a control;
  - ``work_changes`` (left out if empty): by "variant | engine | effort | count" what a run that made the stored
    reference took, and what it takes now, where they are more than a tenth apart;
  - ``margins`` (left out if empty): by comparison the goals that are met by a factor below 3 ("narrow") or above 1e4
    ("wide"): how many of how many agreements, the extreme margin, its channel and its goal.

Figures have four digits, times three.
"""

from __future__ import annotations

import math
from pathlib import Path

import msgspec

from crosscheck.judging.figures import key_of
from crosscheck.judging.margins import Flag
from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.peaks import has_envelopes, peaks
from crosscheck.judging.results import CaseResults, Result, Session
from crosscheck.judging.verdict import Status, Verdict, VerdictKind
from crosscheck.judging.work import work_of
from crosscheck.library.claims import Claims
from crosscheck.library.digests import file_digest
from crosscheck.records.kinds import ENVELOPE, ContractState, RunStatus

FORMAT, VERSION = "crosscheck results", 1


class _SealedPart(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """Base of the parts of the file: unknown keys are errors, defaults are left out."""


class SealedVerdict(_SealedPart, frozen=True, kw_only=True):
    """One channel of one comparison."""

    status: Status
    kind: VerdictKind = "comparison"
    expected: Status = "agree"
    ok: bool = True
    E: float | None = None
    U: float | None = None
    goal: float = 0.0
    worse: str = ""
    stale: str = ""
    reason: str = ""
    case_goal: float | None = None
    own_failure: str = ""


class SealedRun(_SealedPart, frozen=True, kw_only=True):
    """One engine on one variant, at its finest effort; times in s."""

    status: RunStatus
    effort: str = ""
    wall_s: float = 0.0
    compile_s: float = 0.0
    cpu_s: float = 0.0
    evaluations: int = 0
    steps: int = 0
    operations: int = 0
    uncounted: tuple[str, ...] = ()


class SealedMargin(_SealedPart, frozen=True, kw_only=True):
    """How many `channels` of the `judged` agreements have the flag; the `extreme` margin with its channel and goal."""

    channels: int
    judged: int
    extreme: float
    channel: str
    goal: float


class SealedCase(_SealedPart, frozen=True, kw_only=True):
    """A case: digests of files and scenes, verdicts by comparison, runs, what is not applicable and what not judged."""

    files: dict[str, str]
    scenes: dict[str, str]
    verdicts: dict[str, dict[str, SealedVerdict]]
    runs: dict[str, SealedRun]
    peaks: dict[str, tuple[float, float]] = {}
    not_applicable: dict[str, str] = {}
    unjudged: dict[str, str] = {}
    unreferenced: bool = False
    claims: Claims | None = None
    work_changes: dict[str, tuple[int, int]] = {}
    margins: dict[str, dict[Flag, SealedMargin]] = {}


class Origin(_SealedPart, frozen=True, kw_only=True):
    """When, where and with what the session was run."""

    at: str = ""
    python: str = ""
    system: str = ""
    processor: str = ""
    packages: dict[str, str] = {}
    engines: dict[str, str] = {}
    code: str = ""


class SealedResults(_SealedPart, frozen=True, kw_only=True):
    """The whole file, but for its seal."""

    format: str = ""
    version: int = 0
    unfinished: bool = False
    exit_code: int
    headline: str
    strict: bool = False
    engines: tuple[str, ...] = ()
    made: Origin
    contracts: dict[str, ContractState] = {}
    records: str
    broken: int = 0
    cases: dict[str, SealedCase]


def results_of(session: Session, outcome: SessionOutcome, records: Path) -> SealedResults:
    """The file's content for a judged session and the file of its records."""
    latest = session.environments[-1] if session.environments else None
    versions = {
        result.engine: result.finest.version
        for case in session.cases
        for result in case.results.values()
        if result.runs and result.finest.version
    }
    made = Origin() if latest is None else Origin(
        at=latest.started, python=latest.python, system=latest.system, processor=latest.processor,
        packages=latest.packages, engines=versions, code=latest.code,
    )  # fmt: skip
    return SealedResults(
        format=FORMAT,
        version=VERSION,
        unfinished=outcome.unfinished,
        exit_code=0 if outcome.ok else 1,
        headline=outcome.headline,
        strict=outcome.strict,
        engines=() if latest is None else latest.engines,
        made=made,
        contracts=dict(outcome.contracts),
        records=file_digest(records) if records.exists() else "",
        broken=len(outcome.broken),
        cases={case.case.case: _case(case, outcome) for case in session.cases},
    )


def _case(case: CaseResults, outcome: SessionOutcome) -> SealedCase:
    name = case.case.case
    judged: dict[str, dict[str, SealedVerdict]] = {}
    for verdict in outcome.verdicts[name]:
        judged.setdefault(verdict.comparison, {})[key_of(verdict)] = _verdict(verdict)
    mains = {key: result for key, result in case.results.items() if result.runs}
    return SealedCase(
        files=case.case.files,
        scenes={variant: result.finest.scene for (variant, _, role), result in mains.items() if role == "main"},
        verdicts=judged,
        runs={" | ".join(key): _run(result) for key, result in case.results.items() if key[2] != ENVELOPE},
        peaks={
            " | ".join((*peak.whose, peak.channel)): (float(f"{peak.size:.4g}"), float(f"{peak.t:.6g}"))
            for peak in (peaks(case) if has_envelopes(case) else ())
            if peak.is_whole
        },
        not_applicable={
            " | ".join(filter(None, (absence.variant, absence.engine, absence.channel))): absence.reason
            for absence in outcome.inapplicable
            if absence.case == name
        },
        unjudged={channel.key: channel.reason for channel in outcome.unjudged if channel.case == name},
        unreferenced=name in outcome.unreferenced,
        claims=None if case.case.claims == Claims() else case.case.claims,
        work_changes={
            " | ".join((change.variant, change.engine, change.effort, change.count)): (change.then, change.now)
            for change in outcome.work_changes
            if change.case == name
        },
        margins=_margins(case, outcome),
    )


def _margins(case: CaseResults, outcome: SessionOutcome) -> dict[str, dict[Flag, SealedMargin]]:
    found: dict[str, dict[Flag, SealedMargin]] = {}
    for each in outcome.flagged:
        if each.case == case.case.case:
            found.setdefault(each.comparison, {})[each.flag] = SealedMargin(
                channels=each.channels, judged=each.judged, extreme=float(f"{each.extreme:.3g}"), channel=each.channel,
                goal=each.goal,
            )  # fmt: skip
    return found


def _verdict(verdict: Verdict) -> SealedVerdict:
    return SealedVerdict(
        status=verdict.status,
        kind=verdict.kind,
        expected=verdict.expected,
        ok=verdict.ok,
        E=_short(verdict.E, 4),
        U=_short(verdict.U, 4),
        goal=verdict.goal,
        worse=verdict.worse,
        stale=verdict.stale,
        reason="" if verdict.ok else verdict.reason,
        case_goal=verdict.case_goal,
        own_failure=verdict.own_failure,
    )


def _run(result: Result) -> SealedRun:
    if not result.runs:
        return SealedRun(status=result.status)
    finest, work = result.finest, work_of(result.finest)
    wall, compiling, cpu = (_short(seconds, 3) or 0.0 for seconds in (finest.wall_s, finest.compile_s, finest.cpu_s))
    return SealedRun(
        status=result.status, effort=finest.effort, wall_s=wall, compile_s=compiling, cpu_s=cpu,
        evaluations=work.evaluations, steps=work.steps, operations=work.operations, uncounted=work.uncounted,
    )  # fmt: skip


def _short(number: float | None, digits: int) -> float | None:
    """The number rounded to some significant digits; None if JSON cannot represent it."""
    return float(f"{number:.{digits}g}") if number is not None and math.isfinite(number) else None
