"""Trying an engine clause by clause, each in a process of its own, so that clauses cannot affect each other.

A new interpreter for each would take a second or two, most of it for imports. So where the system supports it, they
are forked from a process that has imported this package and the native engine and has called
nothing.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing import get_all_start_methods, get_context
from pathlib import Path
from typing import Literal, NamedTuple

from crosscheck.conformance.catalogue import CLAUSES, SHOWN
from crosscheck.conformance.clause import Clause, ClauseBroken, NotOffered
from crosscheck.conformance.limit import CLAUSE_LIMIT_S
from crosscheck.engines.answers import BrokenContract, clean, describe
from crosscheck.engines.contract import Engine, EngineMissing
from crosscheck.running.execute import NoSuchEngine, find_engine
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import Work
from crosscheck.running.sweep import PROVIDER
from crosscheck.running.worker import SPAWN, Method

FORKED: Method = "forkserver"
IMPORTED = ("crosscheck.conformance.trial", "crosscheck.engines.native")  # in the process from which others are forked

ClauseStatus = Literal["holds", "broken", "not offered", "missing"]


@dataclass(frozen=True)
class ClauseOutcome:
    """The outcome of a clause.

    `message` says why it does not hold or was not tried, `offer` what the engine would have to offer.
    """

    clause: str
    sentence: str
    status: ClauseStatus
    message: str = ""
    offer: str = ""


class ClauseTrial(NamedTuple):
    """One clause to be tried on one engine of a provider, "module:function"."""

    provider: str
    engine: str
    clause: str


def try_clause(engine: Engine, clause: Clause) -> ClauseOutcome:
    """Try one clause in this process. Everything that the engine does, except ending the process, has an outcome."""
    try:
        clause.check(engine)
    except NotOffered as reason:
        return ClauseOutcome(clause.name, clause.sentence, "not offered", clean(str(reason)), clean(reason.offer))
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
    """Try clauses on the engine called `name`, one after the other; one that takes more than `limit_s` seconds is
    broken."""
    trials = [ClauseTrial(provider, name, clause) for clause in clauses]
    with tempfile.TemporaryDirectory() as folder:
        log = str(Path(folder) / "log")
        for event in run_jobs(Work(attempt, trials, log, 1, _clause, lambda trial: limit_s), _start_method()):
            if event.kind == "emitted":
                yield event.content
            elif event.kind in ("crashed", "stopped"):
                clause = CLAUSES[trials[event.job].clause]
                yield ClauseOutcome(clause.name, clause.sentence, "broken", clean(str(event.content)))


def attempt(trial: ClauseTrial, emit: Callable[[ClauseOutcome], None]) -> None:
    clause = CLAUSES[trial.clause]
    try:
        engine = find_engine(trial.provider, trial.engine)
    except NoSuchEngine as error:
        emit(ClauseOutcome(clause.name, clause.sentence, "missing", str(error)))
    else:
        emit(try_clause(engine, clause))


@dataclass(frozen=True)
class ContractVerdict:
    """Whether the contract is `kept`, whether the `whole` of it was tried, and both in a sentence."""

    kept: bool
    whole: bool
    text: str


def verdict_on(outcomes: list[ClauseOutcome]) -> ContractVerdict:
    """The verdict on an engine.

    The contract is kept if no clause is broken or missing and the essential ones were tried: the form of an answer, and
    a run that is known in closed form.
    """
    counts = {status: sum(each.status == status for each in outcomes) for status in ("holds", "broken", "not offered")}
    missing = next((each for each in outcomes if each.status == "missing"), None)
    if missing is not None:
        return ContractVerdict(False, False, missing.message)
    text = f"{counts['holds']} of {len(outcomes)} clauses hold, {counts['broken']} broken"
    if counts["not offered"]:
        text += f", {counts['not offered']} not tried, since it does not offer what they are about"
    holding = {each.clause for each in outcomes if each.status == "holds"}
    formal = all(each.clause in holding for each in outcomes if not CLAUSES[each.clause].physical)
    if counts["broken"]:
        return ContractVerdict(False, not counts["not offered"], text)
    if not formal or not holding.intersection(SHOWN):
        return ContractVerdict(False, False, f"{text}: too little was shown. Offer first: {_first_offer(outcomes)}")
    return ContractVerdict(True, not counts["not offered"], text)


def to_offer(outcomes: list[ClauseOutcome]) -> dict[str, list[str]]:
    """For each thing that an engine would have to offer, the clauses that need it."""
    found: dict[str, list[str]] = {}
    for each in outcomes:
        if each.status == "not offered":
            found.setdefault(each.offer, []).append(each.clause)
    return found


def _first_offer(outcomes: list[ClauseOutcome]) -> str:
    wanted = [each for each in outcomes if each.clause in SHOWN or not CLAUSES[each.clause].physical]
    return next((each.offer for each in wanted if each.status == "not offered"), "a scene with a known answer")


def _clause(trial: ClauseTrial) -> str:
    """The kind of a trial: one process for each clause."""
    return trial.clause


def _start_method() -> Method:
    if FORKED not in get_all_start_methods():
        return SPAWN
    get_context(FORKED).set_forkserver_preload(list(IMPORTED))
    return FORKED
