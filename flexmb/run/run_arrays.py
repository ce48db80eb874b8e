"""The arrays of one run: one row per time, with all components; the check that they are consistent, and two consecutive
runs joined to one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal, NamedTuple, Protocol, TypeVar, assert_never

import numpy as np
from numpy.typing import NDArray

from flexmb.run.event_record import EventRecord
from flexmb.run.restart import Restart
from flexmb.scene.quaternions import Angles, angles_of
from flexmb.system.observables import undetermined_loads
from flexmb.tables import arguments
from flexmb.tables.named import name_parts, parts_of
from flexmb.tables.status import Status
from flexmb.typing import Real

SPATIAL = {"loads": 6, "total_loads": 6, "wheel_loads": 6, "connectors": 6, "hinge_forces": 1}
"""Fields that are dictionaries of arrays by name of an item, with the number of columns."""
SOME = "drives", "signals", "power"
"""Such fields with any number of columns."""
_PARTS = parts_of("markers", "energy", *SPATIAL, *SOME)
PATH = {"position": 3, "quaternion": 4, "velocity": 6, "acceleration": 6}


@dataclass(frozen=True)
class MarkerPath:
    """The motion of a marker in World axes.

    position (T,3) m; quaternion (T,4) scalar first, marker to World components, without jumps of sign; velocity and
    acceleration (T,6) [angular; linear], the linear one being the classical acceleration of the marker point.
    """

    position: Real
    quaternion: Real
    velocity: Real
    acceleration: Real

    def angles(self, sequence: str = "zyx") -> Angles:
        """Angles (T,3) rad of a gimbal's `sequence` of axes, without jumps by whole turns, and where they are singular.

        See `flexmb.scene.quaternions.angles_of`.
        """
        refuse_torn_path("path", self)
        angles = angles_of(self.quaternion, sequence)
        return Angles(np.unwrap(angles.values, axis=0), angles.singular)


@dataclass(frozen=True)
class Statistics:
    """The cost of a run: counts, and seconds for compiling (or reading compiled kernels), integrating and outputs.

    `factorisations` counts factorisations, or exponentials, of matrices of the size of the state.
    """

    evaluations: int
    accepted_steps: int
    rejected_steps: int
    jacobians: int
    factorisations: int
    compile_s: float
    run_s: float
    output_s: float


class Way(NamedTuple):
    """How a run, or a part of a joined one, is followed again for its envelope.

    parts: gives its extremes up to a time (s); start, until: of the run (s); names: its `q_names` and `u_names`.
    """

    parts: Callable[[float], Iterable[Any]]
    start: float
    until: float
    names: tuple[Any, Any]


@dataclass(frozen=True)
class RunArrays:
    """The results of one run at the output times that were reached; `flexmb.Trajectory` describes the fields."""

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
    total_loads: dict[str, Real] = field(default_factory=dict)
    restart: Restart | None = None
    signals: dict[str, Real] = field(default_factory=dict)
    power: dict[str, Real] = field(default_factory=dict)
    events: tuple[EventRecord, ...] = ()
    ways: tuple[Way, ...] = field(default=(), repr=False, compare=False)
    """How the run is followed again, for its envelope; empty for a trajectory that `simulate` has not made."""

    def __post_init__(self) -> None:
        """TypeError or ValueError for inconsistent arrays. Methods that use them check again, as arrays may change."""
        refuse_torn(self)
        name_parts(self, _PARTS)

    @property
    def undetermined(self) -> dict[str, NDArray[np.bool_]]:
        """Loads that the motion does not determine, because closures are redundant (docs/notation.md).

        By name of a hinge, closure or total load, which components (6,) of `loads` or `total_loads` are NaN, at one
        output time or more; by "<name>.drive" which (n,) of `drives`. Empty where all loads are determined.
        """
        return undetermined_loads(self.loads | self.total_loads, self.drives)

    @property
    def finished(self) -> bool:
        return self.status is Status.OK

    @property
    def total_energy(self) -> Real:
        """The sum of all kinds of energy (T,) J."""
        refuse_torn(self)
        return np.sum(list(self.energy.values()), axis=0)

    @property
    def energy_drift(self) -> Real:
        """Energy gained beyond the work done (T,) J: zero except for the error of the integration."""
        return self.total_energy - self.total_energy[0] - (self.work - self.work[0])

    @property
    def energy_scale(self) -> float:
        """The scale (J) to which a drift of energy is compared: the largest change of work or of any kind of energy, or
        the largest kinetic energy."""
        refuse_torn(self)
        changes = [float(np.ptp(energies)) for energies in (self.work, *self.energy.values())]
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
        for kind, part, values in arrays_of(self):
            for i, (name, unit) in enumerate(labels(kind, part, values.shape[1], self)):
                yield name, unit, values[:, i]


Run = TypeVar("Run", bound=RunArrays)
Kind = Literal[
    "q", "u", "position", "quaternion", "velocity", "acceleration", "loads", "total_loads", "wheel_loads", "connectors",
    "drives", "hinge_forces", "energy", "work", "momentum", "signals", "power",
]  # fmt: skip
"""Kinds of results: fields of a run, or of the paths of its markers."""
_BY_NAME: tuple[Kind, ...] = "loads", "total_loads", "wheel_loads", "connectors", "drives", "hinge_forces"
_OF_CONTROLLERS: tuple[Kind, ...] = "signals", "power"


def arrays_of(run: RunArrays) -> Iterator[tuple[Kind, str, Real]]:
    """(kind, name, values (T,k)) of every array but the time, in the order of `RunArrays.columns`."""
    refuse_torn(run)
    yield "q", "", run.q
    yield "u", "", run.u
    for name, path in run.markers.items():
        yield "position", name, path.position
        yield "quaternion", name, path.quaternion
        yield "velocity", name, path.velocity
        yield "acceleration", name, path.acceleration
    for kind in _BY_NAME:
        for name, values in getattr(run, kind).items():
            yield kind, name, values
    for name, values in (run.energy | {"total": run.total_energy}).items():
        yield "energy", name, values[:, None]
    yield "work", "", run.work[:, None]
    yield "momentum", "", run.momentum
    for kind in _OF_CONTROLLERS:
        for name, values in getattr(run, kind).items():
            yield kind, name, values


class StateNames(Protocol):
    """The names and units of coordinates and speeds."""

    @property
    def q_names(self) -> tuple[tuple[str, str], ...]: ...
    @property
    def u_names(self) -> tuple[tuple[str, str], ...]: ...


def labels(kind: Kind, name: str, width: int, run: StateNames | None = None) -> list[tuple[str, str]]:
    """(name, unit) of each of the columns of one of the `arrays_of`, which has so many; run: needed for "q" and "u"."""
    match kind:
        case "q" | "u":
            assert run is not None  # whose coordinates and speeds they are
            return list(run.q_names if kind == "q" else run.u_names)
        case "position":
            return _vector(f"{name}.position", "m")
        case "quaternion":
            return [(f"{name}.quaternion.{axis}", "1") for axis in "wxyz"]
        case "velocity":
            return _spatial(name, ("angular_velocity", "velocity"), ("rad/s", "m/s"))
        case "acceleration":
            return _spatial(name, ("angular_acceleration", "acceleration"), ("rad/s^2", "m/s^2"))
        case "loads" | "total_loads" | "wheel_loads" | "connectors":
            return _spatial(name, ("torque", "force"), ("N m", "N"))
        case "drives":
            return [(f"{name}.drive[{i}]", "N or N m") for i in range(width)]
        case "hinge_forces":
            return [(f"{name}.hinge_force", "N or N m")]
        case "energy":
            return [(f"energy.{name}", "J")]
        case "work":
            return [("work", "J")]
        case "momentum":
            return _spatial("momentum", ("angular", "linear"), ("N m s", "N s"))
        case "signals":
            return [(f"signal.{name}[{i}]", "") for i in range(width)]
        case "power":
            return [(f"power.{name}[{i}]", "W") for i in range(width)]
        case _:
            assert_never(kind)


def fitting(kind: type[Run], parts: dict[str, Any]) -> Run:
    """A run of parts by their fields that fit together as they were made: they are not examined again, which takes as
    long as a short run."""
    found = object.__new__(kind)
    found.__dict__.update(parts)
    name_parts(found, _PARTS)
    return found


def told(run: Run, **words: Any) -> Run:
    """The run with other fields that are no arrays."""
    held = run.__dict__
    return fitting(type(run), {name: held[name] for name in run.__dataclass_fields__ if name in held} | words)


def refuse_torn(run: RunArrays) -> None:
    """TypeError or ValueError for a trajectory whose arrays are inconsistent, because it was altered or put together
    from others."""
    arguments.held("t", run.t, (None,))
    T = len(run.t)
    if not np.isfinite(run.t).all() or np.any(np.diff(run.t) < 0.0):
        raise ValueError("t: times must be finite, and none may be earlier than the one before it")
    for name, names in (("q", run.q_names), ("u", run.u_names)):
        arguments.held(name, getattr(run, name), (T, len(names)))
    for name, columns in SPATIAL.items():
        for part, values in _named(run, name).items():
            arguments.held(f'{name}["{part}"]', values, (T, columns))
    for name in SOME:
        for part, values in _named(run, name).items():
            arguments.held(f'{name}["{part}"]', values, (T, None))
    for part, values in _named(run, "energy").items():
        arguments.held(f'energy["{part}"]', values, (T,))
    for part, path in _named(run, "markers").items():
        refuse_torn_path(f'markers["{part}"]', path, T)
    arguments.held("momentum", run.momentum, (T, 6))
    arguments.held("work", run.work, (T,))


def refuse_torn_path(name: str, path: Any, times: int | None = None) -> None:
    """TypeError or ValueError for an inconsistent path of a marker; `times`: their number, None for any."""
    for part, columns in PATH.items():
        if not hasattr(path, part):
            raise TypeError(f"{name} is a {type(path).__name__}: give a MarkerPath")
        arguments.held(f"{name}.{part}", getattr(path, part), (times, columns))
        times = len(getattr(path, part))


def _named(run: RunArrays, name: str) -> dict[str, Any]:
    value = getattr(run, name)
    if not isinstance(value, dict):
        raise TypeError(f"{name} is a {type(value).__name__}: give arrays by name")
    return value


def _vector(name: str, unit: str) -> list[tuple[str, str]]:
    return [(f"{name}.{axis}", unit) for axis in "xyz"]


def _spatial(name: str, parts: tuple[str, str], units: tuple[str, str]) -> list[tuple[str, str]]:
    return [*_vector(f"{name}.{parts[0]}", units[0]), *_vector(f"{name}.{parts[1]}", units[1])]


SAME_NAMES = ("q_names", "u_names", "markers", "energy", *SPATIAL)


def joined(first: Run, later: Run) -> Run:
    """See `Trajectory.then`. The later run need not have an output at the end of the first one."""
    for key in SAME_NAMES:
        strange = set(getattr(first, key)) ^ set(getattr(later, key))
        if strange:
            names = ", ".join(sorted(map(str, strange)))
            raise ValueError(f"the runs cannot be joined: only one of them has {key}: {names}")
    if len(later.t) == 0:
        return _ended(first, later)
    kept = int(np.searchsorted(first.t, later.t[0]))
    # the work of a resumed run already includes that of the first run
    counted = first.work[-1] - later.work[0] if len(first.work) and later.work[0] == 0.0 else 0.0

    def both(a: Real, b: Real) -> Real:
        return np.concatenate([a[:kept], b])

    def each(key: str) -> dict[str, Real]:
        a, b = getattr(first, key), getattr(later, key)
        return {name: both(a[name], b[name]) for name in b}

    ways = (*(way._replace(until=min(way.until, float(later.t[0]))) for way in first.ways), *later.ways)
    rows, of_items = ("t", "q", "u", "momentum"), ("energy", *SPATIAL)
    arrays: dict[str, Any] = {key: both(getattr(first, key), getattr(later, key)) for key in rows}
    arrays |= {key: each(key) for key in of_items} | {key: _of_some(first, later, kept, key) for key in SOME}
    whole = replace(
        first,
        **arrays,
        markers={name: _joined_path(first.markers[name], later.markers[name], kept) for name in later.markers},
        work=both(first.work, later.work + counted),
        ways=ways if first.ways and later.ways else (),
    )
    return _ended(whole, later)


def _ended(whole: Run, later: Run) -> Run:
    return replace(
        whole, status=later.status, message=later.message, stopped_at=later.stopped_at,
        restart=later.restart, events=whole.events + later.events,
        statistics=_sum(whole.statistics, later.statistics),
    )  # fmt: skip


def _sum(a: Any, b: Any) -> Any:
    """The sum of two `Statistics`."""
    return type(a)(*(getattr(a, field.name) + getattr(b, field.name) for field in fields(a)))


def _joined_path(a: MarkerPath, b: MarkerPath, kept: int) -> MarkerPath:
    """The joined path of a marker, without a jump of the quaternion's sign."""
    turned = kept > 0 and float(a.quaternion[kept - 1] @ b.quaternion[0]) < 0.0
    b = replace(b, quaternion=-b.quaternion) if turned else b
    return type(b)(*(np.concatenate([getattr(a, f.name)[:kept], getattr(b, f.name)]) for f in fields(b)))


def _of_some(first: RunArrays, later: RunArrays, kept: int, key: str) -> dict[str, Real]:
    """Joined drives, signals or powers, whose names and numbers of columns may differ between the runs.

    Missing drives and powers are zero, because a coordinate that is not driven takes none; missing signals are NaN.
    """
    missing = np.nan if key == "signals" else 0.0
    a, b, found = getattr(first, key), getattr(later, key), {}
    for name in {**a, **b}:
        width = max(outputs[name].shape[1] for outputs in (a, b) if name in outputs)
        parts = []
        for values, count in ((a, kept), (b, len(later.t))):
            part = np.full((count, width), missing)
            if name in values:
                part[:, : values[name].shape[1]] = values[name][:count]
            parts.append(part)
        found[name] = np.concatenate(parts)
    return found
