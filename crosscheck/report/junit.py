"""junit.xml, in the dialect that all readers of JUnit files take.

Schemas differ: that of Jenkins' xunit plug-in (junit-10.xsd) demands `errors` of a suite, and knows no properties of a
test. So machine and versions are properties of suites, and the figures of a verdict are lines `[[PROPERTY|E=1e-09]]` of
its output, which is what readers of such files have agreed on for tests.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from crosscheck.engines.registry import BUILT_IN
from crosscheck.judging.figures import recordable
from crosscheck.judging.outcome import NO_REFERENCE, SessionOutcome
from crosscheck.judging.results import CaseResults, Key, Result, Session
from crosscheck.judging.unjudged import grouped
from crosscheck.judging.verdict import Verdict
from crosscheck.report.ci import role_words
from flexmb.output.files import whole_file
from flexmb.output.printable import printable

NO_SESSION = Session((), ())


def write_junit(outcome: SessionOutcome, file: Path, session: Session = NO_SESSION) -> None:
    """junit.xml: one suite for each case, one test for each verdict, and one failing test for each run that is lost.

    Verdicts that need a lost run are skipped, because the failing test of that run stands for them.

    A verdict that is worse than recorded says so in its output, and fails if the session is strict. What is not
    applicable is skipped, and so are a reference that was never made and what an engine that joined offers and nothing
    judges, unless the session is strict. An engine that was
    compared in nothing fails a test of its own, and so does a claim of the user that names nothing.

    `session` gives machine, versions and times. The time of a test is an equal share of that of the runs it needs, so
    that the times of all tests add up to that of all runs which are judged.
    """
    suites = ElementTree.Element("testsuites", name="crosscheck")
    known = {case.case.case: case for case in session.cases}
    for case, verdicts in outcome.verdicts.items():
        suite = ElementTree.SubElement(suites, "testsuite", name=case)
        _properties(suite, session, known.get(case))
        times = _times(known.get(case), verdicts)
        missing = [loss for loss in outcome.lost if loss.case == case]
        gone = {(loss.variant, loss.engine) for loss in missing}
        tests = [
            _test(suite, verdict, _complaint(outcome, verdict), bool(gone & set(verdict.sides)), seconds)
            for verdict, seconds in zip(verdicts, times, strict=True)
        ]
        for loss in missing:
            name = f"{loss.variant} by {loss.engine}{role_words(loss.role)} ran"
            _failed(suite, case, name, loss.status, loss.reason)
        lost = [control for control in outcome.lost_controls if control.case == case]
        for control in lost:
            _failed(suite, case, f"{control.control} is noticed", "nothing", str(control))
        tests += ["failure"] * (len(missing) + len(lost)) + _not_judged(suite, case, outcome)
        suite.set("tests", str(len(tests)))
        suite.set("failures", str(tests.count("failure")))
        suite.set("errors", "0")
        suite.set("skipped", str(tests.count("skipped")))
        suite.set("time", f"{sum(times):.3f}")
    if outcome.broken:
        suite = _failing(suites, "records", len(outcome.broken))
        for line in outcome.broken:
            _failed(suite, "records", "the line is a record", "broken", line)
    for engine in outcome.uncompared if outcome.all else ():
        text = "it was asked for and compared in nothing"
        _failed(_failing(suites, engine), engine, "it was compared in something", "nothing", text)
    if outcome.idle_claims:
        suite = _failing(suites, "expectations", len(outcome.idle_claims))
        for text in outcome.idle_claims:
            _failed(suite, "expectations", "it names something", "nothing", text)
    if not outcome.all:
        unfinished, nothing = ("unfinished", "the session came to its end"), ("nothing", "something was compared")
        kind, name = unfinished if outcome.unfinished else nothing
        _failed(_failing(suites, "crosscheck"), "crosscheck", name, kind, outcome.headline)
    for key in ("tests", "failures", "errors"):
        suites.set(key, str(sum(int(suite.get(key, "0")) for suite in suites)))
    for element in suites.iter():  # XML cannot contain most control characters: they are spelled out
        element.attrib.update({key: printable(value) for key, value in element.attrib.items()})
    with whole_file(file) as beside:
        ElementTree.ElementTree(suites).write(beside, encoding="utf-8", xml_declaration=True)


def _failing(suites: ElementTree.Element, name: str, count: int = 1) -> ElementTree.Element:
    """A suite whose tests all fail."""
    return ElementTree.SubElement(suites, "testsuite", name=name, tests=str(count), failures=str(count), errors="0")


def _failed(suite: ElementTree.Element, classname: str, name: str, kind: str, message: str) -> None:
    test = ElementTree.SubElement(suite, "testcase", classname=classname, name=name)
    ElementTree.SubElement(test, "failure", type=kind, message=message)


def _not_judged(suite: ElementTree.Element, case: str, outcome: SessionOutcome) -> list[str]:
    """Add tests for what is not applicable in a case, and for a missing reference; returns their outcomes."""
    outcomes = []
    for absence in outcome.inapplicable:
        if absence.case == case:
            test = ElementTree.SubElement(
                suite, "testcase", classname=case, name=f"{absence.where} by {absence.engine}"
            )
            ElementTree.SubElement(test, "skipped", message=f"not applicable: {absence.reason}")
            outcomes.append("skipped")
    for group in grouped(channel for channel in outcome.unaccounted if channel.case == case):
        name = f"what {group.engine} offers on {group.variant} is judged: {', '.join(group.channels)}"
        test = ElementTree.SubElement(suite, "testcase", classname=case, name=name)
        kind = "failure" if outcome.strict else "skipped"
        ElementTree.SubElement(test, kind, message=f"judged by nothing: {group.reason}")
        outcomes.append(kind)
    if case in outcome.unreferenced:
        test = ElementTree.SubElement(suite, "testcase", classname=case, name="it has a stored reference")
        kind = "failure" if outcome.strict else "skipped"
        ElementTree.SubElement(test, kind, message=f"{case} {NO_REFERENCE.format(case)}")
        outcomes.append(kind)
    return outcomes


def _complaint(outcome: SessionOutcome, verdict: Verdict) -> str:
    """Why a strict session rejects a verdict that is as expected."""
    if not outcome.strict or not verdict.ok:
        return ""
    if verdict.worse:
        return verdict.grown
    return "no accepted figures" if verdict.accepted is None and recordable(verdict, BUILT_IN) else ""


def _test(suite: ElementTree.Element, verdict: Verdict, complaint: str, lost: bool, seconds: float) -> str:
    """Add one test case; returns its outcome. `lost`: a run that it needs has a failed test already."""
    name = f"{verdict.comparison}: {verdict.channel}, {verdict.pair}"
    place = f"{verdict.case}.{verdict.kind}"
    test = ElementTree.SubElement(suite, "testcase", classname=place, name=name, time=f"{seconds:.3f}")
    outcome = _ending(test, verdict, complaint, lost)
    ElementTree.SubElement(test, "system-out").text = printable("\n".join(_output(verdict)))
    return outcome


def _ending(test: ElementTree.Element, verdict: Verdict, complaint: str, lost: bool) -> str:
    """Add how the test ended, unless it passed; returns its outcome."""
    if complaint:
        ElementTree.SubElement(test, "failure", type="figures", message=complaint)
        return "failure"
    if verdict.ok:
        return "passed"
    advice = f"; {verdict.advice}" if verdict.advice else ""
    text = f"{verdict.status}, expected {verdict.expected}: {verdict.reason}{advice}"
    if lost and verdict.status == "did not run":
        ElementTree.SubElement(test, "skipped", message=text)
        return "skipped"
    ElementTree.SubElement(test, "failure", type=verdict.status, message=text)
    return "failure"


def _output(verdict: Verdict) -> Iterator[str]:
    """The lines of a test's output: its figures, whose goal it was judged by, what became worse."""
    if verdict.ok and verdict.worse:
        yield verdict.grown
    figures = {"E": verdict.E, "U": verdict.U, "goal": verdict.goal, "case_goal": verdict.case_goal}
    words = {"status": verdict.status, "expected": verdict.expected, "goal_reason": verdict.goal_reason}
    words |= {"expected_reason": verdict.expected_reason, "own_failure": verdict.own_failure}
    for name, number in figures.items():
        if number is not None:
            yield f"[[PROPERTY|{name}={number:.6g}]]"
    for name, text in words.items():
        if text:
            yield f"[[PROPERTY|{name}={' '.join(text.split())}]]"


