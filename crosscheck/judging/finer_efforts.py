"""Advice where U is too large for lack of finer efforts: those that should do, as an option of `crosscheck run`."""

from __future__ import annotations

from collections.abc import Iterable
from math import ceil, inf, log

from crosscheck.judging.results import Result
from crosscheck.judging.verdict import Finding
from crosscheck.library.efforts import continued
from crosscheck.records.kinds import CaseRecord

MOST = 6  # efforts more; if they do not do, the goal is beyond the method
NO_GOAL = 0.1  # a U above this part of the range resolves nothing that could be claimed
FIRST_TRY = 3  # efforts more, where nothing is resolved yet
FIRST_ORDER = 1.0
HALF = 0.5
BEYOND = "more efforts will not do"


def finer_efforts(case: CaseRecord, channel: str, goal: float, finding: Finding, results: Iterable[Result]) -> str:
    """What to add to the command, or to claim, if finished runs agree but for a U above the goal; else "".

    U is expected to fall with the observed order, else with the first; with tolerances as they do. What an engine says
    of its own derivatives does not fall. The advice is for the engine whose U is the largest.
    """
    U = finding.U
    if finding.status != "unresolved" or U is None or not (0.0 < goal < U < inf):
        return ""
    worst = max(results, key=lambda result: result.uncertainty(channel).value)
    last = [run for run in worst.runs if (run.effort_kind, run.effort_method) == _method(worst)]
    values = [run.effort_value for run in last]
    kind = worst.finest.effort_kind
    if kind not in ("tolerance", "step") or len(values) < 2 or not 0.0 < values[-1] < values[-2] < inf:
        return ""
    ratio = values[-2] / values[-1]
    order = worst.uncertainty(channel).order if kind == "step" else FIRST_ORDER
    count = ceil(log(U / goal) / (max(order or FIRST_ORDER, FIRST_ORDER) * log(ratio)))
    unresolved = U > NO_GOAL  # no accuracy to claim: whatever more efforts reach, they come first
    more = continued("step" if kind == "step" else "tolerance", values, min(count, FIRST_TRY if unresolved else MOST))
    inherent = worst.own_account(channel) > HALF * worst.uncertainty(channel).value  # of differences, at any effort
    if inherent or not more or (not unresolved and len(more) < count):
        reached = float(f"{2.0 * U:.1g}")
        return f"{BEYOND}: claim what it reaches, such as --goal {worst.engine}={min(reached, 1.0):g}"
    wanted = ",".join(f"{value:g}" for value in (*case.claims.efforts_of(worst.engine), *more))
    efforts = "a finer effort" if len(more) == 1 else "finer efforts"
    return f"add {efforts}: crosscheck run {case.case} --engine {worst.engine} --efforts {worst.engine}={wanted}"


def _method(result: Result) -> tuple[str, str]:
    return result.finest.effort_kind, result.finest.effort_method
