"""The sizes by which a signal is measured that is zero within its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping

from flexmb.run.channels import family, magnitude, signal_range
from flexmb.typing import Real


def sizes(channel: str, channels: Mapping[str, Real]) -> tuple[float, ...]:
    """The largest range (SI) in the channel's family; for torques also the largest force times the scene's extent."""
    kin = (signal_range(name, rows) for name, rows in channels.items() if family(name) == family(channel))
    found = [max(kin, default=0.0)]
    if channel.endswith(".torque"):
        found.append(_largest(".force", channels) * _largest(".position", channels))
    return tuple(found)


def _largest(ending: str, channels: Mapping[str, Real]) -> float:
    """Largest magnitude (SI) among the channels with that ending; 0 if there is none."""
    found = (magnitude(name, rows) for name, rows in channels.items() if name.endswith(ending))
    return max(found, default=0.0)
