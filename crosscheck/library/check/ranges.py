"""Rules for all parts of a run file: numbers in their ranges, unique names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from crosscheck.library.case import Band
from flexmb.scene.problems import Defect, Place

DURATIONS_S = (1e-9, 1e7)
MOST_SAMPLES = 100_000  # of a few hundred channels each, which fit into memory and records
MOST_PIECES = 10_000
SIZES = (1e-30, 1e30)  # range of sizes in SI units
ROOT = Place()


def check_within(number: float, limits: Band, place: Place) -> Iterator[Defect]:
    """A number must lie within limits."""
    low, high = limits
    if not low <= number <= high:
        yield problem(place, f"{number:g} makes no sense", f"give a number from {low:g} to {high:g}")


def check_count(number: int, place: Place, least: int) -> Iterator[Defect]:
    """A number of pieces or modes must be at least `least` and not too large."""
    if not least <= number <= MOST_PIECES:
        yield problem(place, f"{number} makes no sense", f"give a number from {least} to {MOST_PIECES}")


def check_fraction(number: float, place: Place) -> Iterator[Defect]:
    """A goal or a limit must be a part of the range."""
    if not 0.0 < number <= 1.0:
        yield problem(place, f"{number:g} is no part of the range", "give a number above 0, at most 1")


def check_duration(duration: float, place: Place) -> Iterator[Defect]:
    """A duration (s) must be one that can be simulated."""
    shortest, longest = DURATIONS_S
    if not shortest <= duration <= longest:
        remedy = f"give {shortest:g} to {longest:g} seconds"
        yield problem(place.key("duration_s"), f"a run needs a duration, and {duration:g} is none", remedy)


def check_samples(samples: int, place: Place) -> Iterator[Defect]:
    """The number of samples must be limited, so that they fit into memory and records."""
    if not 2 <= samples <= MOST_SAMPLES:
        remedy = f"give 2 to {MOST_SAMPLES}: every channel of every run is held at all of them"
        yield problem(place.key("samples"), f"a run cannot have {samples} samples", remedy)


def check_unique(names: Sequence[str], place: Place, what: str) -> Iterator[Defect]:
    """Names must not be empty, and each must be unique; `what` says whose names they are."""
    for i, name in enumerate(names):
        if not name.strip():
            yield problem(place.key(i, "name"), "it is empty", "give a name")
        elif name in names[:i]:
            yield problem(place.key(i, "name"), f'two {what} have the same name, "{name}"', "rename one")


def item_place(collection: str, index: int, name: str) -> Place:
    """The place of one of several items, with its name."""
    return ROOT.key(collection, index).named(f'{collection} "{name}"')


def problem(place: Place, what: str, remedy: str) -> Defect:
    """A problem at a place, with its remedy."""
    return Defect(str(place), what, remedy)
