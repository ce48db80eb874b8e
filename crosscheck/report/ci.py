"""The outcome for continuous integration: verdicts.json for programs, summary.md for a job page."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import msgspec

from crosscheck.judging.margins import WORDS
from crosscheck.judging.outcome import NO_REFERENCE, SessionOutcome
from crosscheck.judging.unjudged import grouped
from crosscheck.judging.verdict import STATUSES, Verdict
from crosscheck.label.document import FILE as LABEL
from crosscheck.label.document import LabelFile, heads, level_rows
from crosscheck.label.factors import FACTORS
from crosscheck.sealed.compare import Differences
from flexmb.output.files import write_whole
from flexmb.output.printable import printable

VERDICTS = "verdicts.json"
WORK = ("work_a", "work_b")  # keys of a verdict's record: what the runs of its sides took
SHOWN = 40
# Characters with a meaning in Markdown: in a line (an underscore only at a word's edge), and list signs at its start.
MARKDOWN = re.compile(r"[\\`*\[\]<>|~&$!]|(?<![^\W_])_|_(?![^\W_])|^[#+-]|(?<=^\d)[.)]")


def write_verdicts(outcome: SessionOutcome, file: Path) -> None:
    """verdicts.json: a list with one record for each verdict."""
    records = [
        {**msgspec.to_builtins(verdict), "ok": verdict.ok}
        | {key: msgspec.to_builtins(work) for key, work in zip(WORK, outcome.work_of(verdict), strict=True)}
        for verdict in outcome.all
    ]
    write_whole(file, msgspec.json.format(msgspec.json.encode(records), indent=1) + b"\n")


def write_summary(outcome: SessionOutcome, file: Path, labels: LabelFile | None = None) -> None:
    """summary.md: headline, counts by case, what is not as expected, did not run, is not applicable or not judged, and
    the levels of the labels."""
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
    if outcome.lost_controls:
        lines += ["", "## Deliberate faults that were compared in nothing", ""]
        lines += [f"- {_flat(str(control))}" for control in outcome.lost_controls]
    if outcome.contracts:
        lines += ["", "## Contracts of outside engines", ""]
        lines += [f"- {_flat(state.words(name))}" for name, state in outcome.contracts.items()]
    lines += _claims(outcome)
    lines += _table("Worse than recorded", outcome.worse, lambda verdict: verdict.worse)
    lines += _table("Beyond stale figures", outcome.outgrown, lambda verdict: verdict.grown)
    if outcome.strict:
        lines += _table("No accepted figures", outcome.unrecorded, lambda verdict: "`crosscheck run --accept` records")
    if outcome.work_changes:
        lines += ["", "## Other work than recorded", "", *(f"- {_flat(str(each))}" for each in outcome.work_changes)]
    if outcome.flagged:
        lines += ["", "## Margins of goals", "", "| case | comparison | goals | which | extreme |"]
        lines += ["|---|---|---|---|---|"]
        for each in outcome.flagged[:SHOWN]:
            cells = (_flat(each.case), _flat(each.comparison), f"{each.channels} of {each.judged}", WORDS[each.flag])
            extreme = f"{_code(each.channel)}: {each.extreme:.2g}, goal {each.goal:.2g}"
            lines.append(f"| {' | '.join(cells)} | {extreme} |")
        if len(outcome.flagged) > SHOWN:
            lines += ["", f"... and {len(outcome.flagged) - SHOWN} more, in results.json."]
    lines += _work(outcome)
    if labels is not None and labels.subjects:
        lines += ["", f"## Credibility by {labels.standard}, levels 0 to 4", "", f"| case | {' | '.join(heads())} |"]
        lines += ["|---" * (1 + len(FACTORS)) + "|"]
        lines += [f"| {' | '.join(map(_flat, row))} |" for row in level_rows(labels.subjects)]
        lines += ["", f"What stands behind each level is in {LABEL}, and on the pages of the cases."]
    if outcome.absences:
        lines += ["", "## What did not run to the end, and why", ""]
        for absence in outcome.absences:
            what = _flat(
                f"{absence.case}, {absence.variant}, {absence.engine}{role_words(absence.role)}: {absence.reason}"
            )
            lines.append(f"- **{absence.status}** {what}")
    if outcome.inapplicable:
        lines += ["", "## Not applicable", ""]
        for apart in outcome.inapplicable:
            lines.append(f"- {_flat(f'{apart.case}, {apart.where}, {apart.engine}: {apart.reason}')}")
    if outcome.unjudged:
        lines += ["", "## Offered, and judged by nothing", ""]
        groups = grouped(outcome.unjudged)
        lines += [f"- {_flat(str(group))}" for group in groups[:SHOWN]]
        if len(groups) > SHOWN:
            lines += [f"- ... and {len(groups) - SHOWN} more, in results.json."]
    if outcome.unreferenced:
        lines += ["", "## No stored reference", ""]
        lines += [f"- {_flat(f'{case} {NO_REFERENCE.format(case)}')}" for case in outcome.unreferenced]
    if outcome.broken:
        lines += ["", "## Lines that are no records", "", *(f"- {_flat(line)}" for line in outcome.broken)]
    write_whole(file, "\n".join(lines) + "\n")


def _work(outcome: SessionOutcome) -> list[str]:
    """What the finest runs took, up to `SHOWN` of them."""
    if not outcome.work:
        return []
    lines = ["", "## Work of the finest runs", "", "| case | variant | engine | effort | work |"]
    lines += ["|---|---|---|---|---|"]
    for (case, variant, engine), work in list(outcome.main_work.items())[:SHOWN]:
        cells = (case, variant, engine, work.effort, work.words(engine))
        lines.append(f"| {' | '.join(map(_flat, cells))} |")
    if len(outcome.main_work) > SHOWN:
        lines += ["", f"... and {len(outcome.main_work) - SHOWN} more, in results.json."]
    return lines


def add_differences(differences: Differences, file: Path) -> None:
    """Add to summary.md what changed since a baseline, which then decides whether the session fails."""
    kept = "❌ Worse than the baseline" if differences.regressed else "✅ Nothing is worse than the baseline"
    lines = ["", f"## {kept}", "", _flat(differences.headline), ""]
    shown = [change for change in differences.changes if change.direction != "new"]
    for row in shown[:SHOWN]:
        where = ", ".join(part for part in (row.case, row.comparison, row.what) if part)
        lines.append(f"- **{row.direction}** {_flat(f'{where}: {row.how}')}")
    if len(shown) > SHOWN:
        lines.append(f"- ... and {len(shown) - SHOWN} more: `crosscheck compare --verbose` shows all")
    lines += [f"- note: {_flat(note)}" for note in differences.notes]
    write_whole(file, file.read_text(encoding="utf-8") + "\n".join(lines) + "\n")


def _claims(outcome: SessionOutcome) -> list[str]:
    """Sections on goals looser than the cases', failures that the user expects, and claims that name nothing."""
    lines = _table(
        "Goals looser than the case's", outcome.loosened,
        lambda verdict: f"goal {verdict.goal:.2g} instead of {verdict.case_goal:.2g}: {verdict.goal_reason}",
    )  # fmt: skip
    lines += _table(
        "Failures that you expect", outcome.own_failures,
        lambda verdict: f"{verdict.status}: {verdict.expected_reason} ({verdict.own_failure})",
    )  # fmt: skip
    if outcome.idle_claims:
        lines += ["", "## Expectations that name nothing", "", *(f"- {_flat(claim)}" for claim in outcome.idle_claims)]
    return lines


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


def role_words(role: str) -> str:
    """The role of a run behind its engine, nothing for the main one."""
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
