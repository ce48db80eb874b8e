"""What a worker is told to do. This file imports little, so that workers start quickly."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from crosscheck.engines.contract import Effort, LinearPart
from crosscheck.records.kinds import RunRecord
from crosscheck.running.scheduler import TIME_LIMIT_S
from flexmb.scene.schema import Scene
from flexmb.typing import Real

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
    efforts more (`crosscheck.running.ladder`). `finest_only` runs only the last effort. Efforts too coarse to enter the
    uncertainty store only the channels `kept`. `done` are the runs already recorded for this very scene. A job with an
    `error` cannot be run. It is stopped after `time_limit_s`; `expected_s` is what it took the last time, None if
    unknown. A `lean` job runs each effort once, even a short one, and stores only `kept`. `linear` is what it asks of
    the linearised motion.
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
