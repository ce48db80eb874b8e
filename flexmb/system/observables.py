"""Everything observable at one state, by the names of the scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexmb.entry.observation import outputs, parts, places, shapes
from flexmb.scene.quaternions import quaternion_of
from flexmb.tables.state import finite_result
from flexmb.typing import Index, Real

ENERGIES = ("kinetic", "strain", "spring", "gravity")


@dataclass(frozen=True)
class MarkerMotion:
    """World axes: position (3,), rotation (3,3) marker -> World, velocity and classical acceleration (6,) [w; v]."""

    position: Real
    rotation: Real
    velocity: Real
    acceleration: Real

    @property
    def quaternion(self) -> Real:
        """Scalar first, unit."""
        return quaternion_of(self.rotation)


@dataclass(frozen=True)
class Evaluation:
    """Everything observable at one state.

    accelerations (nu,); markers by name; loads by hinge (6,) [torque; force] on the outboard body about the outboard
    hinge point, World axes; wheel_loads by wheel (6,) about its centre; drives by hinge, point mass or wheel (k,), one
    for each prescribed coordinate; energy by kind (J); momentum (6,) [angular about the World origin; linear].
    """

    accelerations: Real
    markers: dict[str, MarkerMotion]
    loads: dict[str, Real]
    wheel_loads: dict[str, Real]
    drives: dict[str, Real]
    energy: dict[str, float]
    momentum: Real


@dataclass(frozen=True)
class Names:
    """Of what is observed: (body, port) of markers; hinges and wheels in order; places in u of what is driven."""

    markers: dict[str, tuple[int, int]]
    hinges: Sequence[str]
    wheels: Sequence[str]
    driven: dict[str, Index]


class Observation:
    """The arrays that kernels fill at one state, `out`, and an `Evaluation` made of them."""

    def __init__(self, names: Names, speeds: int) -> None:
        of = shapes(speeds, len(names.markers), len(names.hinges), len(names.wheels))
        at = np.array(list(names.markers.values()), dtype=np.int64).reshape(-1, 2)
        self._names, self._places = names, places(of)
        self.out = outputs(of, at[:, 0].copy(), at[:, 1].copy())

    def evaluation(self, t: float) -> Evaluation:
        """A copy of what was filled last; DynamicsError where a number is not finite."""
        names, found = self._names, parts(finite_result(self.out.every, t).copy(), self._places)
        return Evaluation(
            accelerations=found["rates"],
            markers={
                name: MarkerMotion(row[:3], row[3:12].reshape(3, 3), row[12:18], row[18:24])
                for name, row in zip(names.markers, found["markers"], strict=True)
            },
            loads=dict(zip(names.hinges, found["loads"], strict=True)),
            wheel_loads=dict(zip(names.wheels, found["wheel_loads"], strict=True)),
            drives={name: self.out.drives[places] for name, places in names.driven.items()},
            energy=dict(zip(ENERGIES, found["energy"].tolist(), strict=True)),
            momentum=found["momentum"],
        )
