"""The outcome for continuous integration: verdicts.json for programs, summary.md for a job page, junit.xml."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import msgspec

from crosscheck.engines.registry import BUILT_IN
from crosscheck.judging.figures import recordable
from crosscheck.judging.outcome import NO_REFERENCE, SessionOutcome
from crosscheck.judging.verdict import STATUSES, Verdict
from flexmb.output.printable import printable
from flexmb.output.whole import whole_file, write_whole

VERDICTS = "verdicts.json"
SHOWN = 40
# Characters with a meaning in Markdown: in a line (an underscore only at a word's edge), and list signs at its start.
MARKDOWN = re.compile(r"[\\`*\[\]<>|~&$!]|(?<![^\W_])_|_(?![^\W_])|^[#+-]|(?<=^\d)[.)]")


def write_verdicts(outcome: SessionOutcome, file: Path) -> None:
    """verdicts.json: a list with one record for each verdict."""
    records = [{**msgspec.to_builtins(verdict), "ok": verdict.ok} for verdict in outcome.all]
    write_whole(file, msgspec.json.format(msgspec.json.encode(records), indent=1) + b"\n")


def write_summary(outcome: SessionOutcome, file: Path) -> None:
    """summary.md: headline, counts by case, what is not as expected, what did not run, what is not applicable."""
    lines = [f"# {'✅' if outcome.ok else '❌'} {_flat(outcome.headline)}", ""]
    lines += [f"| case | verdicts | as expected | {' | '.join(STATUSES)} |"]
    lines += ["|---" * (3 + len(STATUSES)) + "|"]
    for case, verdicts in outcome.verdicts.items():
        counts = [sum(verdict.ok for verdict in verdicts)]
        counts += [sum(verdict.status == status for verdict in verdicts) for status in STATUSES]
        lines.append(f"| {_flat(case)} | {len(verdicts)} | {' | '.join(map(str, counts))} |")
    if outcome.unexpected:
        lines += ["", "## Not as expected", "", "| case | comparison | channel | pair | status | expected | reason |"]
        lines += ["|---|---|---|---|---|---|---|"]
        lines += [_row(verdict) for verdict in outcome.unexpected[:SHOWN]]
        if len(outcome.unexpected) > SHOWN:
            lines += ["", f"... and {len(outcome.unexpected) - SHOWN} more, in verdicts.json."]
    lines += _table("Worse than recorded", outcome.worse, lambda verdict: verdict.worse)
    lines += _table("Beyond stale figures", outcome.outgrown, lambda verdict: verdict.grown)
    if outcome.strict:
        lines += _table("No accepted figures", outcome.unrecorded, lambda verdict: "`crosscheck run --accept` records")
    if outcome.absences:
        lines += ["", "## What did not run to the end, and why", ""]
        for each in outcome.absences:
            what = _flat(f"{each.case}, {each.variant}, {each.engine}{_role(each.role)}: {each.reason}")
            lines.append(f"- **{each.status}** {what}")
    if outcome.inapplicable:
        lines += ["", "## Not applicable", ""]
        for apart in outcome.inapplicable:
            lines.append(f"- {_flat(f'{apart.case}, {apart.where}, {apart.engine}: {apart.reason}')}")
    if outcome.unreferenced:
        lines += ["", "## No stored reference", ""]
        lines += [f"- {_flat(f'{case} {NO_REFERENCE.format(case)}')}" for case in outcome.unreferenced]
    if outcome.broken:
        lines += ["", "## Lines that are no records", "", *(f"- {_flat(line)}" for line in outcome.broken)]
    write_whole(file, "\n".join(lines) + "\n")


def write_junit(outcome: SessionOutcome, file: Path) -> None:
    """junit.xml: one suite for each case, one test for each verdict, and one failing test for each run that is lost.

    Verdicts that need a lost run are skipped, because the failing test of that run stands for them.

    A verdict that is worse than recorded says so in its output, and fails if the session is strict. What is not
    applicable is skipped, and so is a reference that was never made, unless the session is strict. An engine that was
    compared in nothing fails a test of its own.
    """
    suites = ElementTree.Element("testsuites", name="crosscheck")
    for case, verdicts in outcome.verdicts.items():
        suite = ElementTree.SubElement(suites, "testsuite", name=case)
        missing = [each for each in outcome.lost if each.case == case]
        gone = {(each.variant, each.engine) for each in missing}
        tests = [_test(suite, each, _complaint(outcome, each), bool(gone & set(each.sides))) for each in verdicts]
        for each in missing:
            name = f"{each.variant} by {each.engine}{_role(each.role)} ran"
            _failed(suite, case, name, each.status, each.reason)
        tests += ["failure"] * len(missing) + _not_judged(suite, case, outcome)
        suite.set("tests", str(len(tests)))
        suite.set("failures", str(tests.count("failure")))
        suite.set("skipped", str(tests.count("skipped")))
    if outcome.broken:
        suite = _failing(suites, "records", len(outcome.broken))
        for line in outcome.broken:
            _failed(suite, "records", "the line is a record", "broken", line)
    for engine in outcome.uncompared if outcome.all else ():
        text = "it was asked for and compared in nothing"
        _failed(_failing(suites, engine), engine, "it was compared in something", "nothing", text)
    if not outcome.all:
        unfinished, nothing = ("unfinished", "the session came to its end"), ("nothing", "something was compared")
        kind, name = unfinished if outcome.unfinished else nothing
        _failed(_failing(suites, "crosscheck"), "crosscheck", name, kind, outcome.headline)
    for element in suites.iter():  # XML cannot contain most control characters: they are spelled out
        element.attrib.update({key: printable(value) for key, value in element.attrib.items()})
    with whole_file(file) as beside:
        ElementTree.ElementTree(suites).write(beside, encoding="utf-8", xml_declaration=True)


def _failing(suites: ElementTree.Element, name: str, count: int = 1) -> ElementTree.Element:
    """A suite whose tests all fail."""
    return ElementTree.SubElement(suites, "testsuite", name=name, tests=str(count), failures=str(count))


def _failed(suite: ElementTree.Element, classname: str, name: str, kind: str, message: str) -> None:
    test = ElementTree.SubElement(suite, "testcase", classname=classname, name=name)
    ElementTree.SubElement(test, "failure", type=kind, message=message)


def _not_judged(suite: ElementTree.Element, case: str, outcome: SessionOutcome) -> list[str]:
    """Add tests for what is not applicable in a case, and for a missing reference; returns their outcomes."""
    found = []
    for each in outcome.inapplicable:
        if each.case == case:
            test = ElementTree.SubElement(suite, "testcase", classname=case, name=f"{each.where} by {each.engine}")
            ElementTree.SubElement(test, "skipped", message=f"not applicable: {each.reason}")
            found.append("skipped")
    if case in outcome.unreferenced:
        test = ElementTree.SubElement(suite, "testcase", classname=case, name="it has a stored reference")
        kind = "failure" if outcome.strict else "skipped"
        ElementTree.SubElement(test, kind, message=f"{case} {NO_REFERENCE.format(case)}")
        found.append(kind)
    return found


def _complaint(outcome: SessionOutcome, verdict: Verdict) -> str:
    """Why a strict session rejects a verdict that is as expected."""
    if not outcome.strict or not verdict.ok:
        return ""
    if verdict.worse:
        return verdict.grown
    return "no accepted figures" if verdict.accepted is None and recordable(verdict, BUILT_IN) else ""


def _test(suite: ElementTree.Element, verdict: Verdict, complaint: str, lost: bool) -> str:
    """Add one test case; returns its outcome. `lost`: a run that it needs has a failed test already."""
    name = f"{verdict.comparison}: {verdict.channel}, {verdict.pair}"
    test = ElementTree.SubElement(suite, "testcase", classname=f"{verdict.case}.{verdict.kind}", name=name)
    if verdict.ok and verdict.worse:
        ElementTree.SubElement(test, "system-out").text = verdict.grown
    if complaint:
        ElementTree.SubElement(test, "failure", type="figures", message=complaint)
        return "failure"
    if verdict.ok:
        return "passed"
    text = f"{verdict.status}, expected {verdict.expected}: {verdict.reason}"
    if lost and verdict.status == "did not run":
        ElementTree.SubElement(test, "skipped", message=text)
        return "skipped"
    ElementTree.SubElement(test, "failure", type=verdict.status, message=text)
    return "failure"


def _table(title: str, verdicts: list[Verdict], say: Callable[[Verdict], str]) -> list[str]:
    """A section with a row for each verdict, up to `SHOWN`; empty if there are none."""
    if not verdicts:
        return []
    lines = ["", f"## {title}", "", "| case | comparison | channel | pair | what |", "|---|---|---|---|---|"]
    for verdict in verdicts[:SHOWN]:
        lines.append(f"| {' | '.join(_where(verdict))} | {_flat(say(verdict))} |")
    if len(verdicts) > SHOWN:
        lines += ["", f"... and {len(verdicts) - SHOWN} more, in verdicts.json."]
    return lines


def _row(verdict: Verdict) -> str:
    cells = *_where(verdict), f"**{verdict.status}**", verdict.expected, _flat(verdict.reason)
    return f"| {' | '.join(cells)} |"


def _where(verdict: Verdict) -> tuple[str, str, str, str]:
    return _flat(verdict.case), _flat(verdict.comparison), _code(verdict.channel), _flat(verdict.pair)


def _role(role: str) -> str:
    return "" if role == "main" else f" ({role})"


def _flat(text: str) -> str:
    """Text on one line, escaped for Markdown."""
    return MARKDOWN.sub(r"\\\g<0>", printable(" ".join(text.split())))


def _code(text: str) -> str:
    """Text as code on one line, between more backticks than it contains; bars are escaped for tables."""
    flat = printable(" ".join(text.split()))
    fence = "`" * (1 + max(map(len, re.findall("`+", flat)), default=0))
    space = " " if flat.startswith("`") or flat.endswith("`") else ""
    return f"{fence}{space}{flat}{space}{fence}".replace("|", "\\|")
