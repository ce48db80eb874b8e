"""Assembling an engine's samples to the trajectory that engines exchange."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crosscheck.engines.contract import MarkerPath, Snapshot, Status, Trajectory
from flexmb.typing import Real


def stack(
    times: Real,
    samples: Sequence[Snapshot],
    *,
    status: Status,
    message: str,
    wall_s: float,
    evaluations: int,
    work: Real | None = None,
) -> Trajectory:
    """One trajectory from the snapshot of each sample time reached; never empty, since t = 0 is always reached."""
    first = samples[0]
    return Trajectory(
        status=status,
        message=message,
        times=np.asarray(times, dtype=float),
        markers={
            name: MarkerPath(
                position=np.array([sample.markers[name].position for sample in samples]),
                quaternion=continuous(np.array([sample.markers[name].quaternion for sample in samples])),
                velocity=np.array([sample.markers[name].velocity for sample in samples]),
            )
            for name in first.markers
        },
        loads={name: np.array([sample.loads[name] for sample in samples]) for name in first.loads},
        wheel_loads={name: np.array([sample.wheel_loads[name] for sample in samples]) for name in first.wheel_loads},
        drives={name: np.array([sample.drives[name] for sample in samples]) for name in first.drives},
        energy={kind: np.array([sample.energy[kind] for sample in samples]) for kind in first.energy},
        momentum=None if first.momentum is None else np.array([sample.momentum for sample in samples]),
        work=work,
        wall_s=wall_s,
        evaluations=evaluations,
    )


def continuous(quaternions: Real) -> Real:
    """The same rotations (T,4) with signs chosen so that successive quaternions are near each other."""
    steps = np.sign(np.sum(quaternions[1:] * quaternions[:-1], axis=1))
    signs = np.cumprod(np.concatenate([[1.0], np.where(steps < 0.0, -1.0, 1.0)]))
    return quaternions * signs[:, None]
