"""Rules of expectations other than agreement: each has its reason in words and just the bounds of its kind."""

from __future__ import annotations

import math
from collections.abc import Iterator

from crosscheck.library.case import Band, Comparison, Conservation, RunFile
from crosscheck.library.check.ranges import problem
from crosscheck.library.check.variants import find_variant
from flexmb.scene.problems import Defect, Place

WIDEST = 100.0  # largest ratio of a band's limits
WIDEST_PART = 0.25  # of a run's duration: largest width of the bounds of a time of divergence
BOUNDS = {"differ": "band", "unresolved": "band", "diverged": "diverged_s", "failed": "because", "refused": "because"}
FIGURE_OF = {"differ": "E", "unresolved": "U"}


def check_expectation(run: RunFile, item: Comparison | Conservation, place: Place) -> Iterator[Defect]:
    """An expectation other than agreement must have a reason and just the bounds of its kind."""
    if item.expect != "agree" and not item.reason.strip():
        yield problem(place.key("reason"), "an expected status needs a reason", "say why it is so")
    needed = BOUNDS.get(item.expect)
    for key in dict.fromkeys(BOUNDS.values()):
        value = getattr(item, key)
        given = bool(value.strip() if isinstance(value, str) else value)
        if key == needed and not given:
            text = f"an expected {item.expect} needs its bounds"
            yield problem(place.key(key), text, _remedy(item, key))
        if given and key != needed:
            yield problem(place.key(key), f'it bounds nothing where "{item.expect}" is expected', "take it out")
    if needed == "band" and isinstance(item, Comparison) and item.band:
        yield from _covered(item, place.key("band"))
    if item.diverged_s is not None:
        low, high = item.diverged_s
        duration = _longest(run, item)
        if not 0.0 <= low < high < math.inf or high > duration:
            remedy = "give the earliest and the latest time, in seconds"
            yield problem(place.key("diverged_s"), f"[{low:g}, {high:g}] is no time of {duration:g} s", remedy)
        elif high - low > WIDEST_PART * duration:
            text = f"[{low:g}, {high:g}] is more than {WIDEST_PART:g} of the run's {duration:g} s"
            yield problem(place.key("diverged_s"), text, "narrow it to what was measured")


def _longest(run: RunFile, item: Comparison | Conservation) -> float:
    """The longer duration (s) of the compared variants."""
    sides = (item.a, item.b) if isinstance(item, Comparison) else ()
    names = {item.variant, *(side.variant for side in sides if side is not None)}
    variants = [find_variant(run, name) for name in names if name is not None]
    return max(
        (duration.duration_s or run.duration_s for duration in variants if duration is not None), default=run.duration_s
    )


def _remedy(item: Comparison | Conservation, key: str) -> str:
    form = "[low, high]" if isinstance(item, Conservation) else '{ "pattern of channels" = [low, high] }'
    return {
        "band": f"band = {form} of {FIGURE_OF.get(item.expect, '')}, from what was measured",
        "diverged_s": "diverged_s = [earliest, latest] of the last sample time reached, in seconds",
        "because": 'because = "..." with words that the engine gives as its reason',
    }[key]


def _covered(item: Comparison, place: Place) -> Iterator[Defect]:
    """Every pattern with a goal must have a band: of the same pattern, or of one that includes it or a part of it."""
    for pattern in item.goals:
        if not any(_related(pattern, channel) for channel in item.band):
            yield problem(place, f'no band for "{pattern}"', f'add "{pattern}" = [low, high]')


def _related(goal: str, band: str) -> bool:
    one, other = goal.partition(":")[0].partition(".")[0], band.partition(":")[0].partition(".")[0]
    return one == other


def check_band(band: Band, place: Place) -> Iterator[Defect]:
    """A band must be two positive numbers within a limited ratio."""
    low, high = band
    if not 0.0 < low < high < math.inf:
        yield problem(place, f"[{low:g}, {high:g}] is no band", "give two positive numbers, the lower first")
    elif high > WIDEST * low:
        text = f"[{low:g}, {high:g}] would let the figure grow by more than {WIDEST:g}"
        yield problem(place, text, "narrow it, with finer patterns of channels if they differ that much")
