"""Joins two consecutive runs to one trajectory."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from flexmb.run.run_arrays import SOME, MarkerPath, Run, RunArrays
from flexmb.typing import Real

SAME_NAMES = (
    "q_names", "u_names", "markers", "loads", "wheel_loads", "energy", "connectors", "hinge_forces",
)  # fmt: skip


def joined(first: Run, later: Run) -> Run:
    """See `Trajectory.then`. The later run need not have an output at the end of the first one."""
    for key in SAME_NAMES:
        strange = set(getattr(first, key)) ^ set(getattr(later, key))
        if strange:
            names = ", ".join(sorted(map(str, strange)))
            raise ValueError(f"the runs cannot be joined: only one of them has {key}: {names}")
    if len(later.t) == 0:
        return _ended(first, later)
    kept = int(np.searchsorted(first.t, later.t[0]))
    # the work of a resumed run already includes that of the first run
    counted = first.work[-1] - later.work[0] if len(first.work) and later.work[0] == 0.0 else 0.0

    def both(a: Real, b: Real) -> Real:
        return np.concatenate([a[:kept], b])

    def each(key: str) -> dict[str, Real]:
        a, b = getattr(first, key), getattr(later, key)
        return {name: both(a[name], b[name]) for name in b}

    whole = replace(
        first,
        **{key: both(getattr(first, key), getattr(later, key)) for key in ("t", "q", "u", "momentum")},
        markers={name: _path(first.markers[name], later.markers[name], kept) for name in later.markers},
        **{key: each(key) for key in ("loads", "wheel_loads", "energy", "connectors", "hinge_forces")},
        **{key: _of_some(first, later, kept, key) for key in SOME},
        work=both(first.work, later.work + counted),
        ways=(*(way._replace(until=min(way.until, float(later.t[0]))) for way in first.ways), *later.ways)
        if first.ways and later.ways
        else (),
    )
    return _ended(whole, later)


def _ended(whole: Run, later: Run) -> Run:
    return replace(
        whole, status=later.status, message=later.message, stopped_at=later.stopped_at,
        restart=later.restart, events=whole.events + later.events,
        statistics=_sum(whole.statistics, later.statistics),
    )  # fmt: skip


def _sum(a: Any, b: Any) -> Any:
    """The sum of two `Statistics`."""
    return type(a)(*(getattr(a, field.name) + getattr(b, field.name) for field in fields(a)))


def _path(a: MarkerPath, b: MarkerPath, kept: int) -> MarkerPath:
    """The joined path of a marker, without a jump of the quaternion's sign."""
    turned = kept > 0 and float(a.quaternion[kept - 1] @ b.quaternion[0]) < 0.0
    b = replace(b, quaternion=-b.quaternion) if turned else b
    return type(b)(*(np.concatenate([getattr(a, f.name)[:kept], getattr(b, f.name)]) for f in fields(b)))


def _of_some(first: RunArrays, later: RunArrays, kept: int, key: str) -> dict[str, Real]:
    """Joined drives, signals or powers, whose names and numbers of columns may differ between the runs.

    Missing drives and powers are zero, because a coordinate that is not driven takes none; missing signals are NaN.
    """
    missing = np.nan if key == "signals" else 0.0
    a, b, found = getattr(first, key), getattr(later, key), {}
    for name in {**a, **b}:
        width = max(outputs[name].shape[1] for outputs in (a, b) if name in outputs)
        parts = []
        for values, count in ((a, kept), (b, len(later.t))):
            part = np.full((count, width), missing)
            if name in values:
                part[:, : values[name].shape[1]] = values[name][:count]
            parts.append(part)
        found[name] = np.concatenate(parts)
    return found
