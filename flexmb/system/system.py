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
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from flexmb.building.assemble import assemble
from flexmb.building.links import links
from flexmb.building.numbering import Numbering, wheels_by_body
from flexmb.entry import articulated
from flexmb.frisch.errata import AS_PRINTED, CORRECTED
from flexmb.frisch.system import NestedSystem, Partitions
from flexmb.jain.elimination import ELIMINATIONS, Elimination, with_elimination
from flexmb.jain.operators import Operators, SpatialOperators
from flexmb.motion import coordinates
from flexmb.scene import schema as s
from flexmb.scene.check import check_scene
from flexmb.system.mechanics import Mechanics
from flexmb.tables.arrays import Workspace
from flexmb.tables.state import State, finite_result
from flexmb.tables.workspaces import workspace
from flexmb.typing import Real

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


class _Outputs(NamedTuple):
    """Arrays of an evaluation, parts of `every`: rates (nu,), markers (K,24), loads (N,6), wheel loads (W,6) ..."""

    rates: Real
    markers: Real
    loads: Real
    wheel_loads: Real
    energy: Real
    momentum: Real
    every: Real


class System(Mechanics):
    """A checked scene turned into arrays; made by `compile`. It owns one workspace: threads must not share it."""

    def __init__(self, scene: s.Scene, elimination: Elimination = "fastest") -> None:
        super().__init__()
        self.scene = scene
        self._links = links(scene)
        self._wheels = wheels_by_body(scene)
        self._numbering = Numbering(self._links, self._wheels)
        assembled = assemble(scene, self._links, self._numbering)
        self.constants, self._markers, self._closure_ports = assembled.constants, assembled.markers, assembled.closures
        self.layout = self._numbering.layout
        self.nq, self.nu = self.layout.nq, self.layout.nu
        self._marker_body = np.array([body for body, _ in self._markers.values()], dtype=np.int64)
        self._marker_port = np.array([port for _, port in self._markers.values()], dtype=np.int64)
        self._w = self.workspace()
        self.recursion_constants = with_elimination(self.constants, elimination)
        self._recursion_w = self.recursion_workspace()
        self._driven = self._driven_places()
        self.rhs, self.project = articulated.rhs, coordinates.project
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
        """State from q (nq,), u (nu,) and t (s), copies; quaternions need not have unit length, they are scaled.

        ValueError where lengths do not fit, numbers are not finite or a quaternion is zero, TypeError for what are no
        real numbers.
        """
        return self.layout.state(q, u, t)

    @property
    def initial_state(self) -> State:
        """The scene's state at t = 0; prescribed coordinates have their functions' values."""
        q, u = np.zeros(self.nq), np.zeros(self.nu)
        for link in self._links:
            name = link.hinge.name
            q[self.coordinate(name)], u[self.speed(name)] = link.kind.state(link.hinge)
        for wheel in self.scene.wheels:
            q[self.coordinate(wheel.name)], u[self.speed(wheel.name)] = wheel.angle_rad, wheel.speed_rad_s
        for modal in self.scene.modal_states:
            name = f"{modal.body}.modes"
            if self.coordinate(name).stop > self.coordinate(name).start:
                q[self.coordinate(name)] = modal.coordinates
                u[self.speed(name)] = modal.rates or 0.0
        y = np.concatenate([q, u, [0.0]])
        self.project(0.0, y, self.constants)
        return self.layout.known(0.0, y)

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
            self._nested[algorithm] = NestedSystem(self.constants, self._links, self.layout, ERRATA[algorithm])
        return self._nested[algorithm]

    def partitions(self, state: State, algorithm: Algorithm = "frisch") -> Partitions:
        """The partitioned equations of motion, Frisch (111), by the names of the paper."""
        t, y = self.layout.entering(state)
        return self.nested(algorithm).partitions(t, y)

    def operators(self, state: State) -> Operators:
        """The spatial operators of Jain & Rodriguez, sections II to V, as dense arrays, World axes; all speeds free."""
        t, _ = self.layout.entering(state)
        if self._operators is None:
            self._operators = SpatialOperators(self.scene)
        found = self._operators.at(t, state.q, state.u)
        for part in (found.M_m, found.a_m, found.b_m, found.V_m):
            finite_result(part, t)
        return found

    def accelerations(self, state: State, algorithm: Algorithm = "articulated") -> Real:
        """udot (nu,) of the free motion under all loads; prescribed speeds have their functions' rates.

        "articulated": the O(N) recursion; "unsplit": the same with modes and hinge of a body eliminated together;
        "composite": mass matrix by composite bodies, bias by inverse dynamics, Cholesky's factors, partitioned for
        prescribed speeds; "frisch": the nested-body equations of 1975, corrected, "frisch_as_printed": to the letter.
        Frisch's equations are of first order in the deformation: they take bodies of level `full` as `linear`.
        Raises DynamicsError where an inertia is not positive definite, or numbers are so large that they overflow.
        """
        t, y = self.layout.entering(state)
        return finite_result(self._accelerations(t, y, algorithm), t)

    def _accelerations(self, t: float, y: Real, algorithm: Algorithm) -> Real:
        if algorithm == "articulated":
            c, w = self.recursion_constants, self._recursion_w
            self._check(articulated.accelerations(t, y, c, w), int(w.fault[0]))
            self._trust(t, y, w)
            return w.speed["acceleration"].copy()
        if algorithm in ERRATA:
            nested = self.nested(algorithm)
            status, rates = nested.accelerations(t, y)
            self._check(status, nested.fault)
            self._trust(t, y, nested)
            return rates
        if algorithm == "composite":
            return self._composite(t, y)[0]
        if algorithm == "unsplit":
            return self._unsplit(t, y)[0]
        raise ValueError(f"algorithm must be one of {', '.join(get_args(Algorithm))}, not {algorithm!r}")

    def hinge_loads(self, state: State, accelerations: Real | None = None) -> dict[str, Real]:
        """Total load (6,) [torque; force] across each hinge on the outboard body about the outboard hinge point, World.

        Of the free motion; with `accelerations` (nu,) what hinges transmit if these are forced, Jain & Rodriguez (44).
        """
        t, y = self.layout.entering(state)
        if accelerations is None:
            return self._evaluate(t, y, "articulated").loads
        rates = self.layout.rates("accelerations", accelerations)
        return self._by_hinge(finite_result(self._inverse(t, y, rates)[1], t))

    def _by_hinge(self, loads: Real) -> dict[str, Real]:
        return {link.hinge.name: loads[k] for k, link in enumerate(self._links)}

    def energy(self, state: State) -> dict[str, float]:
        """Kinetic, strain, spring and gravity energy (J)."""
        return self._evaluate(*self.layout.entering(state), "articulated").energy

    def momentum(self, state: State) -> Real:
        """(6,) [angular about the World origin; linear], World axes."""
        return self._evaluate(*self.layout.entering(state), "articulated").momentum

    def evaluate(self, t: float, q: Real, u: Real, algorithm: Algorithm = "articulated") -> Evaluation:
        """Everything observable at time t (s) of q (nq,) and u (nu,).

        Quaternions need not have unit length, they are scaled; prescribed coordinates and speeds are taken from their
        functions. ValueError or TypeError for arrays that do not fit, as of `state`; DynamicsError where the
        accelerations do not exist, or numbers are so large that they overflow.
        With "frisch" or "frisch_as_printed", accelerations, hinge loads, drive loads and wheel torques are those of
        these equations; a wheel's force follows from its acceleration (the paper counts its mass as the body's).
        """
        return self._evaluate(*self.layout.packed(t, q, u), algorithm)

    def _evaluate(self, t: float, y: Real, algorithm: Algorithm) -> Evaluation:
        out = self._outputs()
        if algorithm == "articulated":
            c, w = self.recursion_constants, self._recursion_w
            status = articulated.observe(
                t, y, self._marker_body, self._marker_port, c, w,
                out.markers, out.loads, out.wheel_loads, out.energy, out.momentum,
            )  # fmt: skip
            self._check(status, int(w.fault[0]))
            self._trust(t, y, w)
            out.rates[:] = w.speed["acceleration"]
            return self._evaluation(t, w.speed["drive"], out)
        if algorithm in ERRATA:
            nested = self.nested(algorithm)
            status, motion = nested.motion(t, y)
            self._check(status, nested.fault)
            self._trust(t, y, nested)
            out.loads[:] = motion.loads
            self._observe_motion(t, y, motion.accelerations, out)
            out.wheel_loads[:, :3] = motion.wheel_torques
            return self._evaluation(t, motion.drives, out)
        if algorithm not in ("composite", "unsplit"):
            raise ValueError(f"algorithm must be one of {', '.join(get_args(Algorithm))}, not {algorithm!r}")
        rates, drives = self._composite(t, y) if algorithm == "composite" else self._unsplit(t, y)
        out.loads[:] = self._inverse(t, y, rates)[1]
        self._observe_motion(t, y, rates, out)
        return self._evaluation(t, drives, out)

    def _observe_motion(self, t: float, y: Real, rates: Real, out: _Outputs) -> None:
        """Markers, wheel loads, energy and momentum of accelerations found elsewhere."""
        out.rates[:] = rates
        articulated.observe_motion(
            t, y, rates, self._marker_body, self._marker_port, self.constants, self._w,
            out.markers, out.wheel_loads, out.energy, out.momentum,
        )  # fmt: skip

    def _outputs(self) -> _Outputs:
        """To be filled."""
        markers, loads, wheels = len(self._markers), len(self._links), len(self.constants.wheel)
        a = self.nu + 24 * markers
        b, c = a + 6 * loads, a + 6 * loads + 6 * wheels
        every = np.zeros(c + 10)
        return _Outputs(
            every[: self.nu], every[self.nu : a].reshape(markers, 24), every[a:b].reshape(loads, 6),
            every[b:c].reshape(wheels, 6), every[c : c + 4], every[c + 4 :], every,
        )  # fmt: skip

    def _evaluation(self, t: float, drive: Real, out: _Outputs) -> Evaluation:
        finite_result(out.every, t)
        return Evaluation(
            accelerations=out.rates,
            markers={
                name: MarkerMotion(row[:3], row[3:12].reshape(3, 3), row[12:18], row[18:24])
                for name, row in zip(self._markers, out.markers, strict=True)
            },
            loads=self._by_hinge(out.loads),
            wheel_loads=dict(zip(self._wheel_names, out.wheel_loads, strict=True)),
            drives=self._drives(drive),
            energy=dict(zip(ENERGIES, out.energy.tolist(), strict=True)),
            momentum=out.momentum,
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
    All give the same accelerations; "fastest" chooses by body, and `System.elimination` says what was chosen. Scenes
    with closures factorise D_f whatever is asked for.

    Raises SceneError for a scene that is wrong, ValueError for an elimination that does not exist, NotImplementedError
    for a scene that is right but needs what is not supported yet (SID files).
    """
    check_scene(scene)
    return assembled(scene, elimination)


def assembled(scene: s.Scene, elimination: Elimination = "fastest") -> System:
    """The system of a scene that was checked before."""
    if elimination not in get_args(Elimination):
        raise ValueError(f"elimination is {elimination!r}: use one of {', '.join(map(repr, get_args(Elimination)))}")
    if scene.closures:
        from flexmb.system.closed import ClosedSystem  # a tree needs none of it

        return ClosedSystem(scene)
    return System(scene, elimination)


def _find(places: dict[str, slice], name: str) -> slice:
    if name not in places:
        raise KeyError(f"no coordinates of that name: {name!r}; there are {', '.join(sorted(places))}")
    return places[name]
