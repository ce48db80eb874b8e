"""Segments of a run: between the times at which a function of the scene is not smooth."""

from __future__ import annotations

from flexmb.scene.check.walk import values
from flexmb.scene.convert import ROOT
from flexmb.scene.functions import Pulse, SmoothStep, SpinUp
from flexmb.scene.schema import Scene


def switch_times(scene: Scene, t_end: float) -> list[float]:
    """Times in (0, t_end) where a function of the scene jumps or is no longer smooth: no step may cross one (s)."""
    found: set[float] = set()
    for _, _, function in values(ROOT, scene):
        match function:
            case Pulse(start_s=start, duration_s=duration) | SmoothStep(start_s=start, duration_s=duration):
                found |= {start, start + duration}
            case SpinUp(duration_s=duration):
                found.add(duration)
    return sorted(time for time in found if 0.0 < time < t_end)
