"""Runs that test items share: an engine runs a case once in a session, in the first process of xdist that needs it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from urllib.parse import quote

import msgspec
from filelock import FileLock

from crosscheck.conformance.trial import ClauseOutcome, try_engine
from crosscheck.engines.registry import PROVIDER
from crosscheck.judging.outcome import SessionOutcome, conclude
from crosscheck.judging.results import collect
from crosscheck.library.find import Case
from crosscheck.records.archive import read
from crosscheck.records.session import last_session
from crosscheck.running.plan import plan
from crosscheck.running.scheduler import Limits
from crosscheck.running.sweep import run_planned
from flexmb.output.files import write_whole

DONE, LOCK = "session", ".crosscheck.lock"


class SessionRuns:
    """The runs of a session: records below `folder`, in a folder for each case and engine, judged on request."""

    def __init__(self, folder: Path, session: str, provider: str = PROVIDER) -> None:
        self.folder = folder
        self.session = session
        self.provider = provider
        self._outcomes: dict[tuple[str, str], SessionOutcome] = {}
        self._clauses: dict[str, dict[str, ClauseOutcome]] = {}

    def outcome(self, case: Case, engine: str) -> SessionOutcome:
        """The verdicts of an engine on a case against its stored reference; the engine runs if it has not yet."""
        key = (case.name, engine)
        if key not in self._outcomes:
            place = self.folder / case.name / quote(engine, safe="")
            records = place / "records.jsonl"
            with self._once(place) as first:
                if first:
                    planned = plan(replace(case, alone=True), (engine,), self.provider)
                    run_planned([planned], (engine,), records, fresh=True, limits=Limits(workers=1))
            self._outcomes[key] = conclude(collect(last_session(read(records))))
        return self._outcomes[key]

    def clause(self, engine: str, name: str) -> ClauseOutcome:
        """The outcome of a clause of the contract; all are tried when the first is requested."""
        if engine not in self._clauses:
            place = self.folder / "contract" / quote(engine, safe="")
            file = place / "clauses.json"
            with self._once(place) as first:
                if first:
                    outcomes = list(try_engine(engine, provider=self.provider))
                    write_whole(file, msgspec.json.encode(outcomes))
            outcomes = msgspec.json.decode(file.read_bytes(), type=list[ClauseOutcome])
            self._clauses[engine] = {outcome.clause: outcome for outcome in outcomes}
        return self._clauses[engine][name]

    @contextmanager
    def _once(self, place: Path) -> Iterator[bool]:
        """Whether this process is the first of the session; others wait until it is done."""
        place.mkdir(parents=True, exist_ok=True)
        with FileLock(place / LOCK):
            done = place / DONE
            first = not done.exists() or done.read_text(encoding="utf-8") != self.session
            yield first
            write_whole(done, self.session)
