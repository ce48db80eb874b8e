"""What a worker is told to do. It stands by itself, for a worker loads no more than it needs, and starts sooner."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from crosscheck.engines.contract import Effort
from crosscheck.running.scheduler import TIME_LIMIT_S
from flexmb.scene.schema import Scene
from flexmb.typing import Real

MAIN, REFINED = "main", "refined"


class Done(NamedTuple):
    """A run that is recorded: its effort, what made it, and its rung of how many; another ladder is run anew."""

    effort: str
    made_by: str
    rung: int
    rungs: int


@dataclass(frozen=True)
class Job:
    """One engine's work on one scene, done by one worker: compile once, run its efforts from coarse to fine.

    `efforts` replaces the engine's ladder where not empty; `finest_only` runs just its last effort. `kept` are the
    channels to store of efforts too coarse to matter for U. `provider` is "module:function" returning the engines by
    name. `done` are the runs already recorded for this very scene. A job with an `error` cannot be run. After
    `time_limit_s` it is stopped; `expected_s` is what it took the last time, None where nobody knows. A `lean` one is
    run once, where short runs are repeated for the clock, and stores nothing but `kept`.
    """

    case: str
    variant: str
    role: str
    engine: str
    scene: Scene | None
    scene_id: str
    times: Real
    provider: str
    efforts: tuple[Effort, ...] = ()
    finest_only: bool = False
    kept: tuple[str, ...] = ()
    done: frozenset[Done] = field(default_factory=frozenset)
    error: str = ""
    time_limit_s: float = TIME_LIMIT_S
    expected_s: float | None = None
    lean: bool = False

    @property
    def work(self) -> tuple[str, str, str, str]:
        """What it is about, whatever its scene and its efforts are."""
        return (self.case, self.variant, self.role, self.engine)

    @property
    def title(self) -> str:
        """How progress names it."""
        role = "" if self.role == MAIN else f" ({self.role})"
        return f"{self.case} · {self.variant}{role} · {self.engine}"
