"""Records made by hand: what engines might have left behind, judged without running any."""

import io
import tomllib
from collections.abc import Iterable

import msgspec
import numpy as np
from rich.console import Console

from crosscheck.judging.outcome import SessionOutcome, conclude
from crosscheck.judging.results import Session, collect
from crosscheck.judging.verdict import Verdict
from crosscheck.library.accepted import Accepted
from crosscheck.library.case import RunFile
from crosscheck.library.selection import joining, select
from crosscheck.records.kinds import CaseRecord, RunRecord, VariantInfo
from crosscheck.records.packing import pack
from crosscheck.terminal.text import Verbosity
from crosscheck.terminal.verdicts import print_outcome
from flexmb.typing import Real

TIMES = np.linspace(0.0, 1.0, 11)
TIP = "marker:tip.position"
HEAD = 'title = "made"\nduration_s = 1.0\nsamples = 11\n'
ONE_PAIR = """
[[variant]]
name = "rigid"
engines = ["one", "two"]

[[comparison]]
name = "both"
variant = "rigid"
goals = { "marker:tip.position" = 1e-3 }
"""


def run_file(text: str) -> RunFile:
    return msgspec.convert(tomllib.loads(HEAD + text), RunFile)


def way(height: float = 1.0, axis: int = 0) -> Real:
    """A signal (T, 3): up and down again along one axis, so that the last sample is where the first was."""
    values = np.zeros((len(TIMES), 3))
    values[:, axis] = height * np.sin(np.pi * TIMES)
    values[-1] = 0.0
    return values


def ladder(
    engine: str, signals: dict[str, Real], *, spread: float = 1e-6, variant: str = "rigid", role: str = "main"
) -> list[RunRecord]:
    """Three tolerances of an engine that converge to the signals: off by 100, 10 and 1 times `spread` of them."""
    return [
        RunRecord(
            case="made/made",
            variant=variant,
            role=role,
            engine=engine,
            version="1",
            scene="s",
            status="finished",
            effort=f"rtol={rung}",
            effort_kind="tolerance",
            effort_method="m",
            effort_value=10.0 ** -(rung + 6),
            rung=rung,
            rungs=3,
            evaluations=100 * (rung + 1),
            times=pack(TIMES),
            channels={name: pack(values * (1.0 + spread * 10.0 ** (2 - rung))) for name, values in signals.items()},
        )  # fmt: skip
        for rung in range(3)
    ]


PAIR = [*ladder("one", {TIP: way()}), *ladder("two", {TIP: way()})]
"""Two engines that converge to the same."""


def ended(run: RunRecord, status: str, message: str = "for a reason", **changes: object) -> RunRecord:
    """The run as one that ended otherwise."""
    return msgspec.structs.replace(run, status=status, message=message, **changes)


def judged(
    text: str,
    runs: Iterable[RunRecord],
    accepted: Accepted | None = None,
    strict: bool = False,
    asked: tuple[str, ...] = (),
    basis: str = "",
    undetermined: tuple[str, ...] | msgspec.UnsetType = (),
    **others: object,
) -> SessionOutcome:
    """The outcome of a session that left these runs; see `session_of`."""
    return conclude(session_of(text, runs, accepted, asked, basis, undetermined, **others), strict)


def session_of(
    text: str, runs: Iterable[RunRecord], accepted: Accepted | None = None, asked: tuple[str, ...] = (),
    basis: str = "", undetermined: tuple[str, ...] | msgspec.UnsetType = (), **others: object,
) -> Session:
    """A session that left these runs; `others` are more of its case's record, `basis` its scenes', of whose channels
    the motion leaves some `undetermined`."""
    whole = run_file(text)
    run = select(whole, asked)
    info = VariantInfo(level="rigid", drawing=None, basis=basis, undetermined=undetermined)
    infos = {variant.name: info for variant in run.variants}
    case = CaseRecord(
        case="made/made", run=run, provenance=None, readme="", variants=infos, accepted=accepted or {}, asked=asked,
        joined=joining(whole, asked), **others,
    )  # fmt: skip
    return collect([case, *runs])


def single(outcome: SessionOutcome) -> Verdict:
    """The only verdict."""
    (verdict,) = outcome.all
    return verdict


def told(outcome: SessionOutcome, verbosity: Verbosity = Verbosity.NORMAL) -> tuple[int, str]:
    """The exit code, and what the terminal shows."""
    text = io.StringIO()
    return print_outcome(Console(file=text, width=300), outcome, verbosity), text.getvalue()
