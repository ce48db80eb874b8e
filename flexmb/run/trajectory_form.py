"""Whether the parts of a trajectory belong together: every array has a row for each time, and all its components."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flexmb.tables import arguments

if TYPE_CHECKING:
    from flexmb.run.trajectory import Trajectory

SPATIAL = {"loads": 6, "wheel_loads": 6, "connectors": 6, "hinge_forces": 1}
"""Fields by name of a hinge or another, with the number of columns."""
SOME = "drives", "signals", "power"
"""The same with any number of columns."""
PATH = {"position": 3, "quaternion": 4, "velocity": 6, "acceleration": 6}


def refuse_torn(run: Trajectory) -> None:
    """TypeError or ValueError for a trajectory that was put together, or altered, so that its parts do not fit."""
    arguments.held("t", run.t, (None,))
    T = len(run.t)
    if not np.isfinite(run.t).all() or np.any(np.diff(run.t) < 0.0):
        raise ValueError("t: finite times are needed, each not before the last")
    for name, names in (("q", run.q_names), ("u", run.u_names)):
        arguments.held(name, getattr(run, name), (T, len(names)))
    for name, columns in SPATIAL.items():
        for part, values in _named(run, name).items():
            arguments.held(f'{name}["{part}"]', values, (T, columns))
    for name in SOME:
        for part, values in _named(run, name).items():
            arguments.held(f'{name}["{part}"]', values, (T, None))
    for part, values in _named(run, "energy").items():
        arguments.held(f'energy["{part}"]', values, (T,))
    for part, path in _named(run, "markers").items():
        refuse_torn_path(f'markers["{part}"]', path, T)
    arguments.held("momentum", run.momentum, (T, 6))
    arguments.held("work", run.work, (T,))


def refuse_torn_path(name: str, path: Any, times: int | None = None) -> None:
    """The same of the path of a marker, at so many times; None for as many as it has."""
    for part, columns in PATH.items():
        if not hasattr(path, part):
            raise TypeError(f"{name} is a {type(path).__name__}: give a MarkerPath")
        arguments.held(f"{name}.{part}", getattr(path, part), (times, columns))
        times = len(getattr(path, part))


def _named(run: Trajectory, name: str) -> dict[str, Any]:
    found = getattr(run, name)
    if not isinstance(found, dict):
        raise TypeError(f"{name} is a {type(found).__name__}: give arrays by name")
    return found
