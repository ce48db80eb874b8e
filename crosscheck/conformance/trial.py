"""Trying an engine clause by clause, each in a worker process: one that crashes or hangs costs its clause alone."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

from crosscheck.conformance.catalogue import CLAUSES
from crosscheck.conformance.clause import Clause, ClauseBroken, NotOffered
from crosscheck.engines.answers import BrokenContract, clean
from crosscheck.engines.contract import Engine, EngineMissing
from crosscheck.running.execute import describe, find_engine
from crosscheck.running.pool import run_jobs
from crosscheck.running.sweep import PROVIDER

CLAUSE_LIMIT_S = 180.0  # an engine may have to compile at its first clause

ClauseStatus = Literal["holds", "broken", "not offered", "missing"]


@dataclass(frozen=True)
class ClauseOutcome:
    """What came of a clause; `message` says why it does not hold, or was not tried."""

    clause: str
    sentence: str
    status: ClauseStatus
    message: str = ""


class ClauseTrial(NamedTuple):
    """One clause to be tried on one engine of a provider, "module:function"."""

    provider: str
    engine: str
    clause: str


def try_clause(engine: Engine, clause: Clause) -> ClauseOutcome:
    """Try one clause in this process. Whatever the engine does but ending the process has an outcome."""
    try:
        clause.check(engine)
    except NotOffered as reason:
        return ClauseOutcome(clause.name, clause.sentence, "not offered", clean(str(reason)))
    except EngineMissing as error:
        return ClauseOutcome(clause.name, clause.sentence, "missing", clean(str(error)))
    except (ClauseBroken, BrokenContract) as error:
        return ClauseOutcome(clause.name, clause.sentence, "broken", clean(str(error)))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a call of sys.exit too
        return ClauseOutcome(clause.name, clause.sentence, "broken", describe(error))
    return ClauseOutcome(clause.name, clause.sentence, "holds")


def try_engine(
    name: str, clauses: tuple[str, ...] = tuple(CLAUSES), provider: str = PROVIDER, limit_s: float = CLAUSE_LIMIT_S
) -> Iterator[ClauseOutcome]:
    """Try clauses on the engine called `name`, one after the other, each after at most `limit_s` seconds broken."""
    trials = [ClauseTrial(provider, name, clause) for clause in clauses]
    with tempfile.TemporaryDirectory() as folder:
        log = str(Path(folder) / "log")
        for event in run_jobs(attempt, trials, 1, log, kind=_engine, time_limit_s=lambda trial: limit_s):
            if event.kind == "emitted":
                yield event.content
            elif event.kind in ("crashed", "stopped"):
                clause = CLAUSES[trials[event.job].clause]
                yield ClauseOutcome(clause.name, clause.sentence, "broken", clean(str(event.content)))


def attempt(trial: ClauseTrial, emit: Callable[[ClauseOutcome], None]) -> None:
    """What a worker does with a trial."""
    clause = CLAUSES[trial.clause]
    found = find_engine(trial.provider, trial.engine)
    if isinstance(found, str):
        emit(ClauseOutcome(clause.name, clause.sentence, "missing", found))
    else:
        emit(try_clause(found, clause))


def verdict_on(outcomes: list[ClauseOutcome]) -> tuple[bool, str]:
    """Whether the contract is kept, and that in a sentence.

    Nothing is broken or missing, and at least one clause that holds numbers against mechanics was tried: an engine that
    refuses every scene has shown nothing.
    """
    counts = {status: sum(each.status == status for each in outcomes) for status in ("holds", "broken", "not offered")}
    missing = next((each for each in outcomes if each.status == "missing"), None)
    if missing is not None:
        return False, missing.message
    text = f"{counts['holds']} of {len(outcomes)} clauses hold, {counts['broken']} broken"
    text += f", {counts['not offered']} not offered"
    shown = any(each.status == "holds" and CLAUSES[each.clause].physical for each in outcomes)
    if not shown and not counts["broken"]:
        return False, f"{text}: nothing was shown, since the engine refuses every scene with a known answer"
    return counts["broken"] == 0, text


def _engine(trial: ClauseTrial) -> str:
    return trial.engine
