"""The result of a run: everything observable at the output times, as arrays, with its units when written to a file."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexmb.output.whole import whole_file
from flexmb.run import exports
from flexmb.run.joining import joined
from flexmb.run.making import Making, error_estimate
from flexmb.run.restart import Restart
from flexmb.run.situation import EventRecord
from flexmb.run.trajectory_form import refuse_torn, refuse_torn_path
from flexmb.scene.angles import Angles, angles_of
from flexmb.scene.open_loop import refuse_feedback
from flexmb.scene.quaternions import quaternion_of
from flexmb.system.load_axes import Axes
from flexmb.system.observables import ENERGIES, Observation, undetermined_loads
from flexmb.system.section_loads import SectionBalance, SectionLoads
from flexmb.tables.state import State
from flexmb.tables.status import Status
from flexmb.typing import Real

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclass(frozen=True)
class MarkerPath:
    """Motion of a marker in World axes.

    position (T,3) m; quaternion (T,4) scalar first, marker to World components, without jumps of sign; velocity and
    acceleration (T,6) [angular; linear], the linear one being the classical acceleration of the marker point.
    """

    position: Real
    quaternion: Real
    velocity: Real
    acceleration: Real

    def angles(self, sequence: str = "zyx") -> Angles:
        """Angles (T,3) rad of a gimbal's `sequence` of axes, without whole turns of jumps; (T,) where singular.

        See `flexmb.scene.angles.angles_of`.
        """
        refuse_torn_path("path", self)
        found = angles_of(self.quaternion, sequence)
        return Angles(np.unwrap(found.values, axis=0), found.singular)


@dataclass(frozen=True)
class Statistics:
    """The cost of a run: seconds of compiling (or of reading compiled kernels), of integrating, of evaluating outputs.

    `factorisations` counts those of a matrix of the size of the state, or of its exponential.
    """

    evaluations: int
    accepted_steps: int
    rejected_steps: int
    jacobians: int
    factorisations: int
    compile_s: float
    run_s: float
    output_s: float


@dataclass(frozen=True)
class Trajectory:
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

    scene: str
    status: Status
    message: str
    stopped_at: float
    t: Real
    q: Real
    u: Real
    q_names: tuple[tuple[str, str], ...]
    u_names: tuple[tuple[str, str], ...]
    markers: dict[str, MarkerPath]
    loads: dict[str, Real]
    wheel_loads: dict[str, Real]
    drives: dict[str, Real]
    energy: dict[str, Real]
    momentum: Real
    work: Real
    statistics: Statistics
    connectors: dict[str, Real] = field(default_factory=dict)
    hinge_forces: dict[str, Real] = field(default_factory=dict)
    restart: Restart | None = None
    signals: dict[str, Real] = field(default_factory=dict)
    power: dict[str, Real] = field(default_factory=dict)
    events: tuple[EventRecord, ...] = ()
    made_by: Making | None = field(default=None, repr=False, compare=False)
    """The system and the settings of the run; None where it was put together otherwise."""

    def __post_init__(self) -> None:
        """TypeError or ValueError for parts that do not belong together; asked once more by what works with them."""
        refuse_torn(self)

    def __repr__(self) -> str:
        """What a prompt shows: how the run ended and what there is, not thousands of numbers."""
        size = f"{len(self.t)} times, {len(self.q_names)} coordinates, {len(self.markers)} markers"
        return f"<Trajectory of {self.scene!r}: {self.message}; {size}>"

    @property
    def undetermined(self) -> dict[str, NDArray[np.bool_]]:
        """What the motion does not determine, where closures suppress what others suppress already (docs/notation.md).

        By name of a hinge or closure, which components (6,) of `loads` are NaN, at one output time or more; by
        "<name>.drive" which (n,) of `drives`. Empty where all loads are determined.
        """
        return undetermined_loads(self.loads, self.drives)

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
    def finished(self) -> bool:
        return self.status is Status.OK

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

    @property
    def total_energy(self) -> Real:
        """Sum of all kinds of energy (T,) J."""
        refuse_torn(self)
        return np.sum(list(self.energy.values()), axis=0)

    @property
    def energy_drift(self) -> Real:
        """Energy gained beyond the work done (T,) J: zero but for the error of the integration."""
        return self.total_energy - self.total_energy[0] - (self.work - self.work[0])

    @property
    def energy_scale(self) -> float:
        """The scale of a drift of energy (J): the largest change of work or of any kind of energy."""
        refuse_torn(self)
        changes = [float(np.ptp(each)) for each in (self.work, *self.energy.values())]
        return max(*changes, float(np.max(self.energy["kinetic"])))

    @property
    def momentum_drift(self) -> Real:
        """Change of momentum since the start (T,6): zero only for scenes without external forces."""
        refuse_torn(self)
        return self.momentum - self.momentum[0]

    def columns(self) -> Iterator[tuple[str, str, Real]]:
        """(name, unit, values (T,)) of every scalar channel, time first."""
        refuse_torn(self)
        yield "t", "s", self.t
        for i, (name, unit) in enumerate(self.q_names):
            yield name, unit, self.q[:, i]
        for i, (name, unit) in enumerate(self.u_names):
            yield name, unit, self.u[:, i]
        for name, path in self.markers.items():
            yield from _vector(f"{name}.position", "m", path.position)
            for i, axis in enumerate("wxyz"):
                yield f"{name}.quaternion.{axis}", "1", path.quaternion[:, i]
            yield from _spatial(name, ("angular_velocity", "velocity"), ("rad/s", "m/s"), path.velocity)
            yield from _spatial(name, ("angular_acceleration", "acceleration"), ("rad/s^2", "m/s^2"), path.acceleration)
        for name, load in (self.loads | self.wheel_loads | self.connectors).items():
            yield from _spatial(name, ("torque", "force"), ("N m", "N"), load)
        for name, drive in self.drives.items():
            for i in range(drive.shape[1]):
                yield f"{name}.drive[{i}]", "N or N m", drive[:, i]
        for name, force in self.hinge_forces.items():
            yield f"{name}.hinge_force", "N or N m", force[:, 0]
        for kind, energy in self.energy.items():
            yield f"energy.{kind}", "J", energy
        yield "energy.total", "J", self.total_energy
        yield "work", "J", self.work
        yield from _spatial("momentum", ("angular", "linear"), ("N m s", "N s"), self.momentum)
        for name, signals in self.signals.items():
            for i in range(signals.shape[1]):
                yield f"signal.{name}[{i}]", "", signals[:, i]
        for name, power in self.power.items():
            for i in range(power.shape[1]):
                yield f"power.{name}[{i}]", "W", power[:, i]

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


def _vector(name: str, unit: str, values: Real) -> Iterator[tuple[str, str, Real]]:
    for i, axis in enumerate("xyz"):
        yield f"{name}.{axis}", unit, values[:, i]


def _spatial(
    name: str, parts: tuple[str, str], units: tuple[str, str], values: Real
) -> Iterator[tuple[str, str, Real]]:
    yield from _vector(f"{name}.{parts[0]}", units[0], values[:, :3])
    yield from _vector(f"{name}.{parts[1]}", units[1], values[:, 3:])
