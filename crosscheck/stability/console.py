"""Maps on the terminal: a bar while they run, a line for each verdict."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from crosscheck.records.records import BrokenRecords
from crosscheck.report.console import marked, words
from crosscheck.stability.judge import MapVerdict
from crosscheck.stability.map import StabilityMap
from crosscheck.stability.picture import draw
from crosscheck.stability.run import Finished, run_map
from flexmb.output.writing import folder, writing
from flexmb.scene.reading import regular_size

VERDICTS = "maps.json"


def show_maps(console: Console, maps: Iterable[StabilityMap]) -> None:
    """A table of the maps."""
    table = Table("map", "axes", "overlay", header_style="bold")
    for what in maps:
        table.add_row(*map(words, (what.name, f"{what.x.label} x {what.y.label}", what.overlay.name)))
    console.print(table)


def run_and_draw(
    console: Console, names: Sequence[str], out: Path, pictures: Path, *, depth: int | None, fresh: bool,
    workers: int | None, time_limit_s: float | None = None,
) -> int:  # fmt: skip
    """Run maps, draw them, write their verdicts; returns the exit code: 0 where all agree, else 1."""
    verdicts = []
    folder(pictures)
    for name in names:
        done = _run(console, name, out / f"{name}.jsonl", depth, fresh, workers, time_limit_s)
        with writing(pictures):
            picture = draw(done, pictures / f"{name}.svg")
            verdicts.append(done.verdict)
            write_verdicts([done.verdict], pictures / VERDICTS)  # one by one: another process may write its own
        console.print(_line(done, picture), soft_wrap=True)
    good = sum(verdict.ok for verdict in verdicts)
    colour = "green" if good == len(verdicts) else "red"
    console.print(words(f"{good} of {len(verdicts)} maps agree with their overlays", f"bold {colour}"))
    return 0 if good == len(verdicts) else 1


def write_verdicts(verdicts: Sequence[MapVerdict], file: Path) -> None:
    """The verdicts as a JSON file; those of other maps that it holds already are kept.

    A file with other content is set aside as `<file>.broken`, with a warning, so that the verdicts can still be
    written.
    """
    try:
        known = {verdict.map: verdict for verdict in read_verdicts(file)} if file.exists() else {}
    except ValueError as error:
        aside = file.replace(file.with_name(file.name + ".broken"))
        warnings.warn(f"{error}; moved to {aside.name}", BrokenRecords, stacklevel=2)
        known = {}
    known |= {verdict.map: verdict for verdict in verdicts}
    text = msgspec.json.format(msgspec.json.encode([known[name] for name in sorted(known)]), indent=1)
    file.write_bytes(text + b"\n")


def read_verdicts(file: Path) -> list[MapVerdict]:
    """The verdicts that `write_verdicts` wrote. Raises OSError, or ValueError naming the file."""
    text = file.read_bytes() if regular_size(file) else b""
    try:
        return msgspec.json.decode(text, type=list[MapVerdict])
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{file}: these are no verdicts on maps: {error}") from None


def _run(
    console: Console, name: str, records: Path, depth: int | None, fresh: bool, workers: int | None,
    time_limit_s: float | None,
) -> Finished:  # fmt: skip
    with Progress(
        SpinnerColumn(), TextColumn("{task.description}", markup=False), BarColumn(bar_width=24), MofNCompleteColumn(),
        TimeElapsedColumn(), console=console, transient=True,
    ) as progress:  # fmt: skip
        task = progress.add_task(name, total=None)

        def hear(what: StabilityMap, done: int, known: int) -> None:
            progress.update(task, completed=done, total=known, description=f"{name}: cells known so far")

        return run_map(
            name, records, depth=depth, fresh=fresh, workers=workers, time_limit_s=time_limit_s, listener=hear
        )


def _line(done: Finished, picture: Path) -> Text:
    verdict = done.verdict
    cells = ", ".join(f"{count} {name}" for name, count in verdict.cells.items())
    far = "beyond the map" if verdict.distance < 0 else f"{verdict.distance}"
    text = f"{verdict.map}: {verdict.status}, farthest cell from the overlay {far}; {cells}; {verdict.seconds:.0f} s"
    worst = "" if verdict.ok or not verdict.worst else f"; {verdict.worst}"
    mark = ("✓", "green") if verdict.ok else ("✕", "red")
    return marked(*mark, f"{text}{worst} -> {picture}")
