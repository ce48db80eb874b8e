"""The outcome for continuous integration: verdicts.json for programs, summary.md for a job page."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import msgspec

from crosscheck.judging.margins import WORDS
from crosscheck.judging.outcome import NO_REFERENCE, SessionOutcome
from crosscheck.judging.unjudged import grouped
from crosscheck.judging.verdict import STATUSES, Verdict
from crosscheck.label.document import FILE as LABEL
from crosscheck.label.document import LabelFile, heads, level_rows
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
    counts = [
        [case, str(len(verdicts)), str(sum(verdict.ok for verdict in verdicts))]
        + [str(sum(verdict.status == status for verdict in verdicts)) for status in STATUSES]
        for case, verdicts in outcome.verdicts.items()
    ]
    lines = [f"# {'✅' if outcome.ok else '❌'} {_flat(outcome.headline)}"]
    lines += _table(("case", "verdicts", "as expected", *STATUSES), [[_flat(case), *cells] for case, *cells in counts])
    lines += _section("Not as expected", ("status", "expected", "reason"), outcome.unexpected, _unexpected)
    lines += _list("Deliberate faults that were compared in nothing", map(str, outcome.lost_controls))
    lines += _list("Contracts of outside engines", (state.words(name) for name, state in outcome.contracts.items()))
    lines += _claims(outcome)
    lines += _told("Worse than recorded", outcome.worse, lambda verdict: verdict.worse)
    lines += _told("Beyond stale figures", outcome.outgrown, lambda verdict: verdict.grown)
    if outcome.strict:
        lines += _told("No accepted figures", outcome.unrecorded, lambda verdict: "`crosscheck run --accept` records")
    lines += _list("Other work than recorded", map(str, outcome.work_changes))
    margins = [
        (_flat(each.case), _flat(each.comparison), f"{each.channels} of {each.judged}", WORDS[each.flag],
         f"{_code(each.channel)}: {each.extreme:.2g}, goal {each.goal:.2g}")
        for each in outcome.flagged
    ]  # fmt: skip
    lines += _table(("case", "comparison", "goals", "which", "extreme"), margins, "Margins of goals", "results.json")
    if outcome.work:
        work = [
            [_flat(cell) for cell in (case, variant, engine, of_run.effort, of_run.words(engine))]
            for (case, variant, engine), of_run in outcome.main_work.items()
        ]
        heads_of_work = ("case", "variant", "engine", "effort", "work")
        lines += _table(heads_of_work, work, "Work of the finest runs", "results.json")
    if labels is not None and labels.subjects:
        levels = [[_flat(cell) for cell in row] for row in level_rows(labels.subjects)]
        lines += _table(("case", *heads()), levels, f"Credibility by {labels.standard}, levels 0 to 4")
        lines += ["", f"What stands behind each level is in {LABEL}, and on the pages of the cases."]
    if outcome.absences:
        lines += ["", "## What did not run to the end, and why", ""]
        for absence in outcome.absences:
            where = f"{absence.case}, {absence.variant}, {absence.engine}{role_words(absence.role)}"
            lines.append(f"- **{absence.status}** {_flat(f'{where}: {absence.reason}')}")
    lines += _list(
        "Not applicable", (f"{each.case}, {each.where}, {each.engine}: {each.reason}" for each in outcome.inapplicable)
    )
    lines += _list("Offered, and judged by nothing", map(str, grouped(outcome.unjudged)), "results.json")
    lines += _list("No stored reference", (f"{case} {NO_REFERENCE.format(case)}" for case in outcome.unreferenced))
    lines += _list("Lines that are no records", outcome.broken)
    write_whole(file, "\n".join(lines) + "\n")


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
    lines = _told(
        "Goals looser than the case's", outcome.loosened,
        lambda verdict: f"goal {verdict.goal:.2g} instead of {verdict.case_goal:.2g}: {verdict.goal_reason}",
    )  # fmt: skip
    lines += _told(
        "Failures that you expect", outcome.own_failures,
        lambda verdict: f"{verdict.status}: {verdict.expected_reason} ({verdict.own_failure})",
    )  # fmt: skip
    return lines + _list("Expectations that name nothing", outcome.idle_claims)


def _told(title: str, verdicts: Sequence[Verdict], say: Callable[[Verdict], str]) -> list[str]:
    """A section with what there is to say of each verdict."""
    return _section(title, ("what",), verdicts, lambda verdict: (_flat(say(verdict)),))


def _section(
    title: str, heads: Sequence[str], verdicts: Sequence[Verdict], cells: Callable[[Verdict], Sequence[str]]
) -> list[str]:
    """A section with a row for each verdict: where it is, and cells of its own."""
    rows = [
        (_flat(each.case), _flat(each.comparison), _code(each.channel), _flat(each.pair), *cells(each))
        for each in verdicts
    ]
    return _table(("case", "comparison", "channel", "pair", *heads), rows, title, VERDICTS)


def _unexpected(verdict: Verdict) -> tuple[str, str, str]:
    return f"**{verdict.status}**", verdict.expected, _flat(verdict.reason)


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]], title: str = "", all_in: str = "") -> list[str]:
    """A table, under a title if it has one; nothing if that has no rows, and up to `SHOWN` where a file has all."""
    if title and not rows:
        return []
    shown = rows[:SHOWN] if all_in else rows
    lines = ["", f"## {title}", ""] if title else [""]
    lines += [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|", *(f"| {' | '.join(row)} |" for row in shown)]
    return [*lines, "", f"... and {len(rows) - SHOWN} more, in {all_in}."] if len(shown) < len(rows) else lines


def _list(title: str, items: Iterable[str], all_in: str = "") -> list[str]:
    """A list under a title; nothing without items, and up to `SHOWN` where a file has all."""
    flat = [f"- {_flat(item)}" for item in items]
    shown = flat[:SHOWN] if all_in else flat
    more = [f"- ... and {len(flat) - SHOWN} more, in {all_in}."] if len(shown) < len(flat) else []
    return ["", f"## {title}", "", *shown, *more] if flat else []


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
