"""The result of a run: all observables at the output times, as arrays; files contain their units."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args, overload

import numpy as np
from numpy.typing import ArrayLike

from flexmb.kept import kept
from flexmb.output.files import write_csv
from flexmb.run import exports
from flexmb.run.envelope import Envelope, envelope
from flexmb.run.peaks import part_of
from flexmb.run.provenance import Making, error_estimate, has_made, system_at, systems_at
from flexmb.run.run_arrays import MarkerPath, RunArrays, Way, joined, refuse_torn
from flexmb.run.total_loads import total_load
from flexmb.scene.quaternions import quaternion_of
from flexmb.system.load_axes import Axes, Redundant
from flexmb.system.observables import ENERGIES, Observation
from flexmb.system.section_loads import SectionBalance, SectionLoads
from flexmb.tables import arguments
from flexmb.tables.state import State
from flexmb.typing import Real

if TYPE_CHECKING:
    import pandas
    import xarray

    from flexmb.view.charting import ChartPage
    from flexmb.view.scene_view import View


@dataclass(frozen=True)
class Trajectory(RunArrays):
    """One run, at the T output times that were reached.

    t (T,) s; q (T,nq) and u (T,nu), in the order of `q_names`, `u_names`, which are (name, unit); markers by name;
    loads by hinge (T,6) [torque; force] on the outboard body about the outboard hinge point, World axes; wheel_loads by
    wheel (T,6) about its centre; drives by hinge or wheel (T,n) generalised loads of the prescribed coordinates; energy
    by kind (T,) J; momentum (T,6) [angular about the World origin; linear]; work (T,) J done since the start by drives,
    motors, dampers, friction, actuators and loads. `stopped_at` is the time of the last good state: the end of the run
    if it finished. connectors by name (T,6) [torque; force] on body_b about frame B, World axes; hinge_forces (T,1) of
    connectors along hinges, along their coordinates; total_loads by name (T,6) [torque; force] on their
    body about their node, World axes. `restart`: resumes the run at its end, None if the run failed.
    `events`: the events that happened, in the order of time. If the scene has controllers: signals (T,k) by sensor and
    controller, and power (T,k) W that each output of a controller puts into the motion. Loads and drives that the
    motion does not determine, because closures are redundant, are NaN: see `undetermined`.
    """

    made_by: Making | None = field(default=None, repr=False, compare=False)
    """The system and the settings of the run; None for a trajectory that `simulate` has not made."""

    def __repr__(self) -> str:
        """How the run ended and the size of its results, for an interactive prompt."""
        size = f"{len(self.t)} times, {len(self.q_names)} coordinates, {len(self.markers)} markers"
        return f"<Trajectory of {self.scene!r}: {self.message}; {size}>"

    def error_estimate(self) -> dict[str, Real]:
        """Error (T,) of every channel, in its unit (orientations: rad), by a second, tighter run from start to end.

        That run has rtol / 100 and atol / 100, or half the step. The distance of the runs is the estimate for the
        former, 4/3 of it for the latter. NaN at times that the second run did not reach. Errors that both runs have in
        common, such as those of too few modes, are not included. ValueError if the settings cannot be made tighter, or
        for a resumed run.
        """
        return error_estimate(self, self._making("its error"))

    @kept
    def envelope(self) -> Envelope:
        """The least and greatest values of loads, drives, markers, signals and all other results over every step of the
        run, between these, and on both sides of every event, with their times.

            run.envelope.loads["hinge"].greatest        (6,) [torque; force], N m and N
            run.envelope.magnitudes["load:hinge.torque"].largest

        Found at the first access by following the run again, which takes about three times as long as the run itself;
        it holds for any number of output times. ValueError for a trajectory that `simulate` has not made,
        DynamicsError where the motion cannot be followed.
        """
        refuse_torn(self)
        if not self._is_followed:
            raise ValueError("the envelope needs a trajectory as simulate made it: use the trajectory of each run")
        parts = [part for way in self.ways for part in way.parts(way.until)]
        return envelope(self, [part_of(self, NO_PANELS), *parts])

    @property
    def sampled_envelope(self) -> Envelope:
        """The same at the output times alone, which costs nothing: peaks between them are missed.

        ValueError for a trajectory without output times.
        """
        refuse_torn(self)
        if not len(self.t):
            raise ValueError("the run has no output times, and so no least and greatest values")
        return envelope(self, [part_of(self, NO_PANELS)])

    @property
    def _is_followed(self) -> bool:
        """Whether the ways are those of this run."""
        names, ways = (self.q_names, self.u_names), self.ways
        if not (isinstance(ways, tuple) and ways and len(self.t) and all(isinstance(way, Way) for way in ways)):
            return False
        return ways[0].start == self.t[0] and ways[-1].until >= self.t[-1] and all(way.names == names for way in ways)

    def loads_in(
        self, axes: Axes = "world", about: tuple[str, str] | None = None, *, redundant: Redundant = "open"
    ) -> dict[str, Real]:
        """`loads` (T,6) in the axes of each hinge's own frame "inboard" or "outboard", and about a node (body, node).

        redundant: components that the motion does not determine in these axes are "open", which is NaN, or those of
        "least_norm", one choice of infinitely many. See `System.hinge_loads`.
        """
        arguments.one_of("redundant", redundant, get_args(Redundant))
        made_by, found = self._making("a hinge's frame"), {name: load.copy() for name, load in self.loads.items()}
        if redundant == "least_norm":
            for i, system in enumerate(systems_at(self, made_by)):
                at = system.hinge_loads(self.state_at(i), axes=axes, about=about, redundant=redundant)
                for name, load in at.items():
                    found[name][i] = load
            return found
        for i, state in enumerate(map(State, self.q, self.u, self.t.tolist())):
            now = {name: load[i] for name, load in self.loads.items()}
            at = system_at(made_by, state.t).referred_loads(state, now, axes, about)
            for name, load in at.items():
                found[name][i] = load
        return found

    def total_load(self, joints: Sequence[str], on: str, *, about: tuple[str, str] | None = None) -> Real:
        """Sum (T,6) [torque; force] of the loads that some hinges and closures exert on a body, World axes.

        It is determined where the sum is, although the single loads may be NaN: see `System.total_load` for what sums
        are, and for ValueError. With controllers, drives are what their outputs were. Raises DynamicsError if a state
        has no accelerations. Sums that the scene names as `total_loads` are fields of the run.
        """
        return total_load(self, systems_at(self, self._making("a sum of loads")), joints, on, about)

    def section_loads(self, body: str, x: ArrayLike) -> SectionLoads:
        """Axial force, shear, bending and torsion across sections at x (X,) m of a beam, over time: arrays (T,X,...).

        See `System.section_loads`. With controllers, drives are what their outputs were. Raises DynamicsError if a
        state has no accelerations.
        """
        made_by = self._making("a section's load")
        last, balance = made_by.system, SectionBalance(made_by.system, body, x)
        loads = np.zeros((len(self.t), len(balance.x), 6))
        for i, system in enumerate(systems_at(self, made_by)):
            if system is not last:
                last, balance = system, SectionBalance(system, body, x)
            loads[i] = balance.at(system.all_loads(self.state_at(i)))
        return balance.loads(loads)

    def _making(self, wanted: str) -> Making:
        refuse_torn(self)
        made_by = self.made_by
        if not isinstance(made_by, Making) or not has_made(made_by, self):
            raise ValueError(
                f"{wanted} needs a trajectory that is one run as simulate made it: use the trajectory of each run"
            )
        return made_by

    @property
    def last_state(self) -> State:
        """The state at the last output time: `simulate(other, t_end, state=trajectory.last_state)` starts from it."""
        return self.state_at(-1)

    def state_at(self, sample: int) -> State:
        """The state at an output time, by its number; negative ones count from the end. IndexError without it."""
        refuse_torn(self)
        sample = arguments.position("sample", sample, len(self.t))
        return State(self.q[sample], self.u[sample], float(self.t[sample]))

    def values_at(self, sample: int) -> dict[str, float]:
        """The state at an output time by names of coordinates and speeds, as `simulate` accepts it."""
        refuse_torn(self)
        sample = arguments.position("sample", sample, len(self.t))
        values = zip((*self.q_names, *self.u_names), (*self.q[sample], *self.u[sample]), strict=True)
        return {name: float(value) for (name, _), value in values}

    def then(self, later: Trajectory) -> Trajectory:
        """This run and a later one as one trajectory, with this run's output times before the start of the later one.

        Work is accumulated and statistics are added; status, message and restart are the later run's. Where only one
        run has a drive, signal or power, the other's drives and powers are zero and its signals NaN. ValueError if
        coordinates, markers, hinges or connectors differ, or if the later run begins after this one has ended.
        """
        if not isinstance(later, Trajectory):
            raise TypeError(f"the later run is a {type(later).__name__}: give a Trajectory")
        refuse_torn(self)
        refuse_torn(later)
        if len(later.t) and later.t[0] > self.stopped_at:
            raise ValueError(
                f"the runs cannot be joined: one ended at {self.stopped_at:g} s, the other began at {later.t[0]:g} s"
            )
        return joined(self, later)

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write all channels, one row per time, under a header "name [unit]"; 17 digits are read back exactly."""
        columns = list(self.columns())
        rows = zip(*(values.tolist() for _, _, values in columns), strict=True)
        write_csv(Path(path), [f"{name} [{unit}]" for name, unit, _ in columns], rows)

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

    def view(self, path: str | os.PathLike[str] | None = None) -> View:
        """The motion in three dimensions as one HTML page that needs no network; written to `path` if that is given.

        A notebook shows the view that it returns. Up to 201 output times are frames: bodies with beams as they bend,
        wheels, point masses, connectors, hinges, trails of markers, and arrows of the loads at hinges and closures,
        and of those from outside. The page names loads that the motion does not determine.
        ValueError for a trajectory that `simulate` has not made, and for a path that does not end in .html.
        """
        from flexmb.view.page import html_file
        from flexmb.view.scene_view import applied_at, scene_view  # here, because most runs are not drawn

        made_by = self._making("a view")
        file = None if path is None else html_file(path)
        scenes = [system_at(made_by, t).scene for t in self.t.tolist()]
        states = list(map(State, self.q, self.u, self.t.tolist()))
        applied = applied_at(systems_at(self, made_by), states) if made_by.system.scene.loads else {}
        names = [name for name, _ in self.q_names]
        view = scene_view(scenes, states, names, self.message, self.loads, applied=applied)
        if file is not None:
            view.save(file)
        return view

    @overload
    def plot(self) -> ChartPage: ...

    @overload
    def plot(self, path: str | os.PathLike[str]) -> list[Path]: ...

    def plot(self, path: str | os.PathLike[str] | None = None) -> ChartPage | list[Path]:
        """Charts of markers, energy, momentum, loads and drives, by components with signs, with events marked.

            run.plot()                 in a notebook, as the last value of a cell: charts to zoom and to read
            run.plot("charts.html")    writes them as one page that needs no network
            run.plot("folder")         writes them as PNG files

        Returns the page, or the paths of what was written. What is below the rounding of a channel's arithmetic is
        drawn as zero: see `flexmb.run.charts`. Loads that the motion does not determine are named, and not drawn.
        """
        from flexmb.run.charts import charts_of  # here, because most runs are not drawn
        from flexmb.view.charting import chart_page
        from flexmb.view.page import is_html

        refuse_torn(self)
        drawn = charts_of(self)
        if path is None:
            return chart_page(self.scene, drawn)
        if is_html(path):
            return [chart_page(self.scene, drawn).save(path)]
        from flexmb.run.plots import write_plots  # here, because matplotlib is slow to import

        return write_plots(drawn, Path(path))


