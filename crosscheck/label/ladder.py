"""The rules by which evidence gives a level: for each factor rungs, of which the highest that is met is its level.

A rung asks for everything that its level needs by itself. Level 4 of most factors, and what else needs somebody who
knows the intended use, no file can show: such rungs are never met, and say so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

from crosscheck.judging.against_reference import REFERENCE
from crosscheck.judging.outcome import FAULTS
from crosscheck.judging.unjudged import UNSAID
from crosscheck.label.evidence import MEASURED, PROVENANCE, Exhibits, Labelled, Piece, SessionEvidence
from crosscheck.label.factors import Factor
from crosscheck.library.basis import Basis
from crosscheck.library.find import shipped_names
from crosscheck.sealed.document import SealedCase, SealedVerdict

BY_PEOPLE = "no file shows it: an assessment by people who know the intended use"


@dataclass(frozen=True)
class FactorRung:
    """A level, whether the files reach it, what they say of it, and what would reach it."""

    level: int
    met: bool
    says: str
    remedy: str


@dataclass(frozen=True)
class Looked:
    """A factor's rungs, from the lowest, and the pieces of evidence that were looked at."""

    rungs: tuple[FactorRung, ...]
    pieces: tuple[Piece, ...]


def looked(factor: Factor, subject: Labelled, found: Exhibits) -> Looked:
    """What the evidence says of a factor."""
    rules, pieces = RULES[factor]
    return Looked(tuple(rules(subject, found)), tuple(pieces(found)))


def _data_pedigree(subject: Labelled, found: Exhibits) -> Iterator[FactorRung]:
    provenance, budgets = found.provenance.content, found.budgets.content
    sources = provenance.sources if provenance else budgets.sources if budgets else ()
    yield FactorRung(1, bool(sources), f"{len(sources)} sources are named", _name_sources(subject))
    anchors = provenance.anchors if provenance else ()
    readings = f"{budgets.points} readings with a width" if budgets else ""
    yield FactorRung(
        2, bool(anchors or budgets), readings or f"{len(anchors)} published numbers with source and uncertainty",
        f"give published numbers as [[anchor]] of {PROVENANCE}, or readings: {_validate(subject)}",
    )  # fmt: skip
    yield FactorRung(
        3, budgets is not None and all(series.stated for series in budgets.series),
        "the source states the width of every reading", "a measured set whose source states the width of its readings",
    )  # fmt: skip
    yield FactorRung(4, False, "", BY_PEOPLE)


def _verification(subject: Labelled, found: Exhibits) -> Iterator[FactorRung]:
    routes, session, budgets = found.reference.content, found.session.content, found.budgets.content
    agreed = _agreements(session.case) if session else {}
    runs = _by(subject, "run")
    says = (
        f"the stored reference rests on {routes.words}" if routes
        else f"{len(agreed)} channels agree" if agreed
        else "predictions are refined"
    )  # fmt: skip
    yield FactorRung(1, bool(routes or agreed or budgets), says, runs)
    apart = [key for key in agreed if _independent(key, routes)]
    independent = routes is not None and not routes.alone
    says = f"{len(apart)} channels of independent codes agree" if apart else says
    yield FactorRung(2, bool(independent or apart), says, f"{runs}, by an independent code")
    controls = _controls(session.case) if session else {}
    noticed = sum(controls.values())
    says = f"{says}, each with E within U, {noticed} of {len(controls)} planted faults are noticed"
    open_ends = _open_ends(session.case) if session else ["there is no fresh session"]
    estimated = bool(apart) and bool(noticed) and noticed == len(controls) and not _failed_agreements(session)
    yield FactorRung(
        3, estimated, says,
        runs if session is None or controls else "plant a fault: add a [[control]] to run.toml, and run it",
    )  # fmt: skip
    yield FactorRung(4, estimated and not open_ends, f"{says}; nothing else is open", "; ".join(open_ends) or runs)


def _validation(subject: Labelled, found: Exhibits) -> Iterator[FactorRung]:
    provenance, budgets = found.provenance.content, found.budgets.content
    anchors = provenance.anchors if provenance and found.reference.content else ()
    yield FactorRung(
        1, bool(anchors), f"the stored reference meets {len(anchors)} published numbers",
        f"give published numbers as [[anchor]] of {PROVENANCE}, then {_by(subject, 'regenerate')}"
        if subject.run else _validate(subject),
    )  # fmt: skip
    series = budgets.series if budgets else ()
    valid = [each for each in series if each.standing == "validated"]
    says = f"{len(valid)} of {len(series)} series are within their validation uncertainty"
    yield FactorRung(2, bool(series), says, _validate(subject))
    yield FactorRung(3, bool(series) and len(valid) == len(series), says, "a model whose error no series shows")
    yield FactorRung(4, False, "", BY_PEOPLE)


