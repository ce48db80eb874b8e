"""What the adapters of peers for rigid trees have in common: coordinates, forces, loads, connectors, drives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar, assert_never

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crosscheck.engines.connections import WORLD, Along, Exerted, Moving, along_hinges, connections
from crosscheck.engines.conventions import (
    Frame,
    cross,
    quaternion_rate,
    rotated,
    rotation_vector,
    scalar_first,
    scalar_last,
    shift_wrench,
)
from crosscheck.engines.functions_of_time import Profile, Signals, initial, profile
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


class Counting(NamedTuple):
    """How a peer counts ball joints and free flight: quaternions with the scalar first or last, of the speeds of free
    flight the linear or the angular ones first, the linear ones in outboard or in inboard axes."""

    scalar_first: bool = True
    linear_first: bool = False
    outboard: bool = True

    def of_scene(self, quaternion: ArrayLike) -> Real:
        """The quaternion of the scene as the peer has it."""
        return np.asarray(quaternion, dtype=float) if self.scalar_first else scalar_last(quaternion)

    def of_peer(self, quaternion: Real) -> Real:
        """The quaternion of the peer, scalar first."""
        return quaternion if self.scalar_first else scalar_first(quaternion)


AS_THE_SCENE = Counting()


def scalars(slots: Sequence[AnySlot]) -> list[AnySlot]:
    """Those of joints of one coordinate."""
    return [slot for slot in slots if isinstance(slot.freedom, Scalar)]


def motors(slots: Sequence[Slot], signals: Signals | None = None) -> list[tuple[int, Callable[[float], Profile]]]:
    """The place in `v` of every coordinate with a motor, and the load of that as a function of time."""
    moved = [slot for slot in scalars(slots) if slot.freedom.effort is not None]
    return [(slot.v, profile(slot.freedom.effort, signals)) for slot in moved]


def scene_start(slots: Sequence[Slot], sizes: tuple[int, int], counting: Counting) -> tuple[Real, Real]:
    """q and v, of these sizes, at t = 0; free flight has position and quaternion in q."""
    q, v = (np.zeros(size) for size in sizes)
    for slot in slots:
        match slot.freedom:
            case Scalar() as freedom:
                q[slot.q], v[slot.v] = initial(freedom)
            case Ball() as freedom:
                q[slot.q : slot.q + 4] = counting.of_scene(freedom.quaternion)
                v[slot.v : slot.v + 3] = freedom.angular_velocity
            case Floating() as freedom:
                q[slot.q : slot.q + 7] = [*freedom.position, *counting.of_scene(freedom.quaternion)]
                linear = freedom.velocity if counting.outboard else rotated(freedom.quaternion, freedom.velocity)
                halves = (linear, freedom.angular_velocity) if counting.linear_first else (
                    freedom.angular_velocity, linear
                )  # fmt: skip
                v[slot.v : slot.v + 6] = np.concatenate(halves)
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
    """A ball joint or free flight: where q has its quaternion and y the one that is integrated, and v its angular and
    its linear speeds, None at a ball."""

    slot: Slot
    in_q: slice
    in_y: slice
    angular: slice
    linear: slice | None


class FreeCoordinates(Generic[AnySlot]):
    """The state y = [free coordinates, free speeds, work] of a tree that SciPy steps.

    Quaternions are integrated as four numbers: qdot is linear in q, so the norm is an invariant of the exact flow, and
    everything else uses the normalised q. Driven coordinates follow their functions of time.
    """

    def __init__(self, slots: Sequence[AnySlot], nq: int, nv: int, counting: Counting = AS_THE_SCENE) -> None:
        self._nq, self._nv, self._counting, self._slots = nq, nv, counting, slots
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
        self.turning = [
            Turning(slot, place, slice(k, k + 4), *_speeds(slot, counting))
            for (slot, place), k in zip(turning, firsts, strict=True)
        ]
        self._none = np.zeros(0)
        self.plain = not self.driven and not turning

    def initial(self) -> Real:
        """y at t = 0."""
        return self.packed(*scene_start(self._slots, (self._nq, self._nv), self._counting))

    def packed(self, q: Real, v: Real) -> Real:
        """y of a state of all coordinates, before any work was done."""
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
        for each in self.turning:
            quaternion = q[each.in_q]
            quaternion /= np.sqrt(quaternion @ quaternion)
        return TreeState(q, v, driven)

    def rate(self, y: Real, state: TreeState, vdot: Real, power: float) -> Real:
        """dy/dt from the rates (nv,) of all speeds; those of quaternions depend on their values as integrated."""
        if self.plain:
            return np.concatenate([state.v, vdot, [power]])
        qdot, counting = np.empty(self._nq), self._counting
        qdot[self.scalar_q] = state.v[self.scalar_v]
        for slot, in_q, in_y, angular, linear in self.turning:
            own = counting.of_peer(y[in_y]).tolist()
            qdot[in_q] = counting.of_scene(quaternion_rate(own, state.v[angular].tolist()))
            if linear is not None:
                moving = state.v[linear]
                turned = rotated(counting.of_peer(state.q[in_q]), moving) if counting.outboard else moving
                qdot[slot.q : slot.q + 3] = turned
        return np.concatenate([qdot[self._free_q], vdot[self.free_v], [power]])


def _speeds(slot: Slot, counting: Counting) -> tuple[slice, slice | None]:
    """Where v has the angular and the linear speeds."""
    first, second = slice(slot.v, slot.v + 3), slice(slot.v + 3, slot.v + 6)
    if isinstance(slot.freedom, Ball):
        return first, None
    return (second, first) if counting.linear_first else (first, second)


class TreeEquations(Generic[AnySlot]):
    """Base of the equations of motion of peers that SciPy or the loop of events steps; `motion` is the peer's own."""

    coordinates: FreeCoordinates[AnySlot]

    @property
    def driven(self) -> list[AnySlot]:
        return self.coordinates.driven

    def motion(self, t: float, state: TreeState) -> tuple[Real, float]:
        """Rates (nv,) of the speeds that `FreeCoordinates` integrates, and the power (W) of all but springs and
        gravity."""
        raise NotImplementedError

    def initial(self) -> Real:
        return self.coordinates.initial()

    def packed(self, q: Real, v: Real) -> Real:
        return self.coordinates.packed(q, v)

    def state(self, t: float, y: Real) -> TreeState:
        return self.coordinates.state(t, y)

    def rate(self, t: float, y: Real) -> Real:
        """dy/dt."""
        state = self.state(t, y)
        return self.coordinates.rate(y, state, *self.motion(t, state))


