"""`--baseline` of `crosscheck run`: only what became worse since an earlier session fails."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from crosscheck.cli import common
from crosscheck.terminal.text import Verbosity, marked, words

if TYPE_CHECKING:
    from crosscheck.judging.outcome import SessionOutcome
    from crosscheck.sealed.compare import Differences
    from crosscheck.sealed.document import SealedResults


@dataclass(frozen=True)
class Baseline:
    """A results.json, and what it says; None if there is none yet."""

    file: Path
    results: SealedResults | None


@dataclass(frozen=True)
class AgainstBaseline:
    """A session held against its baseline: what changed, or that it was stored, or why it was not."""

    baseline: Baseline
    differences: Differences | None = None
    unfit: str = ""
    idle: bool = False

    @property
    def code(self) -> int:
        """The exit code: a claim or a control that says nothing is an error whatever was before."""
        regressed = self.differences is not None and self.differences.regressed
        return int(regressed or bool(self.unfit) or self.idle)


def read_baseline(given: Path, out: Path) -> Baseline:
    """The baseline `given` as a file or as the folder of its session, read before the session in `out` begins."""
    from crosscheck.sealed.seal import FILE, ResultsError, read_finished

    file = given / FILE if given.is_dir() or not given.suffix else given
    if file.resolve() == (out / FILE).resolve():
        common.refuse(f"--baseline {given}: the session would overwrite it: keep it elsewhere")
    if not file.exists():
        return Baseline(file, None)
    try:
        return Baseline(file, read_finished(file))
    except ResultsError as error:
        common.refuse(f"--baseline: {error}")


def hold_against(baseline: Baseline, outcome: SessionOutcome, out: Path) -> AgainstBaseline:
    """Compare the session in `out` with its baseline and add that to summary.md; without one, store it as the first."""
    from crosscheck.report.ci import add_differences
    from crosscheck.sealed.compare import compare_results
    from crosscheck.sealed.seal import FILE, read_results
    from flexmb.output.files import folder, write_whole

    if baseline.results is not None:
        differences = compare_results(baseline.results, read_results(out / FILE))
        add_differences(differences, out / "summary.md")
        return AgainstBaseline(baseline, differences, idle=bool(outcome.idle_claims or outcome.lost_controls))
    unfit = _unfit(outcome)
    if not unfit:
        folder(baseline.file.parent)
        write_whole(baseline.file, (out / FILE).read_bytes())
    return AgainstBaseline(baseline, unfit=unfit, idle=bool(outcome.idle_claims or outcome.lost_controls))


def print_held(held: AgainstBaseline, shown: Verbosity) -> None:
    """What changed since the baseline; or that there was none, and what this session excuses in later ones."""
    from crosscheck.terminal.verdicts import print_differences

    file = held.baseline.file
    if held.differences is not None:
        if shown is not Verbosity.QUIET:
            print_differences(common.console, held.differences, shown)
        kept = "Worse than the baseline" if held.differences.regressed else "Nothing is worse than the baseline"
        colour = "red" if held.differences.regressed else "green"
        common.console.print(words(f"{kept} {file}", f"bold {colour}"), soft_wrap=True)
    elif held.unfit:
        text = f"There is no baseline {file}, and this session cannot be one: {held.unfit}"
        common.console.print(marked("✕", "red", text), soft_wrap=True)
    else:
        text = f"There was no baseline: this session is it now, {file}. Later ones fail for what is worse than this"
        common.console.print(marked("!", "yellow", text), soft_wrap=True)


def _unfit(outcome: SessionOutcome) -> str:
    """Why a session cannot be a baseline: nothing would be held against it, or what it lacks would be excused."""
    if not outcome.all:
        return "nothing was compared"
    if outcome.broken:
        return f"{len(outcome.broken)} lines of its records are lost"
    if outcome.uncompared:
        return f"{', '.join(outcome.uncompared)} was compared in nothing"
    missing = [
        absence for absence in outcome.absences if absence.status == "did not run" and absence.engine in outcome.asked
    ]
    return f"{missing[0].engine} did not run: {missing[0].reason}" if missing else ""
