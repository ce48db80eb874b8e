"""The efforts of a job: those that the case prescribes, or the engine's own with what is asked for besides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import msgspec

from crosscheck.engines.contract import Effort
from crosscheck.library.case import Variant
from crosscheck.library.efforts import continued, with_extra


def extended(ladder: Sequence[Effort], extra: Sequence[float], finer: int) -> tuple[Effort, ...]:
    """An engine's ladder, with `extra` values for the method of its finest effort, and then `finer` efforts more."""
    finest = ladder[-1]
    alike = [each for each in ladder if (each.kind, each.method) == (finest.kind, finest.method)]
    others = tuple(each for each in ladder if (each.kind, each.method) != (finest.kind, finest.method))
    values = with_extra([each.value for each in alike], extra)
    return (*others, *(replace(finest, value=value) for value in (*values, *continued(finest.kind, values, finer))))


def with_efforts(variant: Variant, engine: str, extra: Sequence[float]) -> Variant:
    """The variant with extra values in the last ladder that it prescribes for an engine, if it prescribes one."""
    places = [place for place, ladder in enumerate(variant.efforts) if ladder.engine == engine]
    if not places or not extra:
        return variant
    ladders = list(variant.efforts)
    last = ladders[places[-1]]
    ladders[places[-1]] = msgspec.structs.replace(last, values=with_extra(last.values, extra))
    return msgspec.structs.replace(variant, efforts=tuple(ladders))
