"""Putting an engine's samples together into the trajectory that engines exchange."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from crosscheck.engines.contract import LINEAR, OUTPUTS, MarkerPath, Snapshot, Trajectory
from crosscheck.engines.linear.outputs import NOTHING, LinearOutputs
from crosscheck.engines.linear.parts import FREQUENCIES
from flexmb.run.channels import channels_of
from flexmb.typing import Real

OF_A_STATE = tuple(name for name in OUTPUTS if name not in ("work", *LINEAR))
"""The outputs that a snapshot has too."""


def stack(
    asked: Real,
    samples: Sequence[Snapshot],
    *,
    message: str,
    wall_s: float,
    evaluations: int,
    steps: int = 0,
    work: Real | None = None,
    linear: LinearOutputs = NOTHING,
) -> Trajectory:
    """One trajectory from the snapshot of each sample time reached; diverged unless all of `asked` (T,) were reached.

    There is at least one snapshot, since the initial state is always reached.
    """
    first, times = samples[0], asked[: len(samples)]
    return Trajectory(
        status="finished" if len(samples) == len(asked) else "diverged",
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
        **{name: _stacked([getattr(sample, name) for sample in samples]) for name in OF_A_STATE},
        **linear.as_outputs,
        work=work,
        wall_s=wall_s,
        evaluations=evaluations,
        steps=steps,
    )


def _stacked(values: Sequence[Any]) -> Any:
    """One output over time: arrays by name, one array, or None where the engine does not know it."""
    first = values[0]
    if isinstance(first, dict):
        return {name: np.array([value[name] for value in values]) for name in first}
    return None if first is None else np.array(values)


def first_samples(run: Trajectory, count: int) -> Trajectory:
    """The first `count` samples of the run."""

    def cut(output: Any) -> Any:
        if isinstance(output, dict):
            return {name: values[:count] for name, values in output.items()}
        return None if output is None else output[:count]

    return replace(
        run,
        times=run.times[:count],
        markers={
            name: MarkerPath(path.position[:count], path.quaternion[:count], path.velocity[:count])
            for name, path in run.markers.items()
        },
        **{name: cut(getattr(run, name)) for name in OUTPUTS},
    )


def continuous(quaternions: Real) -> Real:
    """The same rotations (T,4), with the signs of successive quaternions chosen so that they are close."""
    steps = np.sign(np.sum(quaternions[1:] * quaternions[:-1], axis=1))
    signs = np.cumprod(np.concatenate([[1.0], np.where(steps < 0.0, -1.0, 1.0)]))
    return quaternions * signs[:, None]


# All channels of a run of any engine: the motion and its loads, and where they were asked for derivatives.

KNOWN_TO = "known_to"


def signals_of(run: Trajectory) -> dict[str, Real]:
    """Every channel (T, k) of a run: those of `channels_of`, then those of the linearised motion.

    Matrices are row by row. The channels "known_to.<name>" say how well the engine knows the derivatives and the
    frequencies of its own states; nothing compares them.
    """
    signals = channels_of(run)
    signals |= {f"derivatives.{name}": values for name, values in run.derivatives.items()}
    if run.frequencies is not None:
        signals[FREQUENCIES] = run.frequencies
    signals |= {f"{KNOWN_TO}.{name}": values[:, None] for name, values in run.known_to.items()}
    return signals
