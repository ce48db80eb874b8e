"""Maps on the terminal: a bar while they run, a line for each verdict."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import TimeRemainingColumn
from rich.text import Text

from crosscheck.running.scheduler import Limits, Scheduler
from crosscheck.stability.map import StabilityMap
from crosscheck.stability.picture import draw
from crosscheck.stability.run import Finished, run_map
from crosscheck.stability.verdict_file import VERDICTS, take_away_verdicts, write_verdicts
from crosscheck.terminal.progress import bars
from crosscheck.terminal.text import marked, words
from flexmb.output.whole import take_away
from flexmb.output.writing import folder


def run_and_draw(
    console: Console, names: Sequence[str], out: Path, pictures: Path, *, depth: int | None, fresh: bool,
    limits: Limits, scheduler: Scheduler,
) -> int:  # fmt: skip
    """Run maps, draw them, write their verdicts; the exit code: 0 if all agree, else 1."""
    verdicts = []
    folder(pictures)
    take_away_verdicts(names, pictures / VERDICTS)
    for name in names:
        take_away(pictures / f"{name}.svg")
    for name in names:
        done = _run(console, name, out / f"{name}.jsonl", depth, fresh, limits, scheduler)
        picture = draw(done, pictures / f"{name}.svg")
        verdicts.append(done.verdict)
        write_verdicts([done.verdict], pictures / VERDICTS)  # one by one: another process may write its own
        console.print(_line(done, picture), soft_wrap=True)
    good = sum(verdict.ok for verdict in verdicts)
    colour = "green" if good == len(verdicts) else "red"
    console.print(words(f"{good} of {len(verdicts)} maps agree with their overlays", f"bold {colour}"))
    return 0 if good == len(verdicts) else 1


def _run(
    console: Console, name: str, records: Path, depth: int | None, fresh: bool, limits: Limits, scheduler: Scheduler
) -> Finished:
    with bars(console, TimeRemainingColumn()) as progress:
        task = progress.add_task(name, total=None)

        def hear(what: StabilityMap, done: int, known: int) -> None:
            progress.update(task, completed=done, total=known, description=f"{name}: cells known so far")

        return run_map(
            name, records, depth=depth, fresh=fresh, limits=limits, scheduler=scheduler, listener=hear
        )


def _line(done: Finished, picture: Path) -> Text:
    verdict = done.verdict
    cells = ", ".join(f"{count} {name}" for name, count in verdict.cells.items())
    far = "beyond the map" if verdict.distance < 0 else f"{verdict.distance}"
    text = f"{verdict.map}: {verdict.status}, farthest cell from the overlay {far}; {cells}; {verdict.seconds:.0f} s"
    worst = "" if verdict.ok or not verdict.worst else f"; {verdict.worst}"
    mark = ("✓", "green") if verdict.ok else ("✕", "red")
    return marked(*mark, f"{text}{worst} -> {picture}")
