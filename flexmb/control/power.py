"""The power of controller outputs: of each output, summed over everything that it drives."""

from __future__ import annotations

import numpy as np

from flexmb.entry.observation import outputs, sense_markers, shapes
from flexmb.system.system import System
from flexmb.tables.arrays import FORCE, NODE_AXES, ON_GROUND
from flexmb.typing import Index, Real, Record


def powers(system: System, times: Real, states: Real, drives: Record, signals: Real) -> Real:
    """(T,S) power (W) of each of the signals (T,S) on the motion, at times (T,) and states (T,n) = [q, u, ...]."""
    c, found = system.constants, np.zeros_like(signals)
    loads = np.flatnonzero(np.isin(c.load["function"], drives["function"]))
    connectors = np.flatnonzero(np.isin(c.connector["function"], drives["function"]))
    ends = c.end[connectors]
    ports = np.concatenate([c.load["port"][loads], ends["port"].ravel()])
    rows = _motion(system, times, states, ports)
    along = _along_loads(c.load[loads], rows[:, : len(loads)])
    longer = _lengthening(ends, rows[:, len(loads) :].reshape(len(times), len(connectors), 2, 24))
    for drive in drives:
        rate = np.zeros(len(times))
        pushed = c.hinge_spring["speed"][c.hinge_spring["function"] == drive["function"]]
        for j in [*np.flatnonzero(c.speed["motor"] == drive["function"]), *pushed]:
            rate += states[:, system.nq + j]
        rate += along[:, c.load["function"][loads] == drive["function"]].sum(axis=1)
        rate += longer[:, c.connector["function"][connectors] == drive["function"]].sum(axis=1)
        found[:, drive["signal"]] += drive["gain"] * signals[:, drive["signal"]] * rate
    return found


def _motion(system: System, times: Real, states: Real, ports: Index) -> Real:
    """(T,P,24) rows of ports, laid out as those of markers; zeros for ports on the ground."""
    c, found = system.constants, np.zeros((len(times), len(ports), 24))
    moving = np.flatnonzero(ports >= 0)
    if not len(moving):
        return found
    at = ports[moving].astype(np.int64)
    bodies = np.searchsorted(c.body["port_stop"], at, side="right").astype(np.int64)
    out = outputs(shapes(system.nu, len(at), 0, 0), bodies, at)
    workspace, n = system.workspace(), system.nq + system.nu
    y = np.zeros(n + 1)
    for sample, t in enumerate(times.tolist()):
        y[:n] = states[sample, :n]
        sense_markers(t, y, c, workspace, out)
        found[sample, moving] = out.markers
    return found


def _along_loads(loads: Record, rows: Real) -> Real:
    """(T,L) speeds of the nodes of loads along their directions."""
    found = np.empty(rows.shape[:2])
    for i, load in enumerate(loads):
        direction = load["direction"]
        if load["frame"] == NODE_AXES:
            direction = rows[:, i, 3:12].reshape(-1, 3, 3) @ direction
        velocity = rows[:, i, 15:18] if load["type"] == FORCE else rows[:, i, 12:15]
        found[:, i] = np.sum(velocity * direction, axis=1)
    return found


def _lengthening(ends: Record, rows: Real) -> Real:
    """(T,C) rates of the distances of connectors' ends."""
    positions = np.where((ends["body"] == ON_GROUND)[..., None], ends["position"], rows[..., :3])
    line, apart = positions[:, :, 1] - positions[:, :, 0], rows[:, :, 1, 15:18] - rows[:, :, 0, 15:18]
    length = np.linalg.norm(line, axis=-1)
    return np.divide(np.sum(line * apart, axis=-1), length, out=np.zeros_like(length), where=length > 0.0)
