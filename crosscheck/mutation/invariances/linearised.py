"""How derivatives and frequencies of a counterpart follow from those of the scene.

Let s be the ratio of each displacement in the counterpart to that in the scene, or of its sign, T that of times and e
that of energies. Accelerations change by s/T^2, speeds by s/T, and forces along the coordinates by e/s:

    by_displacement    s_i / s_j / T^2      by_speed    s_i / s_j / T      by_force    s_i s_j / (e T^2)

Frequencies change by 1/T. The order of the coordinates is that in which each scene declares them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import assert_never

import numpy as np

from crosscheck.engines.linear.coordinates import (
    ROTATION,
    coordinate_names,
    freedom_names,
    is_counted,
    modes_of,
    obstacle,
)
from crosscheck.engines.linear.parts import FREQUENCIES
from crosscheck.engines.trajectories import KNOWN_TO
from flexmb.scene.bodies import BeamBody
from flexmb.scene.freedoms import Ball, Floating, ScalarFreedom
from flexmb.scene.schema import Hinge, PointMass, Scene, Wheel
from flexmb.typing import Index, Real

Channels = dict[str, Real]
Item = Hinge | PointMass | Wheel


@dataclass(frozen=True)
class LinearRelation:
    """scale (n,): s of each coordinate; place (n,): where it stands in the counterpart; None where the derivatives have
    no common coordinates, and only frequencies are compared."""

    scale: Real | None
    place: Index | None
    energy: float = 1.0
    time: float = 1.0

    def back(self, channels: Channels) -> Channels:
        """The channels of the linearised motion in the scene's own terms; others are left out."""
        restored = {}
        for name, rows in channels.items():
            if name in (FREQUENCIES, f"{KNOWN_TO}.{FREQUENCIES}"):
                restored[name] = rows * self.time
            elif name.startswith("derivatives.") and self.scale is not None and self.place is not None:
                n = len(self.scale)
                whole = rows.reshape(-1, n, n)[:, self.place[:, None], self.place]
                restored[name] = (whole / self._factor(name.partition(".")[2], self.scale)).reshape(len(rows), -1)
            elif name.startswith(f"{KNOWN_TO}.") and self.scale is not None:  # of the norm of all entries
                restored[name] = rows / np.min(np.abs(self._factor(name.partition(".")[2], self.scale)), initial=np.inf)
        return restored

    def _factor(self, name: str, s: Real) -> Real:
        """(n,n) ratios of the counterpart's entries to the scene's."""
        match name:
            case "by_displacement":
                return s[:, None] / s / self.time**2
            case "by_speed":
                return s[:, None] / s / self.time
            case "by_force":
                return s[:, None] * s / (self.energy * self.time**2)
        raise ValueError(f'nobody says how "{name}" changes')


def relation(
    scene: Scene,
    other: Scene,
    of_item: Callable[[Item], list[float]] | None = None,
    energy: float = 1.0,
    time: float = 1.0,
) -> LinearRelation:
    """Of coordinates with these ratios, by default one: for each displacement of an item in the scene, in order.

    Modal coordinates keep their values. With other ratios those of a beam belong to modes that are made anew, with a
    sign and a unit of their own: then only frequencies are compared.
    """
    if not is_counted(scene) or obstacle(scene) or (of_item is not None and has_beam_modes(other)):
        return LinearRelation(None, None, energy, time)
    names, theirs = coordinate_names(scene), coordinate_names(other)
    scale = np.ones(len(names))
    if of_item is not None:
        known = [s for item in (*scene.hinges, *scene.point_masses, *scene.wheels) for s in of_item(item)]
        scale[: len(known)] = known
    return LinearRelation(scale, np.array([theirs.index(name) for name in names], np.intp), energy, time)


def has_beam_modes(scene: Scene) -> bool:
    """Whether the modes of a body are made with the model."""
    return any(isinstance(body, BeamBody) and modes_of(body) for body in scene.bodies)


def by_freedom(
    item: Item, scalar: Callable[[ScalarFreedom, int], float], turning: tuple[float, ...], moving: tuple[float, ...]
) -> list[float]:
    """Ratios of the displacements of an item: of scalar freedoms, the `int`-th of the item, of components of rotations
    and of displacements in carried axes. Prescribed ones have none."""
    ratios, count = list[float](), 0
    for freedom, names in zip(item.freedoms, freedom_names(item), strict=True):
        match freedom:
            case ScalarFreedom():
                ratios += [scalar(freedom, count)] * len(names)
                count += 1
            case Ball():
                ratios += turning
            case Floating():
                ratios += [*turning, *moving]
                assert len(names) == 2 * len(ROTATION)
            case _:
                assert_never(freedom)
    return ratios
