"""The outcome for people in a hurry and for machines: summary.md for a job summary, junit.xml for CI."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from crosscheck.report.outcome import Outcome
from crosscheck.verdict import Verdict

SHOWN = 40


def write_summary(outcome: Outcome, file: Path) -> None:
    """summary.md: headline, counts by case, what is not as expected, what did not run."""
    lines = [f"# {'✅' if outcome.ok else '❌'} {outcome.headline}", ""]
    lines += ["| case | verdicts | as expected | agree | differ | unresolved | refused | failed | did not run |"]
    lines += ["|---|---|---|---|---|---|---|---|---|"]
    for case, verdicts in outcome.verdicts.items():
        counts = [sum(verdict.ok for verdict in verdicts)]
        for status in ("agree", "differ", "unresolved", "refused", "failed", "did not run"):
            counts.append(sum(verdict.status == status for verdict in verdicts))
        lines.append(f"| {case} | {len(verdicts)} | {' | '.join(map(str, counts))} |")
    if outcome.unexpected:
        lines += ["", "## Not as expected", "", "| case | comparison | channel | pair | status | expected | reason |"]
        lines += ["|---|---|---|---|---|---|---|"]
        lines += [_row(verdict) for verdict in outcome.unexpected[:SHOWN]]
        if len(outcome.unexpected) > SHOWN:
            lines += ["", f"... and {len(outcome.unexpected) - SHOWN} more, in verdicts.json."]
    if outcome.absences:
        lines += ["", "## What did not run to the end, and why", ""]
        for each in outcome.absences:
            what = f"**{each.status}** {each.case}, {each.variant}, {each.engine}"
            lines.append(f"- {what}{_role(each.role)}: {_flat(each.reason)}")
    if outcome.broken:
        lines += ["", "## Lines that are no records", "", *(f"- {_flat(line)}" for line in outcome.broken)]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_junit(outcome: Outcome, file: Path) -> None:
    """junit.xml: a suite a case, a test case a verdict. What did not run is skipped, and an error beside it."""
    suites = ElementTree.Element("testsuites", name="crosscheck")
    for case, verdicts in outcome.verdicts.items():
        suite = ElementTree.SubElement(suites, "testsuite", name=case)
        tests = [_test(suite, verdict) for verdict in verdicts]
        missing = [each for each in outcome.not_run if each.case == case]
        for each in missing:
            name = f"{each.variant} by {each.engine}{_role(each.role)} ran"
            test = ElementTree.SubElement(suite, "testcase", classname=case, name=name)
            ElementTree.SubElement(test, "failure", type="did not run", message=each.reason)
        suite.set("tests", str(len(tests) + len(missing)))
        suite.set("failures", str(tests.count("failure") + len(missing)))
        suite.set("skipped", str(tests.count("skipped")))
    if outcome.broken:
        count = str(len(outcome.broken))
        suite = ElementTree.SubElement(suites, "testsuite", name="records", tests=count, failures=count)
        for line in outcome.broken:
            test = ElementTree.SubElement(suite, "testcase", classname="records", name="the line is a record")
            ElementTree.SubElement(test, "failure", type="broken", message=line)
    if not outcome.all:
        suite = ElementTree.SubElement(suites, "testsuite", name="crosscheck", tests="1", failures="1")
        test = ElementTree.SubElement(suite, "testcase", classname="crosscheck", name="something was compared")
        ElementTree.SubElement(test, "failure", type="nothing", message=outcome.headline)
    ElementTree.ElementTree(suites).write(file, encoding="utf-8", xml_declaration=True)


def _test(suite: ElementTree.Element, verdict: Verdict) -> str:
    """One test case; returns what it counts as."""
    name = f"{verdict.comparison}: {verdict.channel}, {pair(verdict)}"
    test = ElementTree.SubElement(suite, "testcase", classname=f"{verdict.case}.{verdict.kind}", name=name)
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
