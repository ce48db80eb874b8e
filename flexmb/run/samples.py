"""The output times of a run, and the memory that its outputs take."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexmb.system.tree_system import System
from flexmb.tables import arguments
from flexmb.typing import Real

OUTPUT_BYTES = 2**32
"""Limit (bytes) of the memory for the outputs of one run."""
# Bytes per number, which is stored in a row and again by name; bytes per sample for its time and for NumPy's overhead.
_NUMBER_BYTES, _SAMPLE_BYTES = 16, 200
_TOO_MANY = f"outputs would take more than {OUTPUT_BYTES / 2**30:g} GiB; ask for fewer, or divide the run into several"


def sample_times(samples: int | Sequence[float] | Real, t_end: float, t_start: float = 0.0) -> Real:
    """Output times (T,) from t_start to t_end (s); samples: their number, or the times. ValueError or TypeError for
    invalid ones."""
    if np.ndim(samples) == 0:
        number = arguments.whole("samples", samples)
        if number < 2:
            raise ValueError(f"samples is {number}: ask for at least 2 output times, the start and the end")
        if number > OUTPUT_BYTES // _SAMPLE_BYTES:
            raise ValueError(f"samples is {number}: {_TOO_MANY}")
        times = np.linspace(t_start, t_end, number)
        if np.all(np.diff(times) > 0.0):
            return times
        raise ValueError(f"samples is {number}: too many to be distinct from {t_start:g} to t_end = {t_end:g} s")
    times = arguments.array("samples", samples)
    increasing = times.ndim == 1 and len(times) > 1 and bool(np.all(np.diff(times) > 0.0))
    if not (increasing and times[0] == t_start and times[-1] == t_end):
        raise ValueError(
            f"the output times must increase from {t_start:g} to t_end = {t_end:g} s: sort them and add both ends"
        )
    return times.copy()


def refuse_too_many(samples: int, system: System) -> None:
    """ValueError if the outputs would exceed OUTPUT_BYTES."""
    most = OUTPUT_BYTES // sample_bytes(system)
    if samples > most:
        raise ValueError(f"samples is {samples}, but this scene allows {most}: {_TOO_MANY}")


def sample_bytes(system: System) -> int:
    """Upper bound (bytes) of the memory for one output time of a run."""
    scene = system.scene
    loaded = (scene.hinges, scene.wheels, scene.constraints, scene.point_masses, scene.connectors)
    places = sum(map(len, loaded))
    numbers = system.nq + 3 * system.nu + 24 * len(scene.markers) + 6 * places + 11
    return _NUMBER_BYTES * numbers + _SAMPLE_BYTES
