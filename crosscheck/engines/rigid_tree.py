"""What the adapters of peers for rigid trees have in common: coordinates, forces, loads, connectors, drives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar, assert_never

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crosscheck.engines.connections import Along, Exerted, Moving, along_hinges, connections
from crosscheck.engines.conventions import Frame, rotation_vector
from crosscheck.engines.functions_of_time import Profile, Signals, profile
from crosscheck.engines.links import Attachment, Ball, Floating, Freedom, Link, Scalar, attachment
from flexmb.scene.schema import Load, Scene
from flexmb.scene.tree import coupled
from flexmb.typing import Real


@dataclass(frozen=True)
class Slot:
    """A freedom, and where its coordinates start in `q` and its speeds in `v`."""

    freedom: Freedom
    link: Link
    q: int
    v: int

    @property
    def driven(self) -> bool:
        return isinstance(self.freedom, Scalar) and self.freedom.prescribed is not None


AnySlot = TypeVar("AnySlot", bound=Slot)
Places = slice | NDArray[np.intp]


def places(numbers: ArrayLike) -> Places:
    """Indices of entries of an array; consecutive ones as a slice, which takes a third of the time."""
    indices = np.asarray(numbers, dtype=np.intp)
    if len(indices) == 0:
        return slice(0, 0)
    return slice(int(indices[0]), int(indices[-1]) + 1) if np.all(np.diff(indices) == 1) else indices


def as_it_is(quaternion: Real) -> Real:
    """A quaternion of a peer that counts them as the scene does, scalar first."""
    return quaternion


def scalars(slots: Sequence[AnySlot]) -> list[AnySlot]:
    """Those of joints of one coordinate."""
    return [slot for slot in slots if isinstance(slot.freedom, Scalar)]


def motors(slots: Sequence[Slot], signals: Signals | None = None) -> list[tuple[int, Callable[[float], Profile]]]:
    """The place in `v` of every coordinate with a motor, and the load of that as a function of time."""
    moved = [slot for slot in scalars(slots) if slot.freedom.effort is not None]
    return [(slot.v, profile(slot.freedom.effort, signals)) for slot in moved]


def scalar_start(freedom: Scalar) -> tuple[float, float]:
    """Value and rate of a scalar freedom at t = 0, those of its prescribed motion if it has one."""
    if freedom.prescribed is None:
        return freedom.value, freedom.rate
    return profile(freedom.prescribed)(0.0)[:2]


def scene_start(
    slots: Sequence[Slot], sizes: tuple[int, int], flight: Callable[[Floating], ArrayLike],
    quaternion: Callable[[Real], Real] = as_it_is,
) -> tuple[Real, Real]:  # fmt: skip
    """q and v, of these sizes, at t = 0; free flight has position and quaternion in q.

    `flight` gives its speeds (6,), `quaternion` the order in which the peer has the scene's quaternions.
    """
    q, v = (np.zeros(size) for size in sizes)
    for slot in slots:
        match slot.freedom:
            case Scalar() as freedom:
                q[slot.q], v[slot.v] = scalar_start(freedom)
            case Ball() as freedom:
                q[slot.q : slot.q + 4] = quaternion(np.array(freedom.quaternion))
                v[slot.v : slot.v + 3] = freedom.angular_velocity
            case Floating() as freedom:
                q[slot.q : slot.q + 7] = [*freedom.position, *quaternion(np.array(freedom.quaternion))]
                v[slot.v : slot.v + 6] = flight(freedom)
            case _:
                assert_never(slot.freedom)
    return q, v


def quaternion_place(slot: Slot) -> slice:
    """Where in q a ball joint or free flight has its quaternion; ValueError for a scalar, which has none."""
    match slot.freedom:
        case Ball():
            return slice(slot.q, slot.q + 4)
        case Floating():
            return slice(slot.q + 3, slot.q + 7)
        case Scalar():
            raise ValueError(f'"{slot.link.joint}" has no quaternion')
        case _:
            assert_never(slot.freedom)


class TreeState(NamedTuple):
    """q (nq,) with unit quaternions, v (nv,), accelerations of the driven coordinates (d,)."""

    q: Real
    v: Real
    driven: Real


class Turning(NamedTuple):
    """A ball joint or free flight: where q has its quaternion, and y the one that is integrated."""

    slot: Slot
    in_q: slice
    in_y: slice


class FreeCoordinates(Generic[AnySlot]):
    """The state y = [free coordinates, free speeds, work] of a tree that SciPy steps.

    Quaternions are integrated as four numbers: qdot is linear in q, so the norm is an invariant of the exact flow, and
    everything else uses the normalised q. Driven coordinates follow their functions of time.
    """

    def __init__(self, slots: Sequence[AnySlot], nq: int, nv: int) -> None:
        self._nq, self._nv = nq, nv
        self.driven = [slot for slot in slots if slot.driven]
        self._motions = [profile(slot.freedom.prescribed) for slot in self.driven if isinstance(slot.freedom, Scalar)]
        driven_q, self._driven_v = [slot.q for slot in self.driven], [slot.v for slot in self.driven]
        free = np.setdiff1d(np.arange(nq), driven_q)
        self._count, self._driven_q, self._free_q = len(free), places(driven_q), places(free)
        self.driven_v, self.free_v = places(self._driven_v), places(np.setdiff1d(np.arange(nv), self._driven_v))
        single = scalars(slots)
        self.scalar_q, self.scalar_v = places([slot.q for slot in single]), places([slot.v for slot in single])
        turning = [(slot, quaternion_place(slot)) for slot in slots if not isinstance(slot.freedom, Scalar)]
        firsts = [int(np.searchsorted(free, place.start)) for _, place in turning]
        self.turning = [Turning(slot, place, slice(k, k + 4)) for (slot, place), k in zip(turning, firsts, strict=True)]
        self._none = np.zeros(0)
        self.plain = not self.driven and not turning

    def packed(self, q: Real, v: Real) -> Real:
        """y of a state, before any work was done."""
        return np.concatenate([q[self._free_q], v[self.free_v], [0.0]])

    def state(self, t: float, y: Real) -> TreeState:
        """The state of all coordinates."""
        if self.plain:
            return TreeState(y[: self._count], y[self._count : -1], self._none)
        q, v, driven = np.empty(self._nq), np.empty(self._nv), self._none
        q[self._free_q], v[self.free_v] = y[: self._count], y[self._count : -1]
        if self._motions:
            motion = np.array([motion(t) for motion in self._motions])
            q[self._driven_q], v[self.driven_v], driven = motion[:, 0], motion[:, 1], motion[:, 2]
        for _, place, _ in self.turning:
            quaternion = q[place]
            quaternion /= np.sqrt(quaternion @ quaternion)
        return TreeState(q, v, driven)

    def rate(self, qdot: Real, vdot: Real, power: float) -> Real:
        """dy/dt of rates (nq,) and (nv,) of all coordinates and speeds."""
        return np.concatenate([qdot[self._free_q], vdot[self.free_v], [power]])


class JointForces:
    """Generalised forces (nv,) of springs, of dampers and of motors; `quaternion` makes a peer's scalar first."""

    def __init__(
        self, slots: Sequence[Slot], nv: int, quaternion: Callable[[Real], Real] = as_it_is,
        signals: Signals | None = None,
    ) -> None:  # fmt: skip
        single = scalars(slots)
        sprung = [slot for slot in single if slot.freedom.stiffness]
        damped = [slot for slot in single if slot.freedom.damping]
        self._nv, self._quaternion = nv, quaternion
        self._spring_q, self._spring_v = places([slot.q for slot in sprung]), places([slot.v for slot in sprung])
        self._stiffness = np.array([slot.freedom.stiffness for slot in sprung])
        self._rest = np.array([slot.freedom.rest for slot in sprung])
        self._damper_v = places([slot.v for slot in damped])
        self._damping = np.array([slot.freedom.damping for slot in damped])
        self._motors = motors(slots, signals)
        self._balls = [
            slot
            for slot in slots
            if isinstance(slot.freedom, Ball) and (slot.freedom.stiffness or slot.freedom.damping)
        ]
        self.loses = bool(damped or self._motors or self._balls)  # else dampers and motors give nothing

    def springs(self, q: Real) -> Real:
        tau = np.zeros(self._nv)
        if len(self._stiffness):
            tau[self._spring_v] = -self._stiffness * (q[self._spring_q] - self._rest)
        for slot in self._balls:
            tau[slot.v : slot.v + 3] = -slot.freedom.stiffness * self._turn(slot, q)
        return tau

    def dampers_and_motors(self, t: float, v: Real) -> Real:
        tau = np.zeros(self._nv)
        tau[self._damper_v] = -self._damping * v[self._damper_v]
        for slot in self._balls:
            tau[slot.v : slot.v + 3] = -slot.freedom.damping * v[slot.v : slot.v + 3]
        for index, motor in self._motors:
            tau[index] += motor(t).value
        return tau

    def spring_energy(self, q: Real) -> float:
        energy = 0.5 * self._stiffness @ (q[self._spring_q] - self._rest) ** 2
        for slot in self._balls:
            turn = self._turn(slot, q)
            energy += 0.5 * slot.freedom.stiffness * (turn @ turn)
        return float(energy)

    def _turn(self, slot: Slot, q: Real) -> Real:
        return rotation_vector(self._quaternion(q[quaternion_place(slot)]))