def _properties(suite: ElementTree.Element, session: Session, case: CaseResults | None) -> None:
    """The machine and the versions of a case's session, as properties of its suite."""
    found: dict[str, str] = {}
    if session.environments:
        made = session.environments[-1]
        found = {"started": made.started, "machine": made.processor, "system": made.system, "python": made.python}
        found |= {f"version of {name}": version for name, version in made.packages.items()}
    for result in () if case is None else case.results.values():
        if result.runs and result.finest.version:
            found[f"engine {result.engine}"] = result.finest.version
    properties = ElementTree.SubElement(suite, "properties") if found else suite
    for name, value in found.items():
        ElementTree.SubElement(properties, "property", name=name, value=value)


def _times(case: CaseResults | None, verdicts: list[Verdict]) -> list[float]:
    """Seconds of each verdict: its equal share of compiling and solving of the runs that it needs."""
    if case is None:
        return [0.0] * len(verdicts)
    needed = [[key for key in _runs_of(verdict) if key in case.results] for verdict in verdicts]
    users = Counter(key for keys in needed for key in keys)
    return [sum(_seconds(case.results[key]) / users[key] for key in keys) for keys in needed]


def _runs_of(verdict: Verdict) -> list[Key]:
    """The results that a verdict needs; of a control the first side is the faulty run."""
    first = f"control:{verdict.comparison}" if verdict.kind == "control" else "main"
    return list(dict.fromkeys([(*verdict.sides[0], first), (*verdict.sides[1], "main")]))


def _seconds(result: Result) -> float:
    """Compiling once, and the solves of all efforts."""
    return max((run.compile_s for run in result.runs), default=0.0) + sum(run.wall_s for run in result.runs)
