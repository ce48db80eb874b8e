"""The power of what controllers drive: of each of their outputs, wherever it acts."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexmb.entry.observation import outputs, sense_markers, shapes
from flexmb.system.tree_system import System
from flexmb.tables.arrays import FORCE, NODE_AXES
from flexmb.typing import Real, Record


def powers(system: System, times: Real, states: Real, drives: Record, signals: Real) -> Real:
    """(T,S) W that goes into the motion by each of the signals (T,S), at times (T,) and states (T,n) = [q, u, ...]."""
    c, found = system.constants, np.zeros_like(signals)
    loads = np.flatnonzero(np.isin(c.load["function"], drives["function"]))
    along = _along(system, times, states, loads)
    for drive in drives:
        value = drive["gain"] * signals[:, drive["signal"]]
        rate = np.zeros(len(times))
        for j in np.flatnonzero(c.speed["motor"] == drive["function"]):
            rate += states[:, system.nq + j]
        for i in np.flatnonzero(c.load["function"][loads] == drive["function"]):
            rate += along[:, i]
        found[:, drive["signal"]] += value * rate
    return found


def _along(system: System, times: Real, states: Real, loads: Any) -> Real:
    """(T,L) speeds of the nodes of loads along their directions."""
    c, found = system.constants, np.empty((len(times), len(loads)))
    if not len(loads):
        return found
    ports = c.load["port"][loads]
    bodies = np.searchsorted(c.body["port_stop"], ports, side="right")
    out = outputs(shapes(system.nu, len(loads), 0, 0), bodies.astype(np.int64), ports.astype(np.int64))
    workspace, n = system.workspace(), system.nq + system.nu
    y = np.zeros(n + 1)
    for sample, t in enumerate(times.tolist()):
        y[:n] = states[sample, :n]
        sense_markers(t, y, c, workspace, out)
        for i, (load, row) in enumerate(zip(c.load[loads], out.markers, strict=True)):
            velocity = row[15:18] if load["type"] == FORCE else row[12:15]
            turned = row[3:12].reshape(3, 3) @ load["direction"] if load["frame"] == NODE_AXES else load["direction"]
            found[sample, i] = velocity @ turned
    return found
