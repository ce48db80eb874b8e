"""The basis of an accepted figure: if the basis has changed since, the figure is stale.

Four digests: of the rule by which E and U are found (`crosscheck.judging.rule`); of the scenes, sample times and
scales; of the efforts; of the versions of engines that are not our own. Our own code and the machine are left out:
growth of a figure with these is what accepted figures are meant to detect.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from crosscheck.engines.registry import OWN_CODE
from crosscheck.judging.results import Result
from crosscheck.judging.rule import rule, short_digest
from crosscheck.records.kinds import VariantInfo

PARTS = ("another rule for E and U", "another scene, times or scale", "other efforts", "another version of an engine")
UNKNOWN = "-"


def basis(variants: Mapping[str, VariantInfo], sides: Iterable[Result], scales: object) -> str:
    """The basis of a figure that compares the results `sides`, as written in `accepted.toml`.

    `scales` are those that the case states. Parts that older records do not contain are unknown.
    """
    sides = tuple(sides)
    scenes = [variants[side.variant].basis if side.variant in variants else "" for side in sides]
    efforts = [
        [(run.effort_kind, run.effort_method, f"{run.effort_value:.6g}") for run in side.runs] for side in sides
    ]
    return written(scenes, efforts, [_version(side) for side in sides], scales)


def written(scenes: Iterable[str], efforts: object, versions: object, scales: object) -> str:
    """The four digests, joined by dots."""
    scenes = list(scenes)
    of_scene = short_digest(f"{scenes} {scales}") if all(scenes) else UNKNOWN
    return ".".join([rule(), of_scene, short_digest(f"{efforts}"), short_digest(f"{versions}")])


def changed(then: str, now: str) -> str:
    """What has changed since a figure was accepted, in words; "" if nothing is known to have changed."""
    pairs = zip(PARTS, then.split("."), now.split("."), strict=False)
    return ", ".join(part for part, old, new in pairs if UNKNOWN not in (old, new) and old and old != new)


def _version(side: Result) -> str:
    return "" if side.engine in OWN_CODE or not side.runs else f"{side.engine} {side.finest.version}"
