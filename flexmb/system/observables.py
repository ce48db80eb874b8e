"""Everything observable at one state, by the names of the scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flexmb.entry.observation import Outputs, outputs, parts, places, shapes
from flexmb.scene.quaternions import Angles, angles_of, quaternion_of
from flexmb.tables.named import brief, parts_of
from flexmb.tables.state import finite_result
from flexmb.typing import Flags, Index, Real

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

    def angles(self, sequence: str = "zyx") -> Angles:
        """Angles (3,) rad of a gimbal's `sequence` of axes: see `flexmb.scene.quaternions.angles_of`."""
        return angles_of(self.quaternion, sequence)


PARTS = parts_of("markers", "loads", "wheel_loads", "drives", "energy", "connectors", "hinge_forces")
"""What an evaluation and its derivatives hold by names."""
_MARKERS, _LOADS, _WHEEL_LOADS, _DRIVES, _ENERGY, _CONNECTORS, _HINGE_FORCES = (kind for _, kind in PARTS)


@dataclass(frozen=True)
class Evaluation:
    """Everything observable at one state.

    accelerations (nu,); markers by name; loads by hinge (6,) [torque; force] on the outboard body about the outboard
    hinge point, World axes; wheel_loads by wheel (6,) about its centre; drives by hinge, point mass or wheel (k,), one
    for each prescribed coordinate; energy by kind (J); momentum (6,) [angular about the World origin; linear];
    connectors by name (6,) [torque; force] on body_b about B, World axes; hinge_forces (1,) of connectors along hinges.
    Loads and drives that the motion does not determine, of redundant closures, are NaN: see `undetermined`.
    """

    accelerations: Real
    markers: dict[str, MarkerMotion]
    loads: dict[str, Real]
    wheel_loads: dict[str, Real]
    drives: dict[str, Real]
    energy: dict[str, float]
    momentum: Real
    connectors: dict[str, Real] = field(default_factory=dict)
    hinge_forces: dict[str, Real] = field(default_factory=dict)

    __repr__ = brief

    @property
    def undetermined(self) -> dict[str, NDArray[np.bool_]]:
        """Which components are NaN because infinitely many loads go with the same motion: see `undetermined_loads`."""
        return undetermined_loads(self.loads, self.drives)


def undetermined_loads(loads: Mapping[str, Real], drives: Mapping[str, Real]) -> dict[str, NDArray[np.bool_]]:
    """Which components (6,) of the load of a hinge or closure are NaN at one time or more, by its name; and which of
    its drive loads (n,), by "<name>.drive". Only names with such components are listed."""
    open_loads = dict(loads) | {f"{name}.drive": values for name, values in drives.items()}
    open_ = {name: np.any(np.isnan(np.atleast_2d(values)), axis=0) for name, values in open_loads.items()}
    return {name: flags for name, flags in open_.items() if np.any(flags)}


def open_components(undetermined: Mapping[str, NDArray[np.bool_]]) -> str:
    """Components of loads that `undetermined_loads` lists, in words: "pin (torque x, y; force z), lid.drive"."""
    told = []
    for name, is_open in undetermined.items():
        letters = [[axis for axis, is_axis in zip("xyz", is_open[i : i + 3], strict=False) if is_axis] for i in (0, 3)]
        parts = [f"{part} {', '.join(axes)}" for part, axes in zip(("torque", "force"), letters, strict=True) if axes]
        told.append(f"{name} ({'; '.join(parts)})" if len(is_open) == 6 else name)
    return ", ".join(told)


