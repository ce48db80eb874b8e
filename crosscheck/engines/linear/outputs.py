"""What an engine says of the linearised motion at each sample of a run: as outputs of its trajectory, and checked
before it is recorded.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from crosscheck.engines.linear.coordinates import coordinate_names, is_counted, obstacle
from crosscheck.engines.linear.matrices import LinearMatrices
from crosscheck.engines.linear.parts import DERIVATIVES, FREQUENCIES, LinearPart
from flexmb.scene.schema import Scene
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
    rows = list(samples) if asked else []
    if not rows or not len(rows[0].by_speed):
        return NOTHING
    derivatives, known_to, frequencies = {}, {}, None
    if "derivatives" in asked:
        derivatives = {name: np.array([getattr(at, name).ravel() for at in rows]) for name in offered}
        known_to = {name: np.array([getattr(at.errors, name) for at in rows]) for name in offered}
    if "frequencies" in asked:
        from crosscheck.engines.linear.frequencies import eigenfrequencies  # loads SciPy

        frequencies, doubts = map(np.array, zip(*(eigenfrequencies(at) for at in rows), strict=True))
        known_to[FREQUENCIES] = doubts
    return LinearOutputs(derivatives, frequencies, known_to)


def fault(derivatives: Mapping[str, Real], frequencies: Real | None, known_to: Mapping[str, Real], scene: Scene) -> str:
    """Why these outputs of a run are not those of the scene, "" if they are."""
    if not (derivatives or frequencies is not None or known_to):
        return ""
    given = {*derivatives, *([FREQUENCIES] if frequencies is not None else [])}
    if given != set(known_to):
        off = ", ".join(sorted(given ^ set(known_to)))
        return f"known_to says how well every derivative and the frequencies are known, and nothing else: see {off}"
    for name, errors in known_to.items():
        if not np.all(errors >= 0.0):
            return f"known_to[{name!r}] holds a negative number or none: it is the largest distance from the exact one"
    if frequencies is not None and np.any(np.diff(frequencies, axis=1) < 0.0):
        return "frequencies do not rise from the lowest to the highest"
    if frequencies is not None and np.any(frequencies < 0.0):
        return "frequencies has negative ones: they are those of pairs of eigenvalues, with the positive imaginary part"
    return _of_other_size(derivatives, frequencies, scene)


def _of_other_size(derivatives: Mapping[str, Real], frequencies: Real | None, scene: Scene) -> str:
    """Why the sizes are not those of the scene's coordinates."""
    reason = obstacle(scene)
    if reason:
        return f"derivatives were given of a scene without shared coordinates: {reason}" if derivatives else ""
    if not is_counted(scene):
        return ""
    names = coordinate_names(scene)
    n, listed = len(names), ", ".join(names)
    for name, values in derivatives.items():
        if values.shape[1] != n * n:
            return f"derivatives[{name!r}] has {values.shape[1]} columns: {n * n} belong to the coordinates {listed}"
    if frequencies is not None and frequencies.shape[1] != n:
        return f"frequencies has {frequencies.shape[1]} columns: one belongs to each of the coordinates {listed}"
    return ""
