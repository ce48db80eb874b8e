"""What an engine says of the linearised motion at each sample of a run, as the outputs of its trajectory."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from crosscheck.engines.linear.matrices import LinearMatrices
from crosscheck.engines.linear.parts import DERIVATIVES, FREQUENCIES, LinearPart
from flexmb.typing import Real


class LinearOutputs(NamedTuple):
    """`derivatives` by name (T, n*n), row by row; frequencies (T, n) rad/s; `known_to` (T,) by the same names."""

    derivatives: dict[str, Real]
    frequencies: Real | None
    known_to: dict[str, Real]

    @property
    def as_outputs(self) -> dict[str, Any]:
        """The outputs of a trajectory, by name."""
        return self._asdict()


NOTHING = LinearOutputs({}, None, {})


def outputs(
    asked: Collection[LinearPart], samples: Iterable[LinearMatrices], offered: Sequence[str] = DERIVATIVES
) -> LinearOutputs:
    """The outputs that were `asked` from the matrices of every sample; of the derivatives those `offered`.

    `samples` is not looked at if nothing was asked, nor if there are no coordinates.
    """
    found = list(samples) if asked else []
    if not found or not len(found[0].by_speed):
        return NOTHING
    derivatives, known_to, frequencies = {}, {}, None
    if "derivatives" in asked:
        derivatives = {name: np.array([getattr(at, name).ravel() for at in found]) for name in offered}
        known_to = {name: np.array([getattr(at.errors, name) for at in found]) for name in offered}
    if "frequencies" in asked:
        from crosscheck.engines.linear.frequencies import eigenfrequencies  # loads SciPy

        frequencies, doubts = map(np.array, zip(*(eigenfrequencies(at) for at in found), strict=True))
        known_to[FREQUENCIES] = doubts
    return LinearOutputs(derivatives, frequencies, known_to)
