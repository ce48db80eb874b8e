"""What a worker is told to do, and at which efforts. This file imports little, so that workers start quickly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import msgspec

from crosscheck.engines.contract import Effort, LinearPart
from crosscheck.library.case import Variant
from crosscheck.library.efforts import continued, with_extra
from crosscheck.records.kinds import RunRecord
from crosscheck.running.scheduler import TIME_LIMIT_S
from crosscheck.running.tuned import Charted
from flexmb.scene.schema import Scene
from flexmb.typing import Real


def extended(ladder: Sequence[Effort], extra: Sequence[float], finer: int) -> tuple[Effort, ...]:
    """An engine's ladder, with `extra` values for the method of its finest effort, and then `finer` efforts more."""
    finest = ladder[-1]
    alike = [effort for effort in ladder if (effort.kind, effort.method) == (finest.kind, finest.method)]
    others = tuple(effort for effort in ladder if (effort.kind, effort.method) != (finest.kind, finest.method))
    values = with_extra([effort.value for effort in alike], extra)
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


MAIN, REFINED = "main", "refined"


class Done(NamedTuple):
    """A recorded run: its effort, the key of what made it, and its rung of how many. Another ladder is run anew."""

    effort: str
    made_by: str
    rung: int
    rungs: int


@dataclass(frozen=True)
class Job:
    """One engine's work on one scene, done by one worker: compile once, run its efforts from coarse to fine.

    `provider` is "module:function", which returns the engines by name; `maker` is the module that makes this engine, or
    "". `efforts` replaces the engine's ladder unless it is empty; otherwise that gets the values `extra` and `finer`
    efforts more (`crosscheck.running.job`). `finest_only` runs only the last effort. Efforts too coarse to enter the
    uncertainty store only the channels `kept`. `done` are the runs already recorded for this very scene. A job with an
    `error` cannot be run. It is stopped after `time_limit_s`; `expected_s` is what it took the last time, None if
    unknown. A `lean` job runs each effort once, even a short one, and stores only `kept`. `linear` is what it asks of
    the linearised motion. With `rounding`, the finest effort is run with moved inputs too (`crosscheck.running.moved`).
    A job that is `charted` runs efforts for charts, which it finds itself (`crosscheck.running.charting`).
    """

    case: str
    variant: str
    role: str
    engine: str
    scene: Scene | None
    scene_id: str
    times: Real
    provider: str
    maker: str
    efforts: tuple[Effort, ...] = ()
    extra: tuple[float, ...] = ()
    finer: int = 0
    finest_only: bool = False
    kept: tuple[str, ...] = ()
    done: frozenset[Done] = field(default_factory=frozenset)
    error: str = ""
    time_limit_s: float = TIME_LIMIT_S
    expected_s: float | None = None
    lean: bool = False
    linear: tuple[LinearPart, ...] = ()
    rounding: bool = False
    charted: Charted | None = None

    @property
    def work(self) -> tuple[str, str, str, str]:
        """What identifies it apart from its scene and its efforts: case, variant, role and engine."""
        return (self.case, self.variant, self.role, self.engine)

    @property
    def blank(self) -> RunRecord:
        """The record of this job without a run."""
        return RunRecord(
            case=self.case, variant=self.variant, role=self.role, engine=self.engine, version="", scene=self.scene_id,
            status="did not run",
        )  # fmt: skip

    @property
    def title(self) -> str:
        """Its name in progress reports."""
        role = "" if self.role == MAIN else f" ({self.role})"
        return f"{self.case} · {self.variant}{role} · {self.engine}"
