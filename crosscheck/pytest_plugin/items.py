"""Test items: a channel of a case on an engine, or a clause of the contract."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from crosscheck.conformance.catalogue import CLAUSES
from crosscheck.judging.verdict import Verdict, VerdictKind
from crosscheck.library.case import CaseError
from crosscheck.library.channels import CONSERVED, most_specific
from crosscheck.library.find import Case
from crosscheck.library.reference import has_reference, load_reference
from crosscheck.library.selection import alone, goals_for_reference
from crosscheck.pytest_plugin.request import Request, marks_of

PREFIX = "crosscheck"


class NotAsExpected(Exception):
    """A verdict that is not what the case expects; its text is all that pytest shows."""


class EngineIsMissing(Exception):
    """The engine that was asked for is not installed, or gave no result."""


class CrosscheckItems(pytest.Collector):
    """The collector of all items of a request."""

    def __init__(self, request: Request, **others: Any) -> None:
        super().__init__(**others)
        self.request = request

    def collect(self) -> Iterator[pytest.Item]:
        """The contract first, then the cases in the order in which they were asked for."""
        for engine in self.request.engines:
            for clause in CLAUSES if self.request.contract else ():
                name = f"contract[{engine}-{clause}]"
                yield ClauseItem.from_parent(self, name=name, request=self.request, engine=engine, clause=clause)
        for case in self.request.cases:
            for engine in self.request.engines:
                yield from self._of(case, engine)

    def _of(self, case: Case, engine: str) -> Iterator[pytest.Item]:
        """A case on an engine: the channels of its reference for which there is a goal, and what is conserved."""
        common: dict[str, Any] = {"request": self.request, "case": case, "engine": engine}
        stand_in = common | {"name": f"{case.name}[{engine}-reference]"}
        if not has_reference(case.folder):
            yield CannotBeHeld.from_parent(self, **stand_in, why="the case has no stored reference", fails=True)
            return
        try:
            reference = load_reference(case.folder)
        except CaseError as error:
            yield CannotBeHeld.from_parent(self, **stand_in, why=str(error), fails=True)
            return
        goals, _ = goals_for_reference(case.run, (engine,)).get(engine, ({}, {}))
        if not goals:
            why = f"the case does not hold {engine} against its reference: {reason_of(case, engine)}"
            yield CannotBeHeld.from_parent(self, **stand_in, why=why, fails=False)
            return
        common |= {"reference": reference.knowledge.values}
        for channel in reference.channels:
            pattern = most_specific(goals, channel)
            if pattern is not None:
                name = f"{case.name}[{engine}-{channel}]"
                yield ChannelItem.from_parent(self, **common, name=name, kind="comparison", wanted=(channel, pattern))
        for item in alone(case.run, (engine,)).conservations:
            channel = CONSERVED[item.quantity]
            name = f"{case.name}[{engine}-{channel} conserved]"
            yield ChannelItem.from_parent(self, **common, name=name, kind="conservation", wanted=(channel,))


def reason_of(case: Case, engine: str) -> str:
    """Why a case expects of an engine something else than agreement; or that no comparison names it."""
    reasons = [
        item.reason
        for item in case.run.comparisons
        if item.reason and any(side is not None and side.engine == engine for side in (item.a, item.b))
    ]
    return reasons[0] if reasons else "none of its comparisons on the reference's variant expects it to agree"


class _EngineItem(pytest.Item):
    """Base of all items: an engine, marks, and properties, which junit.xml contains too."""

    def __init__(self, request: Request, engine: str, **others: Any) -> None:
        super().__init__(**others)
        self.request = request
        self.engine = engine
        self.add_marker(pytest.mark.crosscheck)
        self.tell("engine", engine)

    def tell(self, name: str, value: Any) -> None:
        self.user_properties.append((name, value))

    def missing(self, reason: str) -> None:
        """The engine is missing: an error, or a skip if that is allowed."""
        if self.request.allow_missing:
            pytest.skip(reason)
        raise EngineIsMissing(reason)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Our own exceptions as text only: frames of this package would not help."""
        if isinstance(excinfo.value, NotAsExpected | EngineIsMissing):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)


