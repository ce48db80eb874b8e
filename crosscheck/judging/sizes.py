"""The size of a signal that is zero within its uncertainty, to which a goal is relative: see `flexmb.run.rounding`."""

from __future__ import annotations

from collections.abc import Sequence

from flexmb.run.rounding import LEAST_OF_SCENE

LEAST_OF_FAMILY = 2.0**-26  # a range below this part of the family's is not used as a size


def size_of(own: float, further: Sequence[float], doubt: float) -> float:
    """The size (SI) of a signal: the first of its `own` range and `further` that is above its uncertainty `doubt` (SI).

    `further` are those of `Sizes.of`. A range below `LEAST_OF_FAMILY` of the family's is skipped, as are the range and
    the family's below `LEAST_OF_SCENE` of the size from the rest of the scene.
    """
    kin, of_scene = (*further, 0.0, 0.0)[:2]
    if max(own, kin) < LEAST_OF_SCENE * of_scene:
        return of_scene
    candidates = [own, kin, of_scene] if own > LEAST_OF_FAMILY * kin else [kin, of_scene]
    return next((size for size in candidates if size > doubt), max(candidates))