@dataclass(frozen=True)
class PlacedCoupling:
    """A coupling on the slots of a tree: sum of factors times their coordinates = `offset`, the led one first, by 1.

    Its load f acts as the generalised forces factor times f along the coordinates.
    """

    name: str
    slots: tuple[Slot, ...]
    factors: tuple[float, ...]
    offset: float

    def row(self, speeds: int) -> Real:
        """(nv,) of the Jacobian."""
        jacobian = np.zeros(speeds)
        jacobian[[slot.v for slot in self.slots]] = self.factors
        return jacobian

    def load(self, size: float, axis: Real) -> Real:
        """[torque; force] (6,) of the load f along the axis of the coordinate that is led."""
        freedom, none = self.slots[0].freedom, np.zeros(3)
        if not isinstance(freedom, Scalar):
            raise TypeError(f'coupling "{self.name}" leads no scalar coordinate')
        along = size * axis
        match freedom.motion:
            case "turn" | "screw":
                return np.concatenate([along, none])
            case "slide":
                return np.concatenate([none, along])
            case _:
                assert_never(freedom.motion)


def placed_couplings(scene: Scene, slots: Sequence[Slot]) -> tuple[PlacedCoupling, ...]:
    """The couplings of a scene on the slots of its tree."""
    scalars: dict[str, list[Slot]] = {}
    for slot in slots:
        if isinstance(slot.freedom, Scalar):
            scalars.setdefault(slot.link.joint, []).append(slot)
    placed = []
    for coupling in scene.couplings:
        related = coupled(scene, coupling)
        own = tuple(scalars[member.hinge.name][member.place] for member in related)
        placed.append(PlacedCoupling(coupling.name, own, tuple(member.factor for member in related), coupling.offset))
    return tuple(placed)


