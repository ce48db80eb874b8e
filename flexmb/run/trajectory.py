"""The result of a run: everything observable at the output times, as arrays, with its units when written to a file."""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from flexmb.output.whole import whole_file
from flexmb.run import exports
from flexmb.run.joining import joined
from flexmb.run.making import Making, error_estimate
from flexmb.run.run_arrays import MarkerPath, RunArrays, refuse_torn
from flexmb.scene.open_loop import refuse_feedback
from flexmb.scene.quaternions import quaternion_of
from flexmb.system.load_axes import Axes
from flexmb.system.observables import ENERGIES, Observation
from flexmb.system.section_loads import SectionBalance, SectionLoads
from flexmb.tables.state import State
from flexmb.typing import Real

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclass(frozen=True)
class Trajectory(RunArrays):
    """One run, at the T output times that were reached.

    t (T,) s; q (T,nq) and u (T,nu), in the order of `q_names`, `u_names`, which are (name, unit); markers by name;
    loads by hinge (T,6) [torque; force] on the outboard body about the outboard hinge point, World axes; wheel_loads by
    wheel (T,6) about its centre; drives by hinge or wheel (T,n) generalised loads of the prescribed coordinates; energy
    by kind (T,) J; momentum (T,6) [angular about the World origin; linear]; work (T,) J done since the start by drives,
    motors, dampers, friction, actuators and loads. `stopped_at` is the time of the last good state: the end of the run
    if it finished. connectors by name (T,6) [torque; force] on body_b about frame B, World axes; hinge_forces (T,1) of
    connectors along hinges, along their coordinates. `restart`: how the run is taken up there, None if it failed.
    `events`: what happened, in the order of time. signals (T,k) by sensor and controller, power (T,k) W that each
    output of a controller puts into the motion, of a scene that has some. Loads and drives that the motion does not
    determine, of redundant closures, are NaN: see `undetermined`.
    """

    made_by: Making | None = field(default=None, repr=False, compare=False)
    """The system and the settings of the run; None where it was put together otherwise."""

    def __repr__(self) -> str:
        """What a prompt shows: how the run ended and what there is, not thousands of numbers."""
        size = f"{len(self.t)} times, {len(self.q_names)} coordinates, {len(self.markers)} markers"
        return f"<Trajectory of {self.scene!r}: {self.message}; {size}>"

    def error_estimate(self) -> dict[str, Real]:
        """Error (T,) of every channel, in its unit (orientations: rad), by a second, tighter run from start to end.

        That run has rtol and atol of a hundredth, or half the step; its distance from this one is the error of this
        one but for a hundredth, or a third, which is added. NaN where the second run did not come. Errors that both
        have in common, such as too few modes, do not show. ValueError where settings cannot be tighter.
        """
        return error_estimate(self, self._making("its error"))

    def loads_in(self, axes: Axes = "world", about: tuple[str, str] | None = None) -> dict[str, Real]:
        """`loads` (T,6) in the axes of each hinge's own frame "inboard" or "outboard", and about a node (body, node).

        NaN what the motion does not determine in these axes. See `System.hinge_loads`.
        """
        system, found = self._making("a hinge's frame").system, {name: load.copy() for name, load in self.loads.items()}
        for i, state in enumerate(map(State, self.q, self.u, self.t.tolist())):
            at = system.referred_loads(state, {name: load[i] for name, load in self.loads.items()}, axes, about)
            for name, load in at.items():
                found[name][i] = load
        return found

    def section_loads(self, body: str, x: ArrayLike) -> SectionLoads:
        """Axial force, shear, bending and torsion across sections at x (X,) m of a beam, over time: arrays (T,X,...).

        See `System.section_loads`. Raises DynamicsError where a state has no accelerations, NotImplementedError for a
        scene with controllers, of whose loads a state by itself knows nothing.
        """
        system = self._making("a section's load").system
        refuse_feedback(system.scene, "a section's load")
        balance = SectionBalance(system, body, x)
        loads = np.zeros((len(self.t), len(balance.x), 6))
        for i, state in enumerate(map(State, self.q, self.u, self.t.tolist())):
            loads[i] = balance.at(system.all_loads(state))
        return balance.loads(loads)

    def _making(self, wanted: str) -> Making:
        refuse_torn(self)
        made_by = self.made_by
        if (
            not isinstance(made_by, Making)
            or not np.array_equal(self.t, made_by.times[: len(self.t)])
            or (self.q_names, self.u_names) != made_by.system.state_names
        ):
            raise ValueError(
                f"this trajectory is not one run as simulate made it, and {wanted} needs that: ask each run for itself"
            )
        return made_by

    @property
    def last_state(self) -> State:
        """The state at the last output time: `simulate(other, t_end, state=trajectory.last_state)` starts from it."""
        return self.state_at(-1)

    def state_at(self, sample: int) -> State:
        """The state at an output time, by its number; negative ones count from the end. IndexError without it."""
        refuse_torn(self)
        return State(self.q[sample], self.u[sample], float(self.t[sample]))

    def values_at(self, sample: int) -> dict[str, float]:
        """The same by the names of coordinates and speeds, for a scene that shares some of them."""
        refuse_torn(self)
        values = zip((*self.q_names, *self.u_names), (*self.q[sample], *self.u[sample]), strict=True)
        return {name: float(value) for (name, _), value in values}

    def then(self, later: Trajectory) -> Trajectory:
        """This run and a later one as one: output times of this one, as far as the later one does not have them.

        Work is counted on, statistics are added; status, message and restart are the later one's. Drives, signals and
        powers that one of them lacks are NaN there. ValueError where coordinates, markers, hinges or connectors differ,
        or the later one begins after this one has ended.
        """
        if not isinstance(later, Trajectory):
            raise TypeError(f"a Trajectory can follow, not a {type(later).__name__}")
        refuse_torn(self)
        refuse_torn(later)
        if len(later.t) and later.t[0] > self.stopped_at:
            raise ValueError(
                f"the runs cannot be joined: one ended at {self.stopped_at:g} s, the other began at {later.t[0]:g} s"
            )
        return joined(self, later)

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write all channels, one row a time, under a header "name [unit]"; 17 digits: they read back exactly."""
        columns = list(self.columns())
        with whole_file(Path(path)) as beside, beside.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow([f"{name} [{unit}]" for name, unit, _ in columns])
            for row in zip(*(values.tolist() for _, _, values in columns), strict=True):
                writer.writerow([f"{value:.17g}" for value in row])

    def to_npz(self, path: str | os.PathLike[str]) -> None:
        """Write all channels for NumPy: `names` (n,), `units` (n,), `values` (T,n), and `scene`."""
        exports.write_npz(self, Path(path))

    def to_pandas(self) -> pandas.DataFrame:
        """All channels as columns, time (s) as the index; `attrs["units"]` by name. ImportError without pandas."""
        return exports.data_frame(self)

    def to_parquet(self, path: str | os.PathLike[str]) -> None:
        """Write all channels as columns, their units in the metadata of the fields. ImportError without pyarrow."""
        exports.write_parquet(self, Path(path))

    def to_xarray(self) -> xarray.Dataset:
        """Channels by name with dimensions t, axis (x, y, z), component (w, x, y, z of quaternions), units in `attrs`.

        Names are those of crosscheck: "marker:end.position", "load:pivot.torque". ImportError without xarray.
        """
        return exports.dataset(self)

    def to_rerun(self, path: str | os.PathLike[str]) -> None:
        """Write a recording (`.rrd`) for the viewer rerun: markers move in space, loads and energies are curves.

        ImportError without rerun-sdk.
        """
        exports.write_recording(self, Path(path))

    def plot(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write charts of markers, energy, loads and drives to `folder` as PNG; returns their paths."""
        from flexmb.run.plots import write_plots  # matplotlib is slow to import, and only needed here

        refuse_torn(self)
        return write_plots(self, Path(folder))


