"""What a scene's functions of time say about runs: where no step may cross, and how far they are defined."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from flexmb.scene.check import check_run
from flexmb.scene.check.walk import values
from flexmb.scene.convert import ROOT
from flexmb.scene.functions import Pulse, SmoothStep, SpinUp, Table
from flexmb.scene.schema import Scene
from flexmb.system.tree_system import System


class Timing(NamedTuple):
    """switches (s), increasing: where a function jumps or is no longer smooth; end (s): until when all are defined."""

    switches: tuple[float, ...]
    end: float

    def before(self, t_end: float) -> list[float]:
        """Switches in (0, t_end): no step may cross one (s)."""
        return [time for time in self.switches if 0.0 < time < t_end]


def timing(scene: Scene) -> Timing:
    """Of all functions of a scene."""
    switches, end = set[float](), inf
    for _, _, function in values(ROOT, scene):
        match function:
            case Pulse(start_s=start, duration_s=duration) | SmoothStep(start_s=start, duration_s=duration):
                switches |= {start, start + duration}
            case SpinUp(duration_s=duration):
                switches.add(duration)
            case Table(times_s=times):
                end = min(end, times[-1])
    return Timing(tuple(sorted(switches)), end)


def timing_of(system: System) -> Timing:
    """The same of a system's scene, found once."""
    if Timing not in system.kept:
        system.kept[Timing] = timing(system.scene)
    found: Timing = system.kept[Timing]
    return found


def refuse_end(system: System, t_end: float) -> None:
    """SceneError unless t_end (s) is positive and finite, and every profile covers the run."""
    if not 0.0 < t_end <= min(timing_of(system).end, 1e300):
        check_run(system.scene, t_end)