@dataclass(frozen=True)
class Names:
    """Names of the observed quantities, in the order of the arrays.

    markers: with (body, port) of each. driven: hinges and wheels with prescribed coordinates, with the places of these
    in u. connectors: those between nodes. hinge_forces: springs along hinges, then other laws along hinges; friction
    that sticks is among both. holding: the place in u of a coordinate that friction holds, by its name.
    """

    markers: dict[str, tuple[int, int]]
    hinges: Sequence[str]
    wheels: Sequence[str]
    closures: Sequence[str]
    driven: dict[str, Index]
    connectors: Sequence[str] = ()
    hinge_forces: Sequence[str] = ()
    holding: Mapping[str, int] = field(default_factory=dict)

    def along_hinges(self, hinge_forces: Real, drives: Real) -> dict[str, Real]:
        """Loads (...,1) of connectors along hinges by name, from those of the tables (...,S) and drive loads (...,nu):
        of friction the sum of its two parts or, while it sticks, the load that holds the coordinate."""
        found = dict[str, Real]()
        for i, name in enumerate(self.hinge_forces):
            own = hinge_forces[..., i : i + 1]
            found[name] = found[name] + own if name in found else own
        for name, place in self.holding.items():
            found[name] = drives[..., place : place + 1]
        return found


class Observation:
    """The arrays that kernels fill at one state, `out`, and their conversion to an `Evaluation`."""

    def __init__(self, names: Names, speeds: int) -> None:
        counts = map(len, (names.markers, names.hinges, names.wheels, names.connectors, names.hinge_forces))
        of = shapes(speeds, *counts)
        at = np.array(list(names.markers.values()), dtype=np.int64).reshape(-1, 2)
        self.names, self._shapes, self._at = names, of, (at[:, 0].copy(), at[:, 1].copy())
        self.columns = places(of | {"drives": (speeds,), "closures": (len(names.closures), 6)})
        """Place of each part in a row: those of `out.every`, then drives and the loads of closures."""
        self.width = max(place.stop for place, _ in self.columns.values())
        """Length of a row."""
        self.out = self.outputs()

    def outputs(self) -> Outputs:
        """Fresh arrays of the same kind."""
        return outputs(self._shapes, *self._at)

    def row(self, t: float, closures: Real) -> Real:
        """The present contents (width,) and the loads (C,6) of closures; DynamicsError if they are not finite."""
        row, every = np.empty(self.width), len(self.out.every)
        row[:every] = finite_result(self.out.every, t)
        row[every : every + len(self.out.drives)] = self.out.drives
        if len(closures):
            row[every + len(self.out.drives) :] = finite_result(closures, t).ravel()
        return row

    def columns_of(self, rows: Real) -> dict[str, Real]:
        """Parts of rows (T,width) by the names in `columns`, (T, ...) each, which are views."""
        return {name: rows[:, place].reshape(len(rows), *shape) for name, (place, shape) in self.columns.items()}

    def undetermined(self, parts: Mapping[str, Flags]) -> Flags:
        """Which entries of a row (width,) are undetermined, from those of some of its parts."""
        flags = np.zeros(self.width, bool)
        for name, is_open in parts.items():
            flags[self.columns[name][0]] = is_open.ravel()
        return flags

    def evaluation(self, row: Real) -> Evaluation:
        """A row (width,) by the names of the scene; arrays are parts of it."""
        names, found = self.names, parts(row, self.columns)
        loads = _LOADS(zip(names.hinges, found["loads"], strict=True))
        loads.update(zip(names.closures, found["closures"], strict=True))
        return Evaluation(
            accelerations=found["rates"],
            markers=_MARKERS(
                (name, MarkerMotion(row[:3], row[3:12].reshape(3, 3), row[12:18], row[18:24]))
                for name, row in zip(names.markers, found["markers"], strict=True)
            ),
            loads=loads,
            wheel_loads=_WHEEL_LOADS(zip(names.wheels, found["wheel_loads"], strict=True)),
            drives=_DRIVES((name, found["drives"][places]) for name, places in names.driven.items()),
            energy=_ENERGY(zip(ENERGIES, found["energy"].tolist(), strict=True)),
            momentum=found["momentum"],
            connectors=_CONNECTORS(zip(names.connectors, found["connectors"], strict=True)),
            hinge_forces=_HINGE_FORCES(names.along_hinges(found["hinge_forces"], found["drives"])),
        )
