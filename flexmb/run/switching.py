"""What a scene's functions of time say about runs: where no step may cross, and how far they are defined."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np

from flexmb.scene.check import check_run
from flexmb.scene.check.walk import values
from flexmb.scene.convert import ROOT
from flexmb.scene.functions import Pulse, SmoothStep, SpinUp, Table
from flexmb.scene.schema import Scene
from flexmb.system.tree_system import System
from flexmb.typing import Real


class Timing(NamedTuple):
    """switches (s), increasing: where a function jumps or is no longer smooth; from `start` to `end` (s) all are
    defined."""

    switches: tuple[float, ...]
    start: float
    end: float

    def between(self, t_start: float, t_end: float) -> list[float]:
        """Switches in (t_start, t_end): no step may cross one (s)."""
        return [time for time in self.switches if t_start < time < t_end]


def timing(scene: Scene) -> Timing:
    """Of all functions of a scene."""
    switches, start, end = set[float](), -inf, inf
    for _, _, function in values(ROOT, scene):
        match function:
            case Pulse(start_s=start, duration_s=duration) | SmoothStep(start_s=start, duration_s=duration):
                switches |= {start, start + duration}
            case SpinUp(duration_s=duration):
                switches.add(duration)
            case Table(times_s=times):
                start, end = max(start, times[0]), min(end, times[-1])
    return Timing(tuple(sorted(switches)), start, end)


def timing_of(system: System) -> Timing:
    """The same of a system's scene, found once."""
    if Timing not in system.kept:
        system.kept[Timing] = timing(system.scene)
    found: Timing = system.kept[Timing]
    return found


def segment_ends(system: System, t_start: float, t_end: float, equal_steps: bool, breaks: bool = False) -> Real:
    """The clock's ends of segments of a run: see `flexmb.integrate.problem.Clock`. breaks: whether one is its end."""
    found = timing_of(system)
    is_switch = breaks or t_end in found.switches
    if equal_steps:
        return np.array([*found.between(t_start, t_end), *[t_end] * is_switch, inf])
    return np.array([*found.between(t_start, t_end), t_end, *[t_end] * is_switch])


def refuse_times(system: System, t_start: float, t_end: float) -> None:
    """SceneError unless the run has finite ends in order, and every profile covers it."""
    found = timing_of(system)
    if not max(found.start, -1e300) <= t_start < t_end <= min(found.end, 1e300):
        check_run(system.scene, t_end, t_start)
