"""Rules of `crosscheck-expect.toml`: engines that exist, patterns that can name a channel, numbers, reasons."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from crosscheck.library.check.judged import check_pattern
from crosscheck.library.check.ranges import ROOT, check_fraction, check_within, problem
from crosscheck.library.expect_file import ExpectFile
from flexmb.scene.problems import Defect, Place, closest

EFFORTS = (1e-15, 1e3)  # steps in s, or relative tolerances
MOST_EFFORTS = 10


def check_expect_file(content: ExpectFile, engines: Iterable[str]) -> Iterator[Defect]:
    """All problems; `engines` are those that there are."""
    engines = tuple(engines)
    for number, goal in enumerate(content.goals):
        place = ROOT.key("goal", number)
        yield from _common(goal.engine, goal.cases, engines, place)
        yield from _reason(goal.reason, place)
        if not goal.goals:
            yield problem(place.key("goals"), "it names no channel", '{ "*" = 1e-3 }')
        for pattern, value in goal.goals.items():
            yield from check_pattern(pattern, place.key("goals"))
            yield from check_fraction(value, place.key("goals", pattern))
    for number, failure in enumerate(content.failures):
        place = ROOT.key("expected_failure", number)
        yield from _common(failure.engine, failure.cases, engines, place)
        yield from _reason(failure.reason, place)
        if not failure.channels:
            yield problem(place.key("channels"), "it names no channel", "leave it out to mean all channels")
        for pattern in failure.channels:
            yield from check_pattern(pattern, place.key("channels"))
    for number, efforts in enumerate(content.efforts):
        place = ROOT.key("efforts", number)
        yield from _common(efforts.engine, efforts.cases, engines, place)
        if not 1 <= len(efforts.values) <= MOST_EFFORTS:
            yield problem(place.key("values"), f"{len(efforts.values)} efforts", f"give 1 to {MOST_EFFORTS}")
        for value in efforts.values:
            yield from check_within(value, EFFORTS, place.key("values"))


def _common(engine: str, cases: tuple[str, ...], engines: tuple[str, ...], place: Place) -> Iterator[Defect]:
    if engine not in engines:
        yield problem(place.key("engine"), f'there is no engine "{engine}"', closest(engine, engines))
    if not cases:
        yield problem(place.key("cases"), "it means no case", 'leave it out to mean all, or write ["pendulums/*"]')


def _reason(reason: str, place: Place) -> Iterator[Defect]:
    if not reason.strip():
        yield problem(place.key("reason"), "it is empty", "say why, for those who review the file")