def placed_loads(
    scene: Scene, links: tuple[Link, ...], signals: Signals | None = None
) -> list[tuple[int, PointLoad]]:
    """The loads at nodes, each with the number of its link, in whose axes they are."""
    at = [attachment(scene, links, load) for load in scene.loads]
    return [(there.link, PointLoad(load, there.frame, signals)) for there, load in zip(at, scene.loads, strict=True)]


class PointLoad:
    """A force or torque at a `point` (3,) of a body; `at` is the load's frame in the axes that the engine uses."""

    def __init__(self, load: Load, at: Frame, signals: Signals | None = None) -> None:
        self.point, self.is_force = at.position, load.type == "force"
        self.fixed_in_world = load.frame == "world"
        direction = np.array(load.direction, dtype=float)
        self._direction = direction if self.fixed_in_world else at.rotation @ direction
        self._size = profile(load.function, signals)

    def vector(self, t: float) -> Real:
        """The load (3,) in the axes in which it is fixed: those of World or of the body."""
        return self._size(t).value * self._direction

    def in_world(self, t: float, R: Real) -> Real:
        """The load (3,) in World axes, for the body's rotation R (3, 3)."""
        return self._size(t).value * (self._direction if self.fixed_in_world else R @ self._direction)

    def in_body(self, t: float, R: Real) -> Real:
        """The load (3,) in the axes of the body."""
        return self._size(t).value * (R.T @ self._direction if self.fixed_in_world else self._direction)


