"""Central differences of whole runs, extrapolated: what derivatives of runs are held against, by another way."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

import flexmb as fm
from flexmb.parameters.numbers import Number
from flexmb.typing import Real

TIGHT = {"rtol": 1e-13, "atol": 1e-14}


class Differences(NamedTuple):
    """Derivatives, and the estimate of their error, of outputs (T,K) and times of events (E,)."""

    outputs: Real
    error: Real
    events: Real


def outputs(trajectory: fm.Trajectory, of: Sequence[str]) -> Real:
    """The channels (T,K) of a run."""
    found = {name: values for name, _, values in trajectory.columns()}
    return np.column_stack([found[name] for name in of])


def differences(
    scene: fm.schema.Scene, t_end: float, name: str, of: Sequence[str], step: float, samples: int = 21,
    levels: int = 3,
) -> Differences:  # fmt: skip
    """By one number, over steps of `step` and its halves, whose errors h^2, h^4 ... are extrapolated away (Romberg)."""
    value = Number(scene, name).value

    def difference(h: float) -> tuple[Real, Real]:
        runs = [
            fm.simulate(scene.with_values({name: value + side * h}), t_end, samples=samples, **TIGHT)
            for side in (1, -1)
        ]
        ahead, behind = (outputs(run, of) for run in runs)
        times = [np.array([event.t for event in run.events]) for run in runs]
        return (ahead - behind) / (2.0 * h), (times[0] - times[1]) / (2.0 * h)

    rows = [difference(step / 2.0**i) for i in range(levels)]
    found, before = _extrapolated([row[0] for row in rows])
    events, _ = _extrapolated([row[1] for row in rows])
    return Differences(found, np.abs(found - before), events)


def rounding(
    scene: fm.schema.Scene, t_end: float, apart: dict[str, float], of: Sequence[str], slopes: Real, **tolerances: float
) -> Real:
    """(K,) Standard deviation by which runs round at the end.

    Rounding is left of runs whose numbers differ by next to nothing, by up to `apart`, once the `slopes` (K,P) by these
    are taken off. Where differences are small, their own estimates of the error take it for smooth, and are by chance
    any fraction of it.
    """
    value = {name: Number(scene, name).value for name in apart}
    ends = []
    for share in (-1.0, -0.6, -0.1, 0.3, 0.7, 0.9):
        beside = scene.with_values({name: value[name] + share * most for name, most in apart.items()})
        ends.append(outputs(fm.simulate(beside, t_end, samples=2, **tolerances), of)[-1])
        ends[-1] -= share * slopes @ np.array([*apart.values()])
    found: Real = np.std(ends, axis=0, ddof=1)
    return found


def _extrapolated(rows: list[Real]) -> tuple[Real, Real]:
    """The last entry of Romberg's table, and the one before."""
    before = rows[-1]
    for m in range(1, len(rows)):
        before = rows[-1]
        rows = [(4.0**m * fine - coarse) / (4.0**m - 1.0) for coarse, fine in zip(rows, rows[1:], strict=False)]
    return rows[-1], before


def relative_error(found: fm.Sensitivities, name: str, against: Differences, apart: float = 0.0) -> Real:
    """(K,) error of the derivatives by a number, relative to the largest of each output; times nearer than `apart` (s)
    to an event are left out, because there runs with other numbers are on the other side of it."""
    kept = np.array([all(abs(t - event.t) > apart for event in found.events) for t in found.t])
    k = found.parameters.index(name)
    off = np.abs(found.derivatives[kept, :, k] - against.outputs[kept])
    size = np.max(np.abs(against.outputs[kept]), axis=0)
    return np.max(off, axis=0) / np.where(size > 0.0, size, 1.0)