def gathered(observation: Observation, rows: Real) -> dict[str, Any]:
    """Fields of a `Trajectory` that are what was observed, in rows (T,width)."""
    names, found = observation.names, observation.columns_of(rows)
    return {
        "markers": {name: _marker_path(found["markers"][:, i]) for i, name in enumerate(names.markers)},
        "loads": _by_name(names.hinges, found["loads"]) | _by_name(names.closures, found["closures"]),
        "wheel_loads": _by_name(names.wheels, found["wheel_loads"]),
        "drives": {name: found["drives"][:, places] for name, places in names.driven.items()},
        "energy": _by_name(ENERGIES, found["energy"]),
        "momentum": found["momentum"].copy(),
        "connectors": _by_name(names.connectors, found["connectors"]),
        "hinge_forces": _by_name(names.hinge_forces, found["hinge_forces"][:, :, None]),
    }


def _by_name(names: Sequence[str], values: Real) -> dict[str, Real]:
    """Of (T,n) or (T,n,k)."""
    return {name: values[:, i].copy() for i, name in enumerate(names)}


def _marker_path(rows: Real) -> MarkerPath:
    """Of rows (T,24) as `Outputs` has them."""
    return MarkerPath(
        position=rows[:, :3].copy(),
        quaternion=_continuous_quaternions(rows[:, 3:12].reshape(-1, 3, 3)),
        velocity=rows[:, 12:18].copy(),
        acceleration=rows[:, 18:24].copy(),
    )


def _continuous_quaternions(rotations: Real) -> Real:
    """Scalar-first quaternions of (T,3,3) rotations, each with the sign that is closer to the one before."""
    if not len(rotations):
        return np.empty((0, 4))
    quaternions = quaternion_of(rotations)
    turns = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0
    return quaternions * np.cumprod(np.r_[1.0, np.where(turns, -1.0, 1.0)])[:, None]


