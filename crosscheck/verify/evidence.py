"""What is known of a channel that differs, and the test that every possible cause has to pass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flexmb.run.channels import distance, signal_range
from flexmb.typing import Real

VISIBLE = 10.0  # least range of a signal over what is allowed, else any small signal would fit


@dataclass(frozen=True)
class Evidence:
    """Somebody's `values` (T,k) of a `channel`, and all `channels` (T,k) of the reference at the same `times` (T,) s.

    `allowed` (SI) is the distance up to which the channel agrees.
    """

    channel: str
    values: Real
    times: Real
    channels: Mapping[str, Real]
    allowed: float

    @property
    def reference(self) -> Real:
        return self.channels[self.channel]

    @property
    def item(self) -> str:
        """The marker, hinge or wheel whose channel it is."""
        return self.channel.partition(":")[2].rpartition(".")[0]

    @property
    def is_load(self) -> bool:
        return self.channel.startswith(("load:", "total_load:", "wheel_load:"))

    @property
    def is_visible(self) -> bool:
        """Whether the reference moves so much that only the right correction agrees with it."""
        return bool(signal_range(self.channel, self.reference) > VISIBLE * self.allowed)

    @property
    def varies(self) -> bool:
        """Whether the reference changes visibly over time."""
        return bool(np.max(np.ptp(self.reference, axis=0)) > VISIBLE * self.allowed)

    def agrees(self, corrected: Real) -> bool:
        """Whether the values agree once they are corrected."""
        return bool(np.all(distance(self.channel, corrected, self.reference) <= self.allowed))

    def markers(self, part: str) -> dict[str, Real]:
        """That part of the motion of every marker, by its name; of the channel's own item first."""
        ending = f".{part}"
        names = [name for name in self.channels if name.startswith("marker:") and name.endswith(ending)]
        paths = {name.removeprefix("marker:").removesuffix(ending): self.channels[name] for name in names}
        return dict(sorted(paths.items(), key=lambda pair: pair[0] != self.item))


def turned(quaternions: Real, vectors: Real) -> Real:
    """Body components (T,3) as World components, by quaternions (T,4): v + 2 w (r x v) + 2 r x (r x v)."""
    w, r = quaternions[:, :1], quaternions[:, 1:]
    once = np.cross(r, vectors)
    return vectors + 2.0 * (w * once + np.cross(r, once))
