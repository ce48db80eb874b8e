"""The outcome for people in a hurry and for machines: summary.md for a job summary, junit.xml for CI."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

from crosscheck.accepted import recordable
from crosscheck.engines.registry import BUILT_IN
from crosscheck.report.outcome import Outcome
from crosscheck.verdict import STATUSES, Verdict

SHOWN = 40


def write_summary(outcome: Outcome, file: Path) -> None:
    """summary.md: headline, counts by case, what is not as expected, what did not run."""
    lines = [f"# {'✅' if outcome.ok else '❌'} {outcome.headline}", ""]
    lines += [f"| case | verdicts | as expected | {' | '.join(STATUSES)} |"]
    lines += ["|---" * (3 + len(STATUSES)) + "|"]
    for case, verdicts in outcome.verdicts.items():
        counts = [sum(verdict.ok for verdict in verdicts)]
        counts += [sum(verdict.status == status for verdict in verdicts) for status in STATUSES]
        lines.append(f"| {case} | {len(verdicts)} | {' | '.join(map(str, counts))} |")
    if outcome.unexpected:
        lines += ["", "## Not as expected", "", "| case | comparison | channel | pair | status | expected | reason |"]
        lines += ["|---|---|---|---|---|---|---|"]
        lines += [_row(verdict) for verdict in outcome.unexpected[:SHOWN]]
        if len(outcome.unexpected) > SHOWN:
            lines += ["", f"... and {len(outcome.unexpected) - SHOWN} more, in verdicts.json."]
    lines += _table("Worse than recorded", outcome.worse, lambda verdict: verdict.worse)
    if outcome.strict:
        lines += _table("No accepted figures", outcome.unrecorded, lambda verdict: "`crosscheck run --accept` records")
    if outcome.absences:
        lines += ["", "## What did not run to the end, and why", ""]
        for each in outcome.absences:
            what = f"**{each.status}** {each.case}, {each.variant}, {each.engine}"
            lines.append(f"- {what}{_role(each.role)}: {_flat(each.reason)}")
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_junit(outcome: Outcome, file: Path) -> None:
    """junit.xml: a suite a case, a test case a verdict. What did not run is skipped, and an error beside it.

    What is worse than recorded says so in its output, and fails where that is asked for.
    """
    suites = ElementTree.Element("testsuites", name="crosscheck")
    for case, verdicts in outcome.verdicts.items():
        suite = ElementTree.SubElement(suites, "testsuite", name=case)
        tests = [_test(suite, verdict, _complaint(outcome, verdict)) for verdict in verdicts]
        missing = [each for each in outcome.not_run if each.case == case]
        for each in missing:
            name = f"{each.variant} by {each.engine}{_role(each.role)} ran"
            test = ElementTree.SubElement(suite, "testcase", classname=case, name=name)
            ElementTree.SubElement(test, "failure", type="did not run", message=each.reason)
        suite.set("tests", str(len(tests) + len(missing)))
        suite.set("failures", str(tests.count("failure") + len(missing)))
        suite.set("skipped", str(tests.count("skipped")))
    if not outcome.all:
        suite = ElementTree.SubElement(suites, "testsuite", name="crosscheck", tests="1", failures="1")
        test = ElementTree.SubElement(suite, "testcase", classname="crosscheck", name="something was compared")
        ElementTree.SubElement(test, "failure", type="nothing", message=outcome.headline)
    ElementTree.ElementTree(suites).write(file, encoding="utf-8", xml_declaration=True)


def _complaint(outcome: Outcome, verdict: Verdict) -> str:
    """What a strict session has against a verdict that is as expected."""
    if not outcome.strict or not verdict.ok:
        return ""
    if verdict.worse:
        return f"worse than recorded: {verdict.worse}"
    return "no accepted figures" if verdict.accepted is None and recordable(verdict, BUILT_IN) else ""


def _test(suite: ElementTree.Element, verdict: Verdict, complaint: str) -> str:
    """One test case; returns what it counts as."""
    name = f"{verdict.comparison}: {verdict.channel}, {pair(verdict)}"
    test = ElementTree.SubElement(suite, "testcase", classname=f"{verdict.case}.{verdict.kind}", name=name)
    if verdict.ok and verdict.worse:
        ElementTree.SubElement(test, "system-out").text = f"worse than recorded: {verdict.worse}"
    if complaint:
        ElementTree.SubElement(test, "failure", type="figures", message=complaint)
        return "failure"
    if verdict.ok:
        return "passed"
    outcome = "skipped" if verdict.status == "did not run" else "failure"
    text = f"{verdict.status}, expected {verdict.expected}: {verdict.reason}"
    element = ElementTree.SubElement(test, outcome, message=text)
    if outcome == "failure":
        element.set("type", verdict.status)
    return outcome


def pair(verdict: Verdict) -> str:
    """Who is compared with whom."""
    if verdict.variant_a == verdict.variant_b:
        return f"{verdict.engine_a} – {verdict.engine_b}"
    return f"{verdict.engine_a} ({verdict.variant_a}) – {verdict.engine_b} ({verdict.variant_b})"


def _table(title: str, verdicts: list[Verdict], say: Callable[[Verdict], str]) -> list[str]:
    """A section with a row for each verdict, as far as they are shown; nothing if there are none."""
    if not verdicts:
        return []
    lines = ["", f"## {title}", "", "| case | comparison | channel | pair | what |", "|---|---|---|---|---|"]
    for verdict in verdicts[:SHOWN]:
        cells = (verdict.case, verdict.comparison, f"`{verdict.channel}`", pair(verdict), say(verdict))
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    if len(verdicts) > SHOWN:
        lines += ["", f"... and {len(verdicts) - SHOWN} more, in verdicts.json."]
    return lines


def _row(verdict: Verdict) -> str:
    cells = (
        verdict.case,
        verdict.comparison,
        f"`{verdict.channel}`",
        pair(verdict),
        f"**{verdict.status}**",
        verdict.expected,
        _flat(verdict.reason),
    )
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _role(role: str) -> str:
    return "" if role == "main" else f" ({role})"


def _flat(text: str) -> str:
    return " ".join(text.split())
