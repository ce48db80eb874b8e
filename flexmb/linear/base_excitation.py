"""Excitation of what a scene stands on: its linear model by the accelerations of the ground, modal participation.

The ground is replaced by a free body, so that its six accelerations a and the loads f that drive it are related by the
linear model. Solved for the loads, with no terms left out,

    f = G^-1 (a - A_b x - ...),    x' = A x + B_b f

with the rows A_b of the ground's accelerations and their derivatives G by f. What remains is the model, by a, of what
stands on it; a base that is shifted or moves steadily changes nothing, and its own motion leaves the states.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from msgspec.structs import replace
from scipy.linalg import eigh

from flexmb.kept import kept
from flexmb.linear.equations import built, equations_of
from flexmb.linear.linear_model import LinearModel
from flexmb.linear.linearize import linearize, seen_model
from flexmb.linear.observed import observed
from flexmb.scene.check import check_scene
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.control import LoadSensor, MarkerSensor
from flexmb.scene.functions import Constant
from flexmb.scene.hinges import Free
from flexmb.scene.open_loop import open_loop
from flexmb.scene.quaternions import cross_matrix
from flexmb.scene.schema import Load, RigidBody, Scene
from flexmb.scene.tree import GROUND
from flexmb.system.compile import compile
from flexmb.system.system import System
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.tables.state import State
from flexmb.typing import Index, Real

BASE = "base"
INPUTS = tuple((f"{BASE}.{axis}", "m/s^2") for axis in "xyz")
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
"""Motions of the base by which modes take part: shifts along and turns about the axes of World."""
_LOAD = tuple((f"torque.{axis}", "N m") for axis in "xyz") + tuple((f"force.{axis}", "N") for axis in "xyz")
_ACCELERATIONS = {"acceleration": "m/s^2", "angular_acceleration": "rad/s^2"}
ASYMMETRY = 1e-7
"""Of a stiffness and of gyroscopic terms, in the scale of the modes, below which they are rounding errors."""


@dataclass(frozen=True, eq=False)
class BaseExcitation:
    """A linear model of what stands on the ground, by the acceleration of the ground along the axes of World.

    model: inputs "base.x", "base.y", "base.z" (m/s^2), then those of `linearize`. Outputs: those of `linearize`, of
    which places, rotations and velocities are relative to the ground; then, absolute and in World axes, every marker's
    "<marker>.acceleration.x" and "<marker>.angular_acceleration.x"; "load:<hinge or closure>.torque.x" and ".force.x"
    as in `Evaluation.loads`, "connector:<name>.force.x" as in `Evaluation.connectors`, and "base.force.x",
    "base.torque.x" about the World origin: what holds all that stands on the ground. Changes, without what is there at
    rest.
    rigid (6,6): inertia of all of it about the World origin, taken as rigid; [rotation; translation], kg m^2, kg m, kg.
    coupling (n,6): mass matrix between the states' displacements and rotations and translations of the ground.
    """

    model: LinearModel
    rigid: Real
    coupling: Real

    __repr__ = brief

    @kept
    def modes(self) -> BaseModes:
        """The modes of the structure on a ground at rest, without damping, and how the ground takes part in them.

        NotImplementedError for a scene with controllers that have states; ValueError where the motion has no real
        modes: spins, and loads that follow the motion.
        """
        return _modes(self)


@dataclass(frozen=True, eq=False)
class BaseModes:
    """The real modes of a structure that stands on the ground, and how the ground takes part in them.

    frequencies_hz (m,) ascending; damping_ratios (m,) by the diagonal of the modal damping, NaN for motions without
    stiffness; shapes (n,m) with unit modal mass; factors (m,6): participation L = phi' M_base for a unit motion along
    `DIRECTIONS`, turns about the World origin; total (6,) kg and kg m^2 of all that stands on the ground.
    """

    frequencies_hz: Real
    damping_ratios: Real
    shapes: Real
    factors: Real
    total: Real

    __repr__ = brief

    @property
    def effective_masses(self) -> Real:
        """(m,6) kg for x, y, z, kg m^2 for rx, ry, rz: L^2 of each mode. Their sums over all modes are the `total`, but
        for what is fixed to the ground or driven."""
        return self.factors**2

    @property
    def shares(self) -> Real:
        """(m,6) effective masses over the total; 0 where there is none."""
        total = np.where(self.total > 0.0, self.total, 1.0)
        return np.where(self.total > 0.0, self.effective_masses / total, 0.0)

    def factors_about(self, point: Any) -> Real:
        """(m,6) participation with turns about a point (3,) m of World; ValueError or TypeError for no point."""
        arm = cross_matrix(arguments.finite("point", arguments.vector("point", point, 3)))
        shifts = self.factors[:, :3]
        return np.hstack([shifts, self.factors[:, 3:] + shifts @ arm])


def base_excitation(system: System | Scene, state: State | None = None, *, held: bool = False) -> BaseExcitation:
    """The linear model about a state (default: the initial one) by the acceleration of the ground, exactly.

    Everything that hangs on "ground" by hinges, closures and connectors is shaken with it; loads and gravity keep their
    directions in World. `state`, `held`, warnings and what is raised: as of `linearize`.
    """
    if not isinstance(system, System | Scene):
        raise TypeError(f"a System or a Scene is needed, not {type(system).__name__}")
    own = built(system)
    if state is None:
        state = own.initial_state
    own.layout.entering(state)
    if own.constraints:
        state = own.admissible(state, "state")
    mass = own.mass_properties(state).mass
    shaken, base = _shaken(own.scene, mass)
    check_scene(shaken)
    moved = compile(shaken)
    there = _there(own, moved, state)
    falling, _ = seen_model(moved, there, held)
    standing = compile(replace(shaken, loads=(*shaken.loads, *_holding(base, falling))))
    return _by_acceleration(own, standing, base, mass, linearize(standing, there, held=held), state)


def _shaken(scene: Scene, mass: float) -> tuple[Scene, str]:
    """The scene on a free body of that mass in place of the ground, and the name of the body and of its hinge."""
    names = {item.name for key in ("bodies", "hinges", "wheels", "point_masses", "closures", "couplings", "connectors")
             for item in getattr(scene, key)}  # fmt: skip
    base = BASE
    while base in names:
        base += "'"

    def on_base(item: Any, *keys: str) -> Any:
        return replace(item, **{key: base for key in keys if getattr(item, key) == GROUND})

    inertia = ((mass, 0.0, 0.0), (0.0, mass, 0.0), (0.0, 0.0, mass))
    sensors = [
        MarkerSensor(name=f"marker:{marker.name}.{quantity}", marker=marker.name, quantity=quantity)  # type: ignore[arg-type]
        for marker in scene.markers
        for quantity in _ACCELERATIONS
    ]
    loads = [LoadSensor(name=f"load:{item.name}", hinge=item.name) for item in (*scene.hinges, *scene.closures)]
    connectors = tuple(
        on_base(item, "body_a", "body_b") if isinstance(item, BetweenNodes) else item for item in scene.connectors
    )
    body, hinge = RigidBody(name=base, mass_kg=mass, inertia_kg_m2=inertia), Free(name=base, parent=GROUND, child=base)
    return replace(
        scene,
        bodies=(body, *scene.bodies),
        hinges=(hinge, *(on_base(item, "parent") for item in scene.hinges)),
        closures=tuple(on_base(item, "body_a", "body_b") for item in scene.closures),
        connectors=connectors,
        total_loads=(),  # of joints that are not on the ground any more
        sensors=(*scene.sensors, *sensors, *loads),
    ), base


def _there(own: System, moved: System, state: State) -> State:
    """The state of the scene on its free base, which rests at the World origin."""
    q, u = np.array(moved.initial_state.q), np.zeros(moved.nu)
    for name, place in own.layout.q.items():
        q[moved.coordinate(name)] = state.q[place]
        u[moved.speed(name)] = state.u[own.layout.u[name]]
    return moved.state(q, u, state.t)


def _holding(base: str, falling: LinearModel) -> list[Load]:
    """The loads that hold the base, from the accelerations that it has without them; stiffness by gravity is that of
    what hangs on a base that does not fall."""
    place, driven = _of_base(falling, base)
    G = falling.B[np.ix_(len(falling.rates) + place, driven)]
    loads = np.linalg.solve(G, -falling.rates[place])
    kinds: tuple[Literal["torque", "force"], ...] = ("torque", "force")
    return [
        Load(
            name=f"{base}:{kind}.{axis}", type=kind, body=base, node="origin", frame="world",
            direction=tuple(np.eye(3)[i].tolist()), function=Constant(value=float(loads[3 * j + i])),
        )
        for j, kind in enumerate(kinds) for i, axis in enumerate("xyz")
    ]  # fmt: skip


def _of_base(model: LinearModel, base: str) -> tuple[Index, Index]:
    """Where the displacements of the base are among the states, and its loads among the inputs: [rotation; position]"""
    own = (f"{base}.rotation", f"{base}.position")
    states, inputs = (
        np.array([i for i, (name, _) in enumerate(names) if name.rpartition(".")[0] in own], np.int64)
        for names in (model.states[: len(model.rates)], model.inputs)
    )
    return states, inputs


def _by_acceleration(
    own: System, moved: System, base: str, mass: float, full: LinearModel, state: State
) -> BaseExcitation:
    """The model of the scene on a free base, solved for the loads that give the base its accelerations."""
    n, there = len(full.rates), full.state
    of_base, driven = _of_base(full, base)
    rest = np.setdiff1d(np.arange(n), of_base)
    keep = np.concatenate([rest, n + rest, np.arange(2 * n, len(full.A))])
    others = np.setdiff1d(np.arange(len(full.inputs)), driven)
    rows = n + of_base
    G = full.B[np.ix_(rows, driven)]
    by_state, by_load = np.linalg.solve(G, full.A[rows]), np.linalg.solve(G, full.B[np.ix_(rows, others)])
    by_base = np.linalg.inv(G)[:, 3:]

    def solved(of_state: Real, of_load: Real) -> tuple[Real, Real]:
        """Rows by the kept states, and by accelerations of the base and loads, from rows by all states and loads."""
        push = of_load[:, driven]
        return (of_state - push @ by_state)[:, keep], np.hstack([push @ by_base, of_load[:, others] - push @ by_load])

    A, B = solved(full.A[keep], full.B[keep])
    outputs, C, D = _outputs(own, moved, there, full, base)
    C, D = solved(C, D)
    held_up = full.B[np.ix_(n + rest, driven)]
    rates, drift = (of[rest] - held_up @ np.linalg.solve(G, of[of_base]) for of in (full.rates, full.drift))
    reaction = np.hstack([by_base, -by_load])
    reaction[3:, :3] -= mass * np.eye(3)  # its own inertia
    M = full.mass
    rigid = M[np.ix_(of_base, of_base)] - mass * np.eye(6)
    model = LinearModel(
        scene=own.scene.name, state=state,
        states=tuple(full.states[i] for i in keep),
        inputs=(*INPUTS, *(full.inputs[i] for i in others)),
        outputs=(*outputs, *((f"{BASE}.{label}", unit) for label, unit in _LOAD)),
        A=A, B=B, C=np.vstack([C, -by_state[:, keep]]), D=np.vstack([D, reaction]),
        mass=M[np.ix_(rest, rest)], motion=_motion(own, moved, full.motion)[:, rest],
        rates=rates, drift=drift,
    )  # fmt: skip
    return BaseExcitation(model, rigid, M[np.ix_(rest, of_base)])


def _outputs(
    own: System, moved: System, there: State, full: LinearModel, base: str
) -> tuple[list[tuple[str, str]], Real, Real]:
    """Names and rows of all outputs but the motion of the base itself: those of `linearize`, accelerations, loads."""
    scene = own.scene
    added = 6 * len(scene.markers) + 6 * (len(scene.hinges) + len(scene.closures))
    said = len(full.outputs) - added
    of_base = [f"{base}.{part}" for part in ("rotation", "position", "angular_velocity", "velocity")]
    kept_rows = [i for i, (name, _) in enumerate(full.outputs[:said]) if name.rpartition(".")[0] not in of_base]
    names = [full.outputs[i] for i in kept_rows]
    names += [
        (f"{marker.name}.{quantity}.{axis}", unit)
        for marker in scene.markers for quantity, unit in _ACCELERATIONS.items() for axis in "xyz"
    ]  # fmt: skip
    names += [(f"load:{item.name}.{label}", unit) for item in (*scene.hinges, *scene.closures) for label, unit in _LOAD]
    rows = np.concatenate([kept_rows, np.arange(said, len(full.outputs))]).astype(int)
    C, D = full.C[rows], full.D[rows]
    between = [item.name for item in scene.connectors if isinstance(item, BetweenNodes)]
    if between:
        of_connectors = _of_connectors(moved, there, len(between))
        of_controllers = np.zeros((len(of_connectors), C.shape[1] - of_connectors.shape[1]))
        C = np.vstack([C, np.hstack([of_connectors, of_controllers])])
        D = np.vstack([D, np.zeros((len(of_connectors), D.shape[1]))])
        order = moved.observation.names.connectors
        names += [(f"connector:{name}.{label}", unit) for name in order for label, unit in _LOAD]
    return names, C, D


def _of_connectors(moved: System, there: State, count: int) -> Real:
    """(6 K, 2n) loads of connectors between nodes by [xi; du]; they do not depend on accelerations and drives."""
    equations = equations_of(moved if not moved.scene.controllers else compile(open_loop(moved.scene)))
    found = observed(equations, equations.variations(there))
    place, _ = moved.observation.columns["connectors"]
    assert place.stop - place.start == 6 * count
    return found.by_state[place]


def _motion(own: System, moved: System, motion: Real) -> Real:
    """Rows of the motion (nq,n) for the coordinates of the scene itself."""
    rows: Index = np.zeros(own.nq, np.int64)
    for name, place in own.layout.q.items():
        rows[place] = np.arange(moved.nq)[moved.coordinate(name)]
    return motion[rows]


def _modes(excitation: BaseExcitation) -> BaseModes:
    model = excitation.model
    n = len(model.rates)
    if len(model.A) > 2 * n:
        raise NotImplementedError(
            "the states of controllers have no mass: take base_excitation(flexmb.open_loop(scene)) for the modes"
        )
    M = model.mass
    K, damping = -M @ model.A[n:, :n], -M @ model.A[n:, n:]
    values, shapes = eigh(0.5 * (K + K.T), M)
    size = max(float(np.max(np.abs(values), initial=0.0)), np.finfo(float).tiny)
    skew = np.abs(shapes.T @ (K - K.T) @ shapes)
    turning = np.abs(shapes.T @ (damping - damping.T) @ shapes)
    if np.any(skew > ASYMMETRY * size) or np.any(turning > ASYMMETRY * np.sqrt(size)) or np.any(model.A[:n, :n]):
        raise ValueError(
            "the motion about this state has no real modes, because it turns or loads follow it: use the frequency "
            "responses and random responses of `model`, which need none"
        )
    omega = np.sqrt(np.where(values > n * np.finfo(float).eps * size, values, 0.0))
    modal = np.einsum("im,ij,jm->m", shapes, damping, shapes)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(omega > 0.0, modal / (2.0 * omega), np.nan)
    order = [3, 4, 5, 0, 1, 2]  # translations first
    return BaseModes(
        omega / (2.0 * np.pi), ratios, shapes, (shapes.T @ excitation.coupling)[:, order],
        np.diag(excitation.rigid)[order],
    )  # fmt: skip
