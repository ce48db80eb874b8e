"""Limits and dry friction of imported joints as connectors along their hinges: stops that are springs, smooth friction.

Robot files say where a joint stops and how much friction it has, but not how hard the stop is nor how the friction
passes through zero: whoever imports gives these two numbers, and without them the reader notes what it leaves out.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from flexmb.scene.build import SceneBuilder

STOPS = "--stop-stiffness makes them stops"
SMOOTH = "--smoothing makes it a connector"


@dataclass(frozen=True)
class JointConnectors:
    """What limits and friction become; `taken` are names that connectors must not have.

    `stop_stiffness`: of stops at limits, N m/rad or N/m. `smoothing`: the rate (rad/s or m/s) below which friction
    falls to zero. None leaves limits, or friction, out.
    """

    stop_stiffness: float | None
    smoothing: float | None
    taken: Collection[str]

    def __post_init__(self) -> None:
        for key in ("stop_stiffness", "smoothing"):
            value = getattr(self, key)
            if value is not None and not 0.0 < value < float("inf"):
                raise ValueError(f"{key} is {value:g}: give a positive number, in SI units")

    def stop(self, builder: SceneBuilder, joint: str, turns: bool, lower: float, upper: float) -> None:
        """Stops of a joint that turns or slides at `lower` and `upper` (rad or m)."""
        assert self.stop_stiffness is not None
        make = builder.angular_spring if turns else builder.linear_spring
        make(self._named(joint, "stops"), joint, lower=lower, upper=upper, stop_stiffness=self.stop_stiffness)

    def rub(self, builder: SceneBuilder, joint: str, turns: bool, sliding: float) -> None:
        """Dry friction of a joint that turns or slides, of size `sliding` (N m or N)."""
        assert self.smoothing is not None
        make = builder.angular_friction if turns else builder.linear_friction
        make(self._named(joint, "friction"), joint, sliding=sliding, smoothing=self.smoothing)

    def _named(self, joint: str, what: str) -> str:
        return next(name for name in (f"{joint}.{what}{end}" for end in ("", *range(99))) if name not in self.taken)
