"""A compiled scene: its arrays, its state vectors, and pointwise mechanics.

    system = compile(scene)
    state = system.initial_state
    acc = system.accelerations(state)

q holds, body by body (depth-first, point masses last), hinge coordinates, modal coordinates and wheel angles; u the
speeds in the same order. `system.coordinate(name)` and `system.speed(name)` give the places of a hinge, "<body>.hinge",
"<body>.modes", a wheel or a point mass.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from flexmb import coordinates, dynamics
from flexmb.arrays import Real, Workspace
from flexmb.assemble import assemble
from flexmb.frisch.errata import AS_PRINTED, CORRECTED
from flexmb.frisch.system import NestedSystem, Partitions
from flexmb.jain.elimination import ELIMINATIONS, Elimination, with_elimination
from flexmb.jain.operators import Operators, SpatialOperators
from flexmb.links import Link, links
from flexmb.mechanics import Mechanics
from flexmb.numbering import Numbering, wheels_by_body
from flexmb.scene import schema as s
from flexmb.scene.check import check_scene
from flexmb.state import State, pack
from flexmb.workspaces import workspace

Algorithm = Literal["articulated", "unsplit", "composite", "frisch", "frisch_as_printed"]
ERRATA = {"frisch": CORRECTED, "frisch_as_printed": AS_PRINTED}
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
        return Rotation.from_matrix(self.rotation).as_quat(scalar_first=True, canonical=True)


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


class System(Mechanics):
    """A checked scene turned into arrays; made by `compile`. It owns one workspace: threads must not share it."""

    def __init__(self, scene: s.Scene, elimination: Elimination = "fastest") -> None:
        super().__init__()
        self.scene = scene
        self._links = links(scene)
        self._wheels = wheels_by_body(scene)
        self._numbering = Numbering(self._links, self._wheels)
        self.constants, self._markers, self._closure_ports = assemble(scene, self._links, self._numbering)
        self.nq, self.nu = self._numbering.nq, self._numbering.nu
        self._marker_body = np.array([body for body, _ in self._markers.values()], dtype=np.int64)
        self._marker_port = np.array([port for _, port in self._markers.values()], dtype=np.int64)
        self._w = self.workspace()
        self.recursion_constants = with_elimination(self.constants, elimination)
        self._recursion_w = self.recursion_workspace()
        self._driven = self._driven_places()
        self.rhs, self.project = dynamics.rhs, coordinates.project
        self._nested: dict[str, NestedSystem] = {}
        self._operators: SpatialOperators | None = None

    @property
    def body_names(self) -> tuple[str, ...]:
        """Bodies in the order of the dynamics, point masses last."""
        return tuple(link.name for link in self._links)

    def coordinate(self, name: str) -> slice:
        """Place in q of a hinge, "<body>.hinge", "<body>.modes", wheel or point mass."""
        return _find(self._numbering.q, name)

    def speed(self, name: str) -> slice:
        """Place in u of a hinge, "<body>.hinge", "<body>.modes", wheel or point mass."""
        return _find(self._numbering.u, name)

    def state(self, q: Real, u: Real, t: float = 0.0) -> State:
        """State from q (nq,) and u (nu,); ValueError where lengths do not fit."""
        q, u = np.array(q, float), np.array(u, float)
        if q.shape != (self.nq,) or u.shape != (self.nu,):
            raise ValueError(f"this system has q of {self.nq} and u of {self.nu} entries, got {q.shape} and {u.shape}")
        return State(q, u, t)

    @property
    def initial_state(self) -> State:
        """The scene's state at t = 0; prescribed coordinates have their functions' values."""
        q, u = np.zeros(self.nq), np.zeros(self.nu)
        for link in self._links:
            _initial_hinge(link, q[self.coordinate(link.hinge.name)], u[self.speed(link.hinge.name)])
        for wheel in self.scene.wheels:
            q[self.coordinate(wheel.name)], u[self.speed(wheel.name)] = wheel.angle_rad, wheel.speed_rad_s
        for modal in self.scene.modal_states:
            name = f"{modal.body}.modes"
            if self.coordinate(name).stop > self.coordinate(name).start:
                q[self.coordinate(name)] = modal.coordinates
                u[self.speed(name)] = modal.rates or 0.0
        y = np.concatenate([q, u, [0.0]])
        self.project(0.0, y, self.constants)
        return State(y[: self.nq], y[self.nq : -1])

    def workspace(self) -> Workspace:
        """A fresh workspace for `rhs`; one per thread."""
        return workspace(self.constants, self.nq, self.nu)

    def recursion_workspace(self) -> Workspace:
        """A fresh workspace for `rhs` with `recursion_constants`, whose bodies are eliminated as chosen."""
        return workspace(self.recursion_constants, self.nq, self.nu)

    @property
    def elimination(self) -> dict[str, str]:
        """By flexible body, how the recursion eliminates its modes: "explicit", "woodbury" or "condensed"."""
        body = self.recursion_constants.body
        return {
            name: ELIMINATIONS[body["elimination"][k]] for k, name in enumerate(self.body_names) if body["modes"][k]
        }

    def nested(self, algorithm: Algorithm = "frisch") -> NestedSystem:
        """Frisch's equations of this scene, corrected or as printed, built at the first call.

        ValueError where the print does not apply: a body whose modes are not clamped at its hinge point.
        """
        if algorithm not in ERRATA:
            raise ValueError(f"algorithm must be one of {', '.join(ERRATA)}, not {algorithm!r}")
        if algorithm not in self._nested:
            self._nested[algorithm] = NestedSystem(self.constants, self._links, self.nq, ERRATA[algorithm])
        return self._nested[algorithm]

    def partitions(self, state: State, algorithm: Algorithm = "frisch") -> Partitions:
        """The partitioned equations of motion, Frisch (111), by the names of the paper."""
        return self.nested(algorithm).partitions(state.t, pack(state))

    def operators(self, state: State) -> Operators:
        """The spatial operators of Jain & Rodriguez, sections II to V, as dense arrays, World axes; all speeds free."""
        if self._operators is None:
            self._operators = SpatialOperators(self.scene)
        return self._operators.at(state.t, state.q, state.u)

    def accelerations(self, state: State, algorithm: Algorithm = "articulated") -> Real:
        """udot (nu,) of the free motion under all loads; prescribed speeds have their functions' rates.

        "articulated": the O(N) recursion; "unsplit": the same with modes and hinge of a body eliminated together;
        "composite": mass matrix by composite bodies, bias by inverse dynamics, Cholesky's factors, partitioned for
        prescribed speeds; "frisch": the nested-body equations of 1975, corrected, "frisch_as_printed": to the letter.
        Frisch's equations are of first order in the deformation: they take bodies of level `full` as `linear`.
        Raises DynamicsError where an inertia is not positive definite.
        """
        if algorithm not in get_args(Algorithm):
            raise ValueError(f"algorithm must be one of {', '.join(get_args(Algorithm))}, not {algorithm!r}")
        if algorithm in ERRATA:
            nested = self.nested(algorithm)
            status, rates = nested.accelerations(state.t, pack(state))
            self._check(status, nested.fault)
            self._trust(state, nested)
            return rates
        if algorithm == "composite":
            return self._composite(state.t, pack(state))[0]
        if algorithm == "unsplit":
            return self._unsplit(state.t, pack(state))[0]
        c, w = self.recursion_constants, self._recursion_w
        self._check(dynamics.accelerations(state.t, pack(state), c, w), int(w.fault[0]))
        self._trust(state, w)
        return w.speed["acceleration"].copy()

    def hinge_loads(self, state: State, accelerations: Real | None = None) -> dict[str, Real]:
        """Total load (6,) [torque; force] across each hinge on the outboard body about the outboard hinge point, World.

        Of the free motion; with `accelerations` (nu,) what hinges transmit if these are forced, Jain & Rodriguez (44).
        """
        if accelerations is None:
            return self.evaluate(state.t, state.q, state.u).loads
        return self._by_hinge(self._inverse(state, accelerations)[1])

    def _by_hinge(self, loads: Real) -> dict[str, Real]:
        return {link.hinge.name: loads[k] for k, link in enumerate(self._links)}

    def energy(self, state: State) -> dict[str, float]:
        """Kinetic, strain, spring and gravity energy (J)."""
        return self.evaluate(state.t, state.q, state.u).energy

    def momentum(self, state: State) -> Real:
        """(6,) [angular about the World origin; linear], World axes."""
        return self.evaluate(state.t, state.q, state.u).momentum

    def evaluate(self, t: float, q: Real, u: Real, algorithm: Algorithm = "articulated") -> Evaluation:
        """Everything observable at one state; DynamicsError where the accelerations do not exist.

        With "frisch" or "frisch_as_printed", accelerations, hinge loads, drive loads and wheel torques are those of
        these equations; a wheel's force follows from its acceleration (the paper counts its mass as the body's).
        """
        y = np.concatenate([q, u, [0.0]])
        if algorithm in ERRATA:
            return self._evaluate_nested(t, y, self.nested(algorithm))
        if algorithm in ("composite", "unsplit"):
            rates, drives = self._composite(t, y) if algorithm == "composite" else self._unsplit(t, y)
            loads = self._inverse(State(q, u, t), rates)[1]
            return self._evaluation(rates, drives, *self._observed(t, y, rates, loads))
        if algorithm != "articulated":
            raise ValueError(f"algorithm must be one of {', '.join(get_args(Algorithm))}, not {algorithm!r}")
        c, w = self.recursion_constants, self._recursion_w
        markers, wheel_loads, energy, momentum = self._outputs()
        loads = np.zeros((len(self._links), 6))
        status = dynamics.observe(
            t, y, self._marker_body, self._marker_port, c, w, markers, loads, wheel_loads, energy, momentum
        )
        self._check(status, int(w.fault[0]))
        self._trust(State(q, u, t), w)
        return self._evaluation(
            w.speed["acceleration"].copy(), w.speed["drive"], markers, loads, wheel_loads, energy, momentum
        )

    def _evaluate_nested(self, t: float, y: Real, nested: NestedSystem) -> Evaluation:
        status, motion = nested.motion(t, y)
        self._check(status, nested.fault)
        self._trust(self._unpacked(t, y), nested)
        rates = motion.accelerations
        markers, loads, wheel_loads, energy, momentum = self._observed(t, y, rates, motion.loads)
        wheel_loads[:, :3] = motion.wheel_torques
        return self._evaluation(rates, motion.drives, markers, loads, wheel_loads, energy, momentum)

    def _observed(self, t: float, y: Real, rates: Real, loads: Real) -> tuple[Real, Real, Real, Real, Real]:
        """Markers, the hinge loads given, wheel loads, energy and momentum of accelerations found elsewhere."""
        markers, wheel_loads, energy, momentum = self._outputs()
        dynamics.observe_motion(
            t, y, rates, self._marker_body, self._marker_port, self.constants, self._w,
            markers, wheel_loads, energy, momentum,
        )  # fmt: skip
        return markers, loads, wheel_loads, energy, momentum

    def _outputs(self) -> tuple[Real, Real, Real, Real]:
        """Markers, wheel loads, energy and momentum to be filled."""
        return np.zeros((len(self._markers), 24)), np.zeros((len(self.constants.wheel), 6)), np.zeros(4), np.zeros(6)

    def _evaluation(
        self, rates: Real, drive: Real, markers: Real, loads: Real, wheel_loads: Real, energy: Real, momentum: Real
    ) -> Evaluation:
        return Evaluation(
            accelerations=rates,
            markers={
                name: MarkerMotion(row[:3], row[3:12].reshape(3, 3), row[12:18], row[18:24])
                for name, row in zip(self._markers, markers, strict=True)
            },
            loads=self._by_hinge(loads),
            wheel_loads=dict(zip(self._wheel_names, wheel_loads, strict=True)),
            drives=self._drives(drive),
            energy=dict(zip(ENERGIES, energy.tolist(), strict=True)),
            momentum=momentum,
        )

    @property
    def _wheel_names(self) -> list[str]:
        return [wheel.name for link in self._links for wheel in self._wheels.get(link.name, ())]

    def _drives(self, drive: Real) -> dict[str, Real]:
        return {name: drive[places] for name, places in self._driven.items()}

    def _driven_places(self) -> dict[str, NDArray[np.intp]]:
        """Places in u of the prescribed coordinates, by hinge or wheel."""
        found = {}
        for name in [*(link.hinge.name for link in self._links), *self._wheel_names]:
            place = self.speed(name)
            driven = self.constants.speed["prescribed"][place] >= 0
            if np.any(driven):
                found[name] = place.start + np.flatnonzero(driven)
        return found


def compile(scene: s.Scene, elimination: Elimination = "fastest") -> System:  # noqa: A001  (used as flexmb.compile)
    """Check a scene and turn it into arrays.

    elimination: how the recursion eliminates the modes of each body, (63) of Jain & Rodriguez: "explicit" factorises
    D_f, "woodbury" is their (B3), corrected, "condensed" costs O(n_m); where one does not apply, D_f is factorised.
    All give the same accelerations; "fastest" chooses by body, and `System.elimination` says what was chosen.

    Raises SceneError for a scene that is wrong, NotImplementedError for one that is right but needs what is not
    supported yet (SID files).
    """
    check_scene(scene)
    return assembled(scene, elimination)


def assembled(scene: s.Scene, elimination: Elimination = "fastest") -> System:
    """The system of a scene that was checked before."""
    if scene.closures:
        from flexmb.closed_system import ClosedSystem  # a tree needs none of it

        return ClosedSystem(scene)
    return System(scene, elimination)


def _find(places: dict[str, slice], name: str) -> slice:
    if name not in places:
        raise KeyError(f"no coordinates of that name: {name!r}; there are {', '.join(sorted(places))}")
    return places[name]


def _initial_hinge(link: Link, q: Real, u: Real) -> None:
    """Initial coordinates and speeds of one hinge, in place."""
    match link.hinge:
        case s.Spherical(quaternion=quaternion, angular_velocity_rad_s=w):
            q[:], u[:] = quaternion, w
        case s.Free(position_m=p, quaternion=quaternion, angular_velocity_rad_s=w, velocity_m_s=v):
            q[:], u[:] = (*p, *quaternion), (*w, *v)
        case _:
            for n, (_, c) in enumerate(link.scalar):
                if isinstance(c, s.AngularCoordinate):
                    q[n], u[n] = c.angle_rad, c.rate_rad_s
                else:
                    q[n], u[n] = c.position_m, c.rate_m_s