def _input_pedigree(subject: Labelled, found: Exhibits) -> Iterator[FactorRung]:
    provenance, budgets = found.provenance.content, found.budgets.content
    sources = provenance.sources if provenance else budgets.sources if budgets else ()
    yield FactorRung(1, bool(sources), f"{len(sources)} sources are named", _name_sources(subject))
    inputs = budgets.inputs if budgets else ()
    stated = sum(each.stated for each in inputs)
    says = f"{len(inputs)} inputs have a width, {stated} of them as the source states it"
    yield FactorRung(2, bool(inputs), says, _validate(subject))
    yield FactorRung(3, bool(inputs) and stated == len(inputs), says, "inputs whose widths the source states")
    yield FactorRung(4, False, "", BY_PEOPLE)


def _uncertainty(subject: Labelled, found: Exhibits) -> Iterator[FactorRung]:
    routes, session, budgets = found.reference.content, found.session.content, found.budgets.content
    known = len(_agreements(session.case)) if session else 0
    says = f"U of {known} agreements" if known else "U of every channel of the stored reference"
    numbers = bool(routes or known or budgets)
    yield FactorRung(1, numbers, "u_num of every point" if budgets else says, _by(subject, "run"))
    spread, has_spread = _spread(found)
    yield FactorRung(
        2, bool(numbers and has_spread), f"{says}; {spread}",
        _by(subject, "sensitivity", " --out OUT, beside a fresh session or reference"),
    )  # fmt: skip
    points = f"u_num, u_input and u_D of {budgets.points if budgets else 0} points"
    yield FactorRung(3, budgets is not None, points, _validate(subject))
    samples = budgets.samples if budgets else 0
    yield FactorRung(
        4, samples > 0, f"{points}, beside {samples} samples of all inputs",
        _validate(subject, " --samples 200 --out OUT"),
    )  # fmt: skip


def _robustness(subject: Labelled, found: Exhibits) -> Iterator[FactorRung]:
    session, budgets = found.session.content, found.budgets.content
    controls = _controls(session.case) if session else {}
    noticed = sum(controls.values())
    yield FactorRung(
        1, noticed > 0, f"{noticed} of {len(controls)} planted faults change the results",
        _by(subject, "run", ", with a [[control]] in run.toml"),
    )  # fmt: skip
    spread, has_spread = _spread(found)
    yield FactorRung(2, has_spread, spread, _by(subject, "sensitivity", " --out OUT"))
    inputs = budgets.inputs if budgets else ()
    yield FactorRung(
        3, bool(inputs), f"derivatives of every point by {len(inputs)} inputs",
        _validate(subject),
    )  # fmt: skip
    yield FactorRung(4, False, "", BY_PEOPLE)


def _history(subject: Labelled, found: Exhibits) -> Iterator[FactorRung]:
    routes, session, budgets = found.reference.content, found.session.content, found.budgets.content
    as_said = budgets is not None and all(series.ok for series in budgets.series)
    says = "a reference is stored" if routes else "all series come out as their file says"
    yield FactorRung(1, routes is not None or as_said, says, _by(subject, "regenerate"))
    verdicts = _against_reference(session.case) if session else []
    good = sum(verdict.status == "agree" for verdict in verdicts)
    yield FactorRung(
        2, routes is not None and bool(verdicts) and good == len(verdicts),
        f"{good} of {len(verdicts)} channels agree with the stored reference", _by(subject, "run"),
    )  # fmt: skip
    yield FactorRung(3, False, "", f"{BY_PEOPLE}; a budget is made when the measurements are known already")
    yield FactorRung(4, False, "", BY_PEOPLE)


def _management(subject: Labelled, found: Exhibits) -> Iterator[FactorRung]:
    session = found.session.content
    stamps = [each.piece.file for each in (found.reference, found.spreads, found.budgets) if each.content is not None]
    yield FactorRung(
        1, bool(stamps or session), f"{', '.join(stamps)} of this very scene" if stamps else "a sealed session",
        _by(subject, "run"),
    )  # fmt: skip
    says = "a sealed session with the digests of all files and of the code"
    yield FactorRung(2, session is not None, says, _by(subject, "run"))
    strict = session is not None and session.strict and session.green
    yield FactorRung(3, strict, f"{says}, green by the strict rules", _by(subject, "run", " --strict, green"))
    yield FactorRung(4, False, "", BY_PEOPLE)


Rules = Callable[[Labelled, Exhibits], Iterator[FactorRung]]
Pieces = Callable[[Exhibits], Iterator[Piece]]


def _of(*names: str) -> Pieces:
    return lambda found: (getattr(found, name).piece for name in names)