class _CaseItem(_EngineItem):
    def __init__(self, case: Case, engine: str, **others: Any) -> None:
        super().__init__(engine=engine, **others)
        self.case = case
        self.tell("case", case.name)
        for tag in marks_of(case):
            self.add_marker(getattr(pytest.mark, tag))
        # With `--dist loadgroup` one process runs all items of a group; otherwise a lock makes the others wait.
        self.add_marker(pytest.mark.xdist_group(f"crosscheck {case.name} {engine}"))

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Where the item comes from."""
        return self.case.folder / "run.toml", None, self.nodeid


class ChannelItem(_CaseItem):
    """One channel of a case on an engine, compared with the stored reference; or a conserved quantity.

    `wanted` are the channel and, for an unfinished run, which has no channels, the pattern that stands for it.
    """

    def __init__(self, kind: VerdictKind, wanted: tuple[str, ...], reference: str, **others: Any) -> None:
        super().__init__(**others)
        self.kind = kind
        self.wanted = wanted
        self.tell("channel", wanted[0])
        self.tell("reference", reference)

    def setup(self) -> None:
        """Run the engine, if it has not run yet; a missing engine is an error, not a failure."""
        outcome = self.request.runs.outcome(self.case, self.engine)
        absent = next((absence for absence in outcome.absences if absence.status == "did not run"), None)
        if absent is not None:
            self.missing(f"{self.engine} did not run: {absent.reason}")

    def runtest(self) -> None:
        """Judge the channel."""
        verdict = self._verdict()
        if verdict is None:
            self._without_verdict()
            return
        numbers = {"E": verdict.E, "U": verdict.U, "goal": verdict.goal}
        if verdict.case_goal is not None:
            numbers["case_goal"] = verdict.case_goal
            self.tell("goal_reason", verdict.goal_reason)
        for name, value in {"status": verdict.status, "expected": verdict.expected, **numbers}.items():
            self.tell(name, value if value is None or isinstance(value, str) else f"{value:.6g}")
        if not verdict.ok:
            refused = verdict.status == "refused"
            if refused and not self.request.strict and not verdict.own_failure:
                pytest.skip(f"{self.engine} refuses: {verdict.reason}")
            raise NotAsExpected(told(verdict))
        if verdict.worse and self.request.strict:
            raise NotAsExpected(f"{told(verdict)}\n{verdict.grown}")
        if verdict.status != "agree":
            who = f"you expect ({verdict.own_failure})" if verdict.own_failure else "the case expects"
            pytest.xfail(f"{verdict.status}, as {who}: {verdict.expected_reason}")

    def _without_verdict(self) -> None:
        """Skip a channel that is not applicable, with the engine's reason, or an energy that it does not offer."""
        apart = self.request.runs.outcome(self.case, self.engine).inapplicable
        mine = next((verdict for verdict in apart if verdict.channel in ("", *self.wanted)), None)
        reason = "" if mine is None else mine.reason
        if reason and self.request.strict:
            raise NotAsExpected(f"{self.case.name}, {self.engine}, {self.wanted[0]}: not applicable: {reason}")
        if mine is not None and not mine.lies_with_engine:
            pytest.skip(reason)
        pytest.skip(f"{self.engine} refuses: {reason}" if reason else f"{self.engine} does not know {self.wanted[0]}")

    def _verdict(self) -> Verdict | None:
        """The verdict on the channel, or the one that stands for it; None if the engine has no such energy."""
        outcome = self.request.runs.outcome(self.case, self.engine)
        mine = {verdict.channel: verdict for verdict in outcome.all if verdict.kind == self.kind}
        return next((mine[name] for name in self.wanted if name in mine), None)


class CannotBeHeld(_CaseItem):
    """Stands for a case that cannot be judged on an engine, so that it is not left out silently."""

    def __init__(self, why: str, fails: bool, **others: Any) -> None:
        super().__init__(**others)
        self.why = why
        self.fails = fails

    def runtest(self) -> None:
        """Say why."""
        if self.fails:
            raise NotAsExpected(f"{self.case.name}: {self.why}")
        pytest.skip(self.why)


class ClauseItem(_EngineItem):
    def __init__(self, clause: str, **others: Any) -> None:
        super().__init__(**others)
        self.clause = clause
        self.tell("clause", CLAUSES[clause].sentence)
        self.add_marker(pytest.mark.xdist_group(f"crosscheck contract {self.engine}"))

    def setup(self) -> None:
        """Try all clauses, if that was not done yet; a missing engine is an error."""
        outcome = self.request.runs.clause(self.engine, self.clause)
        if outcome.status == "missing":
            self.missing(outcome.message)

    def runtest(self) -> None:
        """Fail unless the clause holds."""
        outcome = self.request.runs.clause(self.engine, self.clause)
        if outcome.status == "not offered":
            pytest.skip(f"{outcome.message}: it is tried if you {outcome.offer}")
        if outcome.status != "holds":
            raise NotAsExpected(f"{outcome.message}\nthe contract says: {outcome.sentence}")

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Where the item comes from."""
        return self.config.rootpath, None, self.nodeid


def told(verdict: Verdict) -> str:
    """The text of a verdict that is not as expected, with E, U and goal."""
    figures = {"E": verdict.E, "U": verdict.U, "goal": verdict.goal}
    numbers = ", ".join(f"{name} {value:.3g}" for name, value in figures.items() if value is not None)
    expected = "" if verdict.status == verdict.expected else f", expected {verdict.expected}"
    own = f"; you expect it to fail: {verdict.own_failure}" if verdict.own_failure else ""
    advice = f"; {verdict.advice}" if verdict.advice else ""
    where = f"{verdict.case}, {verdict.engine_a} on {verdict.variant_a}, {verdict.channel}"
    return f"{where}: {verdict.status}{expected}: {verdict.reason} ({numbers}; relative to the range){own}{advice}"