NO_PANELS = np.zeros((0, 2), np.int64)
ROTATIONS = 100_000  # of markers that become quaternions together, which takes four times their memory


def gathered(observation: Observation, rows: Real) -> dict[str, Any]:
    """The fields of a `Trajectory` that are observables, from rows (T,width)."""
    names, found = observation.names, observation.columns_of(rows)
    return {
        "markers": _marker_paths(names.markers, found["markers"]),
        "loads": _by_name(names.hinges, found["loads"]) | _by_name(names.closures, found["closures"]),
        "wheel_loads": _by_name(names.wheels, found["wheel_loads"]),
        "drives": {name: found["drives"][:, places] for name, places in names.driven.items()},
        "energy": _by_name(ENERGIES, found["energy"]),
        "momentum": found["momentum"].copy(),
        "connectors": _by_name(names.connectors, found["connectors"]),
        "hinge_forces": {
            name: load.copy() for name, load in names.along_hinges(found["hinge_forces"], found["drives"]).items()
        },
    }


def _by_name(names: Sequence[str], values: Real) -> dict[str, Real]:
    """The columns of values (T,n) or (T,n,k) by name."""
    return {name: values[:, i].copy() for i, name in enumerate(names)}


def _marker_paths(names: Iterable[str], rows: Real) -> dict[str, MarkerPath]:
    """The paths of K markers by name, from rows (T,K,24) as in `Outputs`."""
    names, together = list(names), max(1, ROTATIONS // max(1, len(rows)))
    paths = {}
    for first in range(0, len(names), together):
        some = slice(first, first + together)
        turned = _continuous_quaternions(rows[:, some, 3:12].reshape(len(rows), len(names[some]), 3, 3))
        for i, name in enumerate(names[some]):
            path = rows[:, first + i]
            paths[name] = MarkerPath(
                position=path[:, :3].copy(), quaternion=turned[:, i].copy(), velocity=path[:, 12:18].copy(),
                acceleration=path[:, 18:24].copy(),
            )  # fmt: skip
    return paths


def _continuous_quaternions(rotations: Real) -> Real:
    """Scalar-first quaternions (T,K,4) of (T,K,3,3) rotations, each with the sign that is closer to the one before."""
    if not rotations.size:
        return np.empty((*rotations.shape[:2], 4))
    quaternions = quaternion_of(rotations)
    turns = np.sum(quaternions[1:] * quaternions[:-1], axis=-1) < 0.0
    quaternions[1:] *= np.cumprod(np.where(turns, -1.0, 1.0), axis=0)[..., None]
    return quaternions