class JointForces:
    """Generalised forces (nv,) of springs, of dampers and of motors."""

    def __init__(
        self, slots: Sequence[Slot], nv: int, counting: Counting = AS_THE_SCENE, signals: Signals | None = None
    ) -> None:
        single = scalars(slots)
        sprung = [slot for slot in single if slot.freedom.stiffness]
        damped = [slot for slot in single if slot.freedom.damping]
        self._nv, self._counting = nv, counting
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
        return rotation_vector(self._counting.of_peer(q[quaternion_place(slot)]))


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


LinkMotion = Callable[[int], Moving]
"""How the frame of a link, by its number, moves at a state."""


class TreeLoads:
    """What acts on a tree of links from outside its joints: loads at nodes, and connectors between nodes and along
    scalar coordinates."""

    def __init__(
        self, scene: Scene, links: tuple[Link, ...], slots: Sequence[Slot], signals: Signals | None = None
    ) -> None:
        places = [attachment(scene, links, load) for load in scene.loads]
        self.at_nodes = [
            (at.link, PointLoad(load, at.frame, signals)) for at, load in zip(places, scene.loads, strict=True)
        ]
        numbers = sorted({link for link, _ in self.at_nodes})
        self._by_link = [(number, [load for link, load in self.at_nodes if link == number]) for number in numbers]
        self.between, self.along_hinges = connections(scene, links), []
        for name, item, number, along in along_hinges(scene):
            own = [slot for slot in scalars(slots) if slot.link.joint == item]
            self.along_hinges.append((name, own[number], along))

    @property
    def on_links(self) -> bool:
        """Whether anything acts on links."""
        return bool(self.at_nodes or self.between)

    def exerted(self, t: float, motion: LinkMotion) -> dict[str, Exerted]:
        """What each connector between nodes does."""

        def frame(at: Attachment) -> Moving:
            return (WORLD if at.link < 0 else motion(at.link)).carrying(at.frame)

        return {
            connector.name: connector.exerted(t, frame(connector.a), frame(connector.b)) for connector in self.between
        }

    def wrenches(self, t: float, motion: LinkMotion) -> tuple[dict[int, Real], float]:
        """[torque; force] (6,) on links about the origins of their frames, World axes, and the power (W)."""
        total, power = dict[int, Real](), 0.0
        for link, loads in self._by_link:
            at = motion(link)
            turn, push = np.zeros(3), np.zeros(3)
            for load in loads:
                given = load.in_world(t, at.rotation)
                if load.is_force:
                    push += given
                    turn += cross(at.rotation @ load.point, given)
                else:
                    turn += given
            total[link] = np.concatenate([turn, push])
            power += float(turn @ at.angular + push @ at.linear)
        if not self.between:
            return total, power
        exerted = self.exerted(t, motion)
        for connector in self.between:
            both = exerted[connector.name]
            power += both.power
            for end, own in ((connector.a, both.on_a), (connector.b, both.on_b)):
                if end.link >= 0:
                    wrench = shift_wrench(own, motion(end.link).rotation @ end.frame.position)
                    total[end.link] = total[end.link] + wrench if end.link in total else wrench
        return total, power

    def along(self, t: float, q: Real, v: Real) -> dict[str, tuple[int, Along]]:
        """For each connector along a hinge the speed that it acts on, and what it does."""
        return {name: (slot.v, load(t, float(q[slot.q]), float(v[slot.v]))) for name, slot, load in self.along_hinges}


def by_joint(slots: Iterable[Slot], loads: Iterable[float]) -> dict[str, Real]:
    """Loads of scalar freedoms by the name of their joint."""
    named: dict[str, list[float]] = {}
    for slot, load in zip(slots, loads, strict=True):
        named.setdefault(slot.link.joint, []).append(float(load))
    return {name: np.array(values) for name, values in named.items()}
