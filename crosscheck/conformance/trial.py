"""Trying an engine clause by clause, in processes that no other clause can spoil.

A clause on the form of an answer has a process of its own. Those on mechanics share one, in which the engine starts
and compiles once; one that is broken there is tried again alone, and only that counts: no clause is broken by what
another one left behind. A new interpreter for each would take a second or two, most of it for imports. So where the
system supports it, processes are forked from one that has imported this package and the native engine and has called
nothing.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing import get_all_start_methods, get_context
from pathlib import Path
from typing import Literal, NamedTuple

from crosscheck.conformance import CLAUSE_LIMIT_S
from crosscheck.conformance.catalogue import CLAUSES, SHOWN
from crosscheck.conformance.clause import Clause, ClauseBroken, NotOffered
from crosscheck.engines.answers import BrokenContract, checked_precision, clean, describe
from crosscheck.engines.contract import Engine, EngineMissing, Precision
from crosscheck.engines.registry import PROVIDER, NoSuchEngine, find_engine
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import Work
from crosscheck.running.worker import SPAWN, Method

FORKED: Method = "forkserver"
IMPORTED = ("crosscheck.conformance.trial", "crosscheck.engines.native")  # in the process from which others are forked

ClauseStatus = Literal["holds", "broken", "not offered", "missing"]


@dataclass(frozen=True)
class ClauseOutcome:
    """The outcome of a clause.

    `message` says why it does not hold or was not tried, `offer` what the engine would have to offer. `precision` is
    the one that the engine states, from which the clause takes its bounds.
    """

    clause: str
    sentence: str
    status: ClauseStatus
    message: str = ""
    offer: str = ""
    precision: Precision = "double"


class ClauseTrial(NamedTuple):
    """One clause to be tried on one engine of a provider, "module:function", in a process `alone` or a shared one."""

    provider: str
    engine: str
    clause: str
    alone: bool = True


Listener = Callable[[int, str], None]


def try_clause(engine: Engine, clause: Clause) -> ClauseOutcome:
    """Try one clause in this process. Everything that the engine does, except ending the process, has an outcome."""
    precision: Precision = "double"

    def outcome(status: ClauseStatus, message: str = "", offer: str = "") -> ClauseOutcome:
        return ClauseOutcome(clause.name, clause.sentence, status, clean(message), clean(offer), precision)

    try:
        precision = checked_precision(engine)
        clause.check(engine)
    except NotOffered as reason:
        return outcome("not offered", str(reason), reason.offer)
    except EngineMissing as error:
        return outcome("missing", str(error))
    except (ClauseBroken, BrokenContract) as error:
        return outcome("broken", str(error))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a call of sys.exit too
        return outcome("broken", describe(error))
    return outcome("holds")


def try_engine(
    name: str,
    clauses: tuple[str, ...] = tuple(CLAUSES),
    provider: str = PROVIDER,
    limit_s: float = CLAUSE_LIMIT_S,
    workers: int = 1,
    listener: Listener = lambda done, clause: None,
) -> Iterator[ClauseOutcome]:
    """Try clauses on the engine called `name`, `workers` at a time; the outcomes are in the order of the clauses.

    One that takes more than `limit_s` seconds is broken. The `listener` hears the number of clauses that are decided,
    and the name of one that begins.
    """
    shared = [clause for clause in clauses if CLAUSES[clause].physical]
    trials = [ClauseTrial(provider, name, clause, clause not in shared or len(shared) == 1) for clause in clauses]
    decided: dict[str, ClauseOutcome] = {}
    waiting = list(clauses)
    with tempfile.TemporaryDirectory() as folder:
        log = str(Path(folder) / "log")
        for event in run_jobs(Work(attempt, trials, log, workers, _process, lambda trial: limit_s), _start_method()):
            trial = trials[event.job]
            clause = CLAUSES[trial.clause]
            if event.kind == "started":
                listener(len(decided), trial.clause)
                continue
            if event.kind == "ended":
                continue
            outcome: ClauseOutcome = event.content
            if event.kind in ("crashed", "stopped"):
                outcome = ClauseOutcome(clause.name, clause.sentence, "broken", clean(str(event.content)))
            if outcome.status == "broken" and not trial.alone:
                trials.append(trial._replace(alone=True))
                continue
            decided[trial.clause] = outcome
            while waiting and waiting[0] in decided:
                yield decided[waiting.pop(0)]


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


def verdict_on(outcomes: list[ClauseOutcome], chosen: bool = False) -> ContractVerdict:
    """The verdict on an engine; of `chosen` clauses, which are not all, that at least one holds and none is broken.

    The contract is kept if no clause is broken or missing and the essential ones were tried: the form of an answer, and
    a run that is known in closed form.
    """
    counts = {
        status: sum(outcome.status == status for outcome in outcomes) for status in ("holds", "broken", "not offered")
    }
    missing = next((outcome for outcome in outcomes if outcome.status == "missing"), None)
    if missing is not None:
        return ContractVerdict(False, False, missing.message)
    single = any(outcome.precision == "single" for outcome in outcomes)
    which = "clauses that were chosen" if chosen else "clauses"
    text = f"{counts['holds']} of {len(outcomes)} {which} hold{' in single precision' if single else ''}"
    text += f", {counts['broken']} broken"
    if counts["not offered"]:
        text += f", {counts['not offered']} not tried, since it does not offer what they are about"
    holding = {outcome.clause for outcome in outcomes if outcome.status == "holds"}
    formal = all(outcome.clause in holding for outcome in outcomes if not CLAUSES[outcome.clause].physical)
    if counts["broken"]:
        return ContractVerdict(False, not counts["not offered"], text)
    if chosen:
        return ContractVerdict(bool(holding), False, text)
    if not formal or not holding.intersection(SHOWN):
        return ContractVerdict(False, False, f"{text}: too little was shown. Offer first: {_first_offer(outcomes)}")
    return ContractVerdict(True, not counts["not offered"], text)


def to_offer(outcomes: list[ClauseOutcome]) -> dict[str, list[str]]:
    """For each thing that an engine would have to offer, the clauses that need it."""
    clauses: dict[str, list[str]] = {}
    for outcome in outcomes:
        if outcome.status == "not offered":
            clauses.setdefault(outcome.offer, []).append(outcome.clause)
    return clauses


def _first_offer(outcomes: list[ClauseOutcome]) -> str:
    wanted = [outcome for outcome in outcomes if outcome.clause in SHOWN or not CLAUSES[outcome.clause].physical]
    return next((outcome.offer for outcome in wanted if outcome.status == "not offered"), "a scene with a known answer")


def _process(trial: ClauseTrial) -> str:
    """The kind of a trial: those of one kind share a process."""
    return trial.clause if trial.alone else "shared"


def _start_method() -> Method:
    if FORKED not in get_all_start_methods():
        return SPAWN
    get_context(FORKED).set_forkserver_preload(list(IMPORTED))
    return FORKED
