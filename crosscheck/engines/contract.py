"""The interface of an engine, and the only data that engines exchange.

All data are in World axes and SI units, at named markers and hinges; quaternions are scalar-first and map body
components to World components; spatial vectors have their angular part first. An engine's own coordinates stay in it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, Literal, Protocol, runtime_checkable

from crosscheck.engines.linear.parts import LinearPart as LinearPart
from flexmb.scene.schema import Scene
from flexmb.typing import Real

Array = Real  # the name that engines outside this package import
Status = Literal["finished", "diverged", "failed"]
Precision = Literal["double", "single"]
UNIT_ROUNDOFF: dict[Precision, float] = {"double": 2.0**-53, "single": 2.0**-24}
USUAL_S = 10.0  # assumed duration of a run where it is unknown
ENERGIES = ("kinetic", "strain", "spring", "gravity")  # the kinds of energy that an engine may give


@dataclass(frozen=True)
class Support:
    """How an engine can represent a scene: "exact", "surrogate" (an approximation, named in `reason`) or "no"."""

    kind: Literal["exact", "surrogate", "no"]
    reason: str = ""


@dataclass(frozen=True)
class Run:
    """What to simulate: from the first of `times` (s, strictly increasing) to the last.

    The first time is 0, unless the engine's `takes` names "t_start". The scene's initial state belongs to the first
    time; functions of time, controllers and events use the times as given.
    `linear`: what of the linearised motion is wanted at every sample, "derivatives", "frequencies" or both; an engine
    that does not offer it leaves it out. `envelope`: whether the run's envelope is wanted, which only the library's own
    engines are asked for.
    """

    times: Real
    linear: tuple[LinearPart, ...] = ()
    envelope: bool = False

    @property
    def t_start(self) -> float:
        """When the run begins (s)."""
        return float(self.times[0])


@dataclass(frozen=True)
class Effort:
    """An accuracy setting of an engine: a relative tolerance or a fixed step (s); `method` names the integrator."""

    kind: Literal["tolerance", "step"]
    value: float
    method: str

    @property
    def label(self) -> str:
        """Its unique name in records and reports."""
        short = f"{self.value:g}"
        exact = short if float(short) == self.value else repr(float(self.value))
        return f"{self.method} {'rtol' if self.kind == 'tolerance' else 'h'}={exact}"


@dataclass(frozen=True)
class MarkerSnapshot:
    """Motion of one marker: position (3,) m, quaternion (4,), spatial velocity and acceleration (6,) [angular; linear].

    The linear acceleration is the classical one of the marker point (not the spatial acceleration's linear part). An
    engine that knows no accelerations leaves them out: None.
    """

    position: Real
    quaternion: Real
    velocity: Real
    acceleration: Real | None = None


@dataclass(frozen=True)
class Snapshot:
    """Pointwise results at the scene's initial state and t = 0.

    `loads[hinge]` (6,) [torque; force]: total load across the hinge, or closure, on the outboard body about the
    outboard hinge point; an engine may add its point masses, under their names. `wheel_loads[wheel]` (6,): on the wheel
    about its centre. `drives[name]` (n,): generalised drive load of each prescribed coordinate of a hinge, wheel or
    point mass, beyond springs and motors. `energy`: "kinetic", "strain", "spring", "gravity" (J), as far as the engine
    knows them.
    `momentum` (6,): [angular about the World origin; linear]. `connectors[name]` (6,): [torque; force] of a connector
    between nodes on body_b about frame B; `hinge_forces[name]` (1,): of one along a hinge, along its coordinate.
    `total_loads[name]` (6,): the sum that the scene names, on its body about its node; found from `loads` for an engine
    whose `takes` does not name "total_loads".
    """

    markers: dict[str, MarkerSnapshot]
    loads: dict[str, Real]
    wheel_loads: dict[str, Real]
    drives: dict[str, Real]
    energy: dict[str, float]
    momentum: Real | None
    connectors: dict[str, Real] = field(default_factory=dict)
    hinge_forces: dict[str, Real] = field(default_factory=dict)
    total_loads: dict[str, Real] = field(default_factory=dict)


@dataclass(frozen=True)
class MarkerPath:
    """Marker motion over time: position (T,3), quaternion (T,4), spatial velocity (T,6) [angular; linear]."""

    position: Real
    quaternion: Real
    velocity: Real


def _by_name(*columns: int | None) -> Any:
    """An output of several items: arrays (T, *columns) by their names."""
    return field(default_factory=dict, metadata={"columns": columns})


def _single(*columns: int | None) -> Any:
    """An output of the whole scene: an array (T, *columns), or None where the engine does not know it."""
    return field(default=None, metadata={"columns": columns})


@dataclass(frozen=True)
class Trajectory:
    """One run. Arrays have the T samples reached: a diverged run keeps its good samples; its message says when and why.

    All answers are checked before they are recorded (`crosscheck.engines.answers`); an invalid one counts as *failed*.
    Names are those of the scene. A marker, load or energy that is left out is a channel that the engine does not offer.
    `loads`, `total_loads`, `wheel_loads`, `connectors` (T,6); `drives` (T,n); `hinge_forces` (T,1); `energy` (T,) each;
    `momentum` (T,6); `work` (T,): the work done so far by drives, motors, dampers, friction, actuators and loads, if
    the engine integrates it. `wall_s` is the time of the solve alone, without that of `derivatives` and `frequencies`,
    which are given only where the run asks for them: `derivatives` "by_displacement", "by_speed" and "by_force"
    (T,n*n) are those of the accelerations of the n free speeds at every sample, row by row in the order and by the
    displacements of `crosscheck.engines.linear.coordinates`; `frequencies` (T,n) rad/s as
    `crosscheck.engines.linear.frequencies` defines them; `known_to` (T,), by these names and "frequencies", says how
    far (Frobenius norm) they may be from those of the same state in exact arithmetic. `undetermined`: what redundant
    closures leave undetermined: channels "load:<name>.torque", "load:<name>.force", "drive:<name>", those of
    "total_load:<name>" likewise, or components of theirs, "load:<name>.force[y, z]" in World axes, "drive:<name>[2]"
    from 1. These may hold NaN, and no others may; they are not compared. An engine that names a component
    that the motion determines has failed; on a scene without closures and couplings that is all of them. `events`: name
    and time (s) of what happened, in the order of time.
    `envelope`, only where the run asks for it: by channel the extremes over all of its steps and both sides of events,
    as rows of `crosscheck.engines.extremes`. `evaluations` of the right-hand side (of the residual, for implicit
    solvers), `steps` made, refused ones too, and floating-point `operations` are 0 where the engine does not count
    them, and the report says so.
    """

    status: Status
    message: str
    times: Real
    markers: dict[str, MarkerPath]
    loads: dict[str, Real] = _by_name(6)
    wheel_loads: dict[str, Real] = _by_name(6)
    drives: dict[str, Real] = _by_name(None)
    connectors: dict[str, Real] = _by_name(6)
    hinge_forces: dict[str, Real] = _by_name(1)
    total_loads: dict[str, Real] = _by_name(6)
    energy: dict[str, Real] = _by_name()
    momentum: Real | None = _single(6)
    work: Real | None = _single()
    derivatives: dict[str, Real] = _by_name(None)
    frequencies: Real | None = _single(None)
    known_to: dict[str, Real] = _by_name()
    wall_s: float = 0.0
    evaluations: int = 0
    steps: int = 0
    operations: int = 0
    undetermined: tuple[str, ...] = ()
    events: tuple[tuple[str, float], ...] = ()
    envelope: dict[str, Real] = field(default_factory=dict)


OUTPUTS: dict[str, tuple[int | None, ...]] = {
    field.name: field.metadata["columns"] for field in fields(Trajectory) if "columns" in field.metadata
}
"""The outputs of a run other than markers, with the shape of each array without its axis of T samples; None is any."""
LINEAR = ("derivatives", "frequencies", "known_to")
"""The outputs that a run has only if it asks for them."""


@runtime_checkable
class Model(Protocol):
    """A scene compiled by one engine."""

    def warm_up(self) -> None:
        """Compile or cache everything that must not be timed."""

    def evaluate(self) -> Snapshot:
        """Accelerations, energies and loads at the scene's initial state, t = 0."""

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        """Integrate; only this is timed. A diverging run has a status and raises nothing."""


@runtime_checkable
class Engine(Protocol):
    """An independent multibody code behind one adapter. Entry-point group: `crosscheck.engines`.

    Optional attributes: `summary`, one line for `crosscheck engines`; for timing reports `algorithm`, a few words, and
    `settings`, a sentence or two on how it is run: its best solver, what is switched off, whose loop steps it, and what
    its `wall_s` contains. `takes` names what its adapter handles of "connectors", "couplings", "controllers" and
    "events" (a scene with others is refused), "total_loads" (it is not given them otherwise) and "t_start" (runs that
    begin at another time than 0).
    `methods` are integrators that efforts may name besides those of its ladders: a sweep refuses others at once.
    `precision` is "single" where the code computes with 32-bit floats, else "double": the clauses of the contract take
    their bounds from its unit roundoff; verdicts on cases do not, since U follows from the engine's efforts.
    `efforts_for(scene, duration_s)` replaces `efforts` for engines with fixed steps, whose ladder depends on the
    duration (see `crosscheck.engines.steps`).
    """

    name: str

    def version(self) -> str:
        """Version of the library; raises `EngineMissing` when it is not installed."""

    def supports(self, scene: Scene) -> Support:
        """Whether, and how exactly, this engine can represent the scene."""

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        """A ladder of at least three efforts for this scene, coarse to fine."""

    def compile(self, scene: Scene) -> Model:
        """Convert the scene, including all conventions."""


class EngineMissing(RuntimeError):
    """The engine's library is not installed; the message says what installs it."""
