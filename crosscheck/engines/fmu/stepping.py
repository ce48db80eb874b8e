"""Co-Simulation: an FMU with its own integrator, in equal communication steps between the samples."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from crosscheck.engines.fmu.instance import Instance
from crosscheck.engines.steps import steps_between_samples
from flexmb.typing import Real


def stepped(instance: Instance, times: Real, size: float, sample: Callable[[], None]) -> tuple[int, str]:
    """Step from the first of `times` (T,) s to the last, with `sample` called when the FMU is at each of them.

    size (s): of a communication step at most, infinity for one from each sample to the next. Returns the steps, and why
    it stopped early, "" if it did not. ValueError for a size with samples that are not uniform.
    """
    parts = 1 if size == float("inf") else steps_between_samples(times, size)
    steps, t = 0, float(times[0])
    try:
        sample()
        for begin, end in pairwise(map(float, times)):
            for part in range(parts):
                t = begin + (end - begin) * part / parts
                ends = instance.step(t, begin + (end - begin) * (part + 1) / parts - t)
                steps += 1
                if ends and not (part == parts - 1 and end == times[-1]):
                    return steps, f"the FMU ended the run after t = {t:g} s"
            sample()
    except Exception as error:
        return steps, str(instance.failed(f"stopped after t = {t:g} s", error))
    return steps, ""
