"""The output times of a run, and the memory that a run takes, which is estimated before the scene is built."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexmb.building.numbering import speeds_at_least
from flexmb.integrate.settings import Settings
from flexmb.scene.schema import Scene
from flexmb.scene.sizes import refuse_bytes, refuse_large_matrix
from flexmb.system import algorithms
from flexmb.system.algorithm import Algorithm
from flexmb.system.system import System
from flexmb.tables import arguments
from flexmb.typing import Real

# Bytes per number, which is stored in a row and again by name; bytes per sample for its time and for NumPy's overhead.
_NUMBER_BYTES, _SAMPLE_BYTES = 16, 200
_FEWER = "ask for fewer, or divide the run into several"


def sample_times(samples: int | Sequence[float] | Real, t_end: float, t_start: float = 0.0) -> Real:
    """Output times (T,) from t_start to t_end (s); samples: their number, or the times. ValueError or TypeError for
    invalid ones."""
    if np.ndim(samples) == 0:
        number = arguments.whole("samples", samples)
        if number < 2:
            raise ValueError(f"samples is {number}: ask for at least 2 output times, the start and the end")
        _refuse_samples(number, _SAMPLE_BYTES)
        times = np.linspace(t_start, t_end, number)
        if _increase(times):
            return times
        raise ValueError(f"samples is {number}: too many to be distinct from {t_start:g} to t_end = {t_end:g} s")
    times = arguments.array("samples", samples)
    increasing = times.ndim == 1 and len(times) > 1 and _increase(times)
    if not (increasing and times[0] == t_start and times[-1] == t_end):
        raise ValueError(
            f"the output times must increase from {t_start:g} to t_end = {t_end:g} s: sort them and add both ends"
        )
    return times.copy()


def _increase(times: Real) -> bool:
    return bool((times[1:] > times[:-1]).all())


def refuse_large_run(scene: Scene | System, samples: int, settings: Settings, algorithm: Algorithm) -> None:
    """ValueError if the outputs of a run, or the matrices of its method or its algorithm, would not fit into memory.

    Of a checked scene it is estimated before anything is built or compiled.
    """
    _refuse_samples(samples, sample_bytes(scene))
    nu = _speeds(scene)
    if matrices := settings.integrator.matrices:
        others = 'take method "dop853" or "rk4", whose cost is O(N)'
        refuse_large_matrix(2 * nu, f'method "{settings.method}"', others, matrices)
    if matrices := algorithms.chosen(algorithm).matrices:
        refuse_large_matrix(nu, f'algorithm "{algorithm}"', 'take "articulated", which needs none', matrices)


def _refuse_samples(samples: int, each: int) -> None:
    refuse_bytes(float(samples) * each, f"samples is {samples}: outputs take", _FEWER)


def _speeds(scene: Scene | System) -> int:
    return speeds_at_least(scene) if isinstance(scene, Scene) else scene.nu


def sample_bytes(scene: Scene | System) -> int:
    """Bound (bytes) of the memory for one output time of a run."""
    nu = _speeds(scene)
    scene = scene if isinstance(scene, Scene) else scene.scene
    loaded = (scene.hinges, scene.wheels, scene.constraints, scene.point_masses, scene.connectors)
    places = sum(map(len, loaded))
    numbers = 4 * nu + len(scene.hinges) + 24 * len(scene.markers) + 6 * places + 11  # a quaternion has one more in q
    return _NUMBER_BYTES * numbers + _SAMPLE_BYTES
