"""Guesses why a signal differs: a correction is tried, and if the corrected signal agrees it is the likely cause.

The corrections tried: a factor (millimetres, degrees, a sign), components exchanged, another order or sense of
quaternions, the axes of the body instead of the World's, another origin, times shifted by whole samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import permutations

import numpy as np

from flexmb.run.channels import distance, signal_range
from flexmb.typing import Real

FACTORS = {
    "1000 times too large: thousandths of the unit (mm, say)": 1e-3,
    "1000 times too small: thousands of the unit (km, kN, say)": 1e3,
    "180/pi times too large: degrees instead of radians": np.pi / 180.0,
    "pi/180 times too small: multiplied by pi/180 once too often": 180.0 / np.pi,
    "of the wrong sign": -1.0,
}
AXES = "xyz"
SHIFTS = (1, -1, 2, -2, 3, -3)  # samples
VISIBLE = 10.0  # least range of the reference over what is allowed, else any small signal would fit


def likely_cause(channel: str, values: Real, reference: Real, allowed: float, markers: Mapping[str, Real]) -> str:
    """The likely fault of `values` (T,k), in words, or "".

    The corrected values must be within `allowed` (SI) of the reference at all times. `markers`
    are the reference's orientations (T,4) by marker.
    """
    if not signal_range(channel, reference) > VISIBLE * allowed:
        return ""
    for cause, corrected in _corrections(channel, values, reference, markers):
        if np.all(distance(channel, corrected, reference) <= allowed):
            return cause
    return _shift(channel, values, reference, allowed)


def _corrections(
    channel: str, values: Real, reference: Real, markers: Mapping[str, Real]
) -> Iterator[tuple[str, Real]]:
    if channel.endswith(".orientation"):
        conjugate = np.array([1.0, -1.0, -1.0, -1.0])
        scalar_first = np.roll(values, 1, axis=1)
        yield "the quaternions are conjugate: they have to map body components to World components", values * conjugate
        yield "the quaternions are scalar-last: the order is w, x, y, z", scalar_first
        yield "the quaternions are scalar-last and conjugate", scalar_first * conjugate
        return
    for words, factor in FACTORS.items():
        load = channel.startswith(("load:", "wheel_load:")) and factor < 0.0
        side = ": the load on the inboard body instead of that on the outboard body?" if load else ""
        yield f"the values are {words}{side}", factor * values
    if values.shape[1] != len(AXES):
        return
    for words, factor in FACTORS.items():
        for i, axis in enumerate(AXES):
            yield f"component {axis} is {words}", values * np.where(np.arange(3) == i, factor, 1.0)
    for order in permutations(range(3)):
        if order != (0, 1, 2):
            given = ", ".join(AXES[order.index(i)] for i in range(3))
            yield f"the components are in the order {given}", values[:, order]
    if channel.endswith(".position"):
        offset = values[0] - reference[0]
        yield f"the origin is another one, off by ({', '.join(f'{x:.6g}' for x in offset)}) m", values - offset
        return
    own = channel.partition(":")[2].rpartition(".")[0]
    for marker, orientation in sorted(markers.items(), key=lambda item: item[0] != own):
        if channel.startswith(("load:", "wheel_load:")) or marker == own:
            yield f'the components are in the axes of "{marker}", not in World axes', _turned(orientation, values)


def _turned(quaternions: Real, vectors: Real) -> Real:
    """Body components (T,3) as World components, by quaternions (T,4): v + 2 w (r x v) + 2 r x (r x v)."""
    w, r = quaternions[:, :1], quaternions[:, 1:]
    once = np.cross(r, vectors)
    return vectors + 2.0 * (w * once + np.cross(r, once))


def _shift(channel: str, values: Real, reference: Real, allowed: float) -> str:
    """Times shifted by some samples, compared where both have samples."""
    for shift in SHIFTS:
        if abs(shift) + 2 > len(values):
            continue
        late, early = (values, reference) if shift > 0 else (reference, values)
        apart = distance(channel, late[abs(shift) :], early[: -abs(shift)])
        moving = signal_range(channel, early[: -abs(shift)]) > VISIBLE * allowed
        if moving and np.all(apart <= allowed):
            samples = "sample" if abs(shift) == 1 else f"{abs(shift)} samples"
            return f"the values are {'a ' if abs(shift) == 1 else ''}{samples} too {'late' if shift > 0 else 'early'}"
    return ""