RULES: dict[Factor, tuple[Rules, Pieces]] = {
    "data_pedigree": (_data_pedigree, _of("provenance", "budgets")),
    "verification": (_verification, _of("reference", "session", "budgets")),
    "validation": (_validation, _of("provenance", "reference", "budgets")),
    "input_pedigree": (_input_pedigree, _of("provenance", "budgets")),
    "uncertainty": (_uncertainty, _of("reference", "session", "spreads", "budgets")),
    "robustness": (_robustness, _of("session", "spreads", "budgets")),
    "history": (_history, _of("reference", "session", "budgets")),
    "management": (_management, _of("reference", "session", "spreads", "budgets")),
}


def _by(subject: Labelled, command: str, more: str = "") -> str:
    """The command on a case, which is known by its name or by its folder; a measured set has no case yet."""
    if subject.run is None:
        return f"a run.toml beside {MEASURED}, then crosscheck {command}{more}"
    return f"crosscheck {command} {subject.name if subject.name in _shipped() else 'FOLDER'}{more}"


@cache
def _shipped() -> tuple[str, ...]:
    return shipped_names()


def _validate(subject: Labelled, more: str = " --out OUT") -> str:
    """The command that makes a budget; a case has no readings yet unless they lie beside it."""
    if subject.measured:
        return f"crosscheck validate {subject.name if subject.run is None else 'FOLDER'}{more}"
    return f"{MEASURED}, points.csv and model.py beside run.toml, then crosscheck validate FOLDER{more}"


def _name_sources(subject: Labelled) -> str:
    return _validate(subject) if subject.run is None else f"name sources in {PROVENANCE}"


def _agreements(case: SealedCase) -> dict[str, SealedVerdict]:
    """The comparisons that expect agreement and have it, by channel and sides."""
    return {
        f"{comparison} | {key}": verdict
        for comparison, verdicts in case.verdicts.items()
        for key, verdict in verdicts.items()
        if verdict.kind == "comparison" and verdict.expected == verdict.status == "agree" and verdict.ok
    }


def _failed_agreements(session: SessionEvidence | None) -> bool:
    every = [verdict for table in session.case.verdicts.values() for verdict in table.values()] if session else []
    return any(
        verdict.kind == "comparison" and verdict.expected == "agree" and not verdict.ok
        for verdict in every
    )  # fmt: skip


def _engines(key: str) -> tuple[str, ...]:
    """The engines of both sides of a verdict."""
    return tuple(side.partition(" (")[0] for side in key.rsplit(" | ", 2)[1:])


def _independent(key: str, routes: Basis | None) -> bool:
    """Whether the sides are by codes that share nothing; a reference counts where more than one code made it."""
    engines = _engines(key)
    if REFERENCE in engines:
        return routes is not None and not routes.alone
    return len({engine.partition("-")[0] for engine in engines}) > 1


def _against_reference(case: SealedCase) -> list[SealedVerdict]:
    return [
        verdict
        for table in case.verdicts.values()
        for key, verdict in table.items()
        if verdict.kind == "comparison" and REFERENCE in _engines(key)
    ]


def _controls(case: SealedCase) -> dict[str, bool]:
    """Whether each planted fault was noticed, in every channel that it names."""
    return {
        comparison: all(verdict.status == "differ" for verdict in table.values())
        for comparison, table in case.verdicts.items()
        if all(verdict.kind == "control" for verdict in table.values())
    }


def _open_ends(case: SealedCase) -> list[str]:
    """What of a case is open: verdicts not as expected or worse than before, runs that failed, what nothing judges."""
    verdicts = [verdict for table in case.verdicts.values() for verdict in table.values()]
    counts = {
        "verdicts are not as expected": sum(not verdict.ok for verdict in verdicts),
        "figures are worse than recorded": sum(bool(verdict.worse) for verdict in verdicts),
        "accepted figures are stale": sum(bool(verdict.stale) for verdict in verdicts),
        "runs did not end": sum(run.status in (*FAULTS, "did not run") for run in case.runs.values()),
        "channels are judged by nothing": sum(UNSAID in reason for reason in case.unjudged.values()),
    }
    open_ends = [f"{count} {what}" for what, count in counts.items() if count]
    return [*open_ends, "the reference was never made"] if case.unreferenced else open_ends


def _spread(found: Exhibits) -> tuple[str, bool]:
    """The largest spread by the printed digits of all inputs, in words, and whether it is known."""
    spreads = found.spreads.content
    if spreads is None or any(each.failed for each in spreads.variants.values()):
        return "runs with moved inputs failed" if spreads else "", False
    sizes = [spread.digits for each in spreads.variants.values() for spread in each.channels.values()]
    known = [size for size in sizes if size is not None]
    if not known or len(known) < len(sizes):
        return "a spread is no number", False
    moved = max(each.moved for each in spreads.variants.values())
    return f"{moved} inputs moved by their printed digits spread results by at most {max(known):.1e}", True
