"""Checks of what an engine says of the linearised motion, before it is recorded."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from crosscheck.engines.linear.coordinates import coordinate_names, is_counted, obstacle
from crosscheck.engines.linear.parts import FREQUENCIES
from flexmb.scene.schema import Scene
from flexmb.typing import Real


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
