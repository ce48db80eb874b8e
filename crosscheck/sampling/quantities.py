"""Numbers from a run: reductions over time of a component of a channel, or of its norm."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from crosscheck.sampling.file import Reduction, SweptQuantity
from flexmb.typing import Real

LETTERS = {3: "xyz", 4: "wxyz"}  # of the components of a vector and of a quaternion
REDUCTIONS: dict[Reduction, Callable[[Real], float]] = {
    "final": lambda signal: signal[-1],
    "initial": lambda signal: signal[0],
    "minimum": np.min,
    "maximum": np.max,
    "range": np.ptp,
    "mean": np.mean,  # of the samples, which are equally spaced
    "largest": lambda signal: np.max(np.abs(signal)),
}


def reduce(quantity: SweptQuantity, channels: Mapping[str, Real]) -> float:
    """The quantity of a run with these channels (T, k); ValueError says what is missing, or is not finite."""
    if quantity.channel not in channels:
        raise ValueError(f'{quantity.name}: the engine gives no channel "{quantity.channel}"')
    found = float(REDUCTIONS[quantity.value](_signal(quantity, channels[quantity.channel])))
    if not np.isfinite(found):
        raise ValueError(f"{quantity.name} is {found}")
    return found


def _signal(quantity: SweptQuantity, values: Real) -> Real:
    """One component (T,), the only one, or the norm of all."""
    width, component = values.shape[1], quantity.component
    if component is None:
        return values[:, 0] if width == 1 else np.linalg.norm(values, axis=1)
    place = place_of(component, width)
    if place is None:
        raise ValueError(f"{quantity.name}: {quantity.channel} has {width} components, none is {component!r}")
    return values[:, place]


def place_of(component: int | str, width: int) -> int | None:
    """The column of a component in a channel of some width, None if it has no such component."""
    if isinstance(component, int):
        return component if 0 <= component < width else None
    letters = LETTERS.get(width, "")
    return letters.index(component) if len(component) == 1 and component in letters else None