class TreeConnectors:
    """The connectors of a scene on a tree of links: `between` nodes, and along scalar coordinates."""

    def __init__(self, scene: Scene, links: tuple[Link, ...], slots: Sequence[Slot]) -> None:
        self.between = connections(scene, links)
        self.along_hinges = []
        for name, item, number, load in along_hinges(scene):
            own = [slot for slot in scalars(slots) if slot.link.joint == item]
            self.along_hinges.append((name, own[number], load))

    def __bool__(self) -> bool:
        return bool(self.between or self.along_hinges)

    def exerted(self, t: float, frame: Callable[[Attachment], Moving]) -> dict[str, Exerted]:
        """What each connector between nodes does; `frame` gives the motion of a frame on a link."""
        return {
            connector.name: connector.exerted(t, frame(connector.a), frame(connector.b)) for connector in self.between
        }

    def loads(self, exerted: dict[str, Exerted]) -> Iterable[tuple[Attachment, Real]]:
        """The frames on links on which they act, with [torque; force] (6,) about the frame in World axes."""
        for connector in self.between:
            for at, load in ((connector.a, exerted[connector.name].on_a), (connector.b, exerted[connector.name].on_b)):
                if at.link >= 0:
                    yield at, load

    def along(self, t: float, q: Real, v: Real) -> dict[str, tuple[int, Along]]:
        """For each connector along a hinge the speed that it acts on, and what it does."""
        return {name: (slot.v, load(t, float(q[slot.q]), float(v[slot.v]))) for name, slot, load in self.along_hinges}


def by_joint(slots: Iterable[Slot], loads: Iterable[float]) -> dict[str, Real]:
    """Loads of scalar freedoms by the name of their joint."""
    named: dict[str, list[float]] = {}
    for slot, load in zip(slots, loads, strict=True):
        named.setdefault(slot.link.joint, []).append(float(load))
    return {name: np.array(values) for name, values in named.items()}


def of_kind(kind: str, wrenches: dict[tuple[str, str], Real]) -> dict[str, Real]:
    """The wrenches of one kind of link, "body", "wheel" or "point mass", by the name of their joint."""
    return {name: wrench for (kind_of_wrench, name), wrench in wrenches.items() if kind_of_wrench == kind}


class ConnectorOutputs(NamedTuple):
    """Energy of all connectors (J), loads [torque; force] of those between nodes on B, and loads along hinges."""

    energy: float
    between: dict[str, Real]
    along: dict[str, Real]


def connector_outputs(exerted: dict[str, Exerted], along: dict[str, tuple[int, Along]]) -> ConnectorOutputs:
    """What a snapshot says of connectors."""
    stored = sum(exerted_by.energy for exerted_by in exerted.values()) + sum(each.energy for _, each in along.values())
    between = {name: on_both.on_b for name, on_both in exerted.items()}
    return ConnectorOutputs(
        stored, between, {name: np.array([along_hinge.load]) for name, (_, along_hinge) in along.items()}
    )
