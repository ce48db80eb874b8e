"""The motors and the loads at nodes that make a motion exact, as tables of a scene.

Every scalar coordinate that follows a sine has its own motor. Ball joints, free bodies and modes have none: three,
six, or as many components of forces and moments at nodes of the body as it has such speeds, in the axes of the node,
are chosen by a pivoted QR factorisation of what the nodes offer. At one time

    M udot + c - tau = B f + J' lambda,     lambda of closures and couplings,

has as many unknowns as rows, unless rows are redundant. f is taken at equal times and written as a table, of which
every reader makes the same spline of degree 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from msgspec import structs
from scipy.linalg import qr

import flexmb as fm
from crosscheck.library.case_error import CaseError
from crosscheck.manufacture.motion import DrawnMotion, DrawnState, draw
from flexmb.dense import DenseSystem
from flexmb.dense.body_frames import Motions
from flexmb.dense.closures import rows
from flexmb.dense.members import ScalarSpeed
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.integrate.integrator import Method
from flexmb.kept import kept
from flexmb.run.simulate import RunSettings
from flexmb.scene.bodies import BeamBody
from flexmb.scene.connectors import AngularSpring, LinearSpring, SpringDamper, actuator
from flexmb.scene.functions import Constant, ControlSignal, Function, Table
from flexmb.scene.schema import Load, ModalState, Scene, Wheel
from flexmb.scene.tree import coordinates, with_coordinates
from flexmb.typing import Real

MARGIN = 16
"""Intervals of tables before and after the run: the error at the free ends of a spline halves in each of them."""
LEAST = 1e-5
"""Least pivot, over the largest, of nodes' loads on the speeds that they drive."""
EXACT = 1e-12
"""What tables may leave out of a load, over the largest one: more and more intervals are taken until then, or until
twice as many gain no factor of four."""
INTERVALS = (64, 256)
CHECKED = 8
"""Times at which the scene as written is held against the motion."""
SMOOTH = 1e-8
"""What tables may leave out at most: beyond, the motion or a force is not smooth."""


@dataclass(frozen=True)
class Manufactured:
    """A scene whose loads make `motion` exact from 0 to `duration_s`.

    `defect` (T,nu): generalised forces that the tables leave out at `between` (T,), the middle of all their intervals
    of `interval_s`, by interpolation. `rounding` (nu,): how much else the scene as written leaves of the equations.
    """

    scene: Scene
    motion: DrawnMotion
    duration_s: float
    interval_s: float
    between: Real
    defect: Real
    rounding: Real

    @kept
    def dense(self) -> DenseSystem:
        """The scene as written, by the dense route."""
        return DenseSystem(self.scene)


def manufacture(scene: Scene, seed: int, duration_s: float = 1.0, amplitude: float = 0.3) -> Manufactured:
    """The scene with another motion, drawn by `seed`, and the loads that it needs; its own motors are replaced.

    CaseError names what a motion cannot be manufactured for, with the remedy.
    """
    _refuse(scene)
    bare = without_motors(scene)
    dense = DenseSystem(bare)
    motion = draw(bare, dense, seed, duration_s, amplitude)
    _refuse_singular(dense, motion, duration_s)
    drives = MotionLoads(bare, motion)
    intervals = INTERVALS[0]
    while (left := drives.left(duration_s, intervals)) > EXACT and intervals < INTERVALS[1]:
        if drives.left(duration_s, 2 * intervals) > 0.25 * left:
            break
        intervals *= 2
    if not left <= SMOOTH:
        raise CaseError(
            f"the loads of this motion are not smooth enough for tables ({left:.1e} of their size is left): take a "
            "smaller --amplitude, so that no stop, no slack cable and no half turn of a sprung ball joint is passed, "
            "or another --seed"
        )
    return drives.manufactured(duration_s, intervals)


class MotionLoads:
    """The loads of a motion of a scene without motors."""

    def __init__(self, bare: Scene, motion: DrawnMotion) -> None:
        self._motion = motion
        dense = DenseSystem(bare)
        self._motors = [x for x in dense.tree.scalars if motion.independent[x.u] and x.prescribed is None]
        self._held = [x for x in dense.tree.scalars if x.prescribed is not None]
        chosen = self._chosen(bare, dense)
        self._scene = structs.replace(bare, loads=(*bare.loads, *chosen))
        self._own, self._dense = len(bare.loads), DenseSystem(self._scene)
        self._forces: dict[float, Real] = {}

    def left(self, duration_s: float, intervals: int) -> float:
        """The largest error of a load by tables of so many intervals, over the largest load of its kind."""
        forces = np.array([self._at(t) for t in _knots(duration_s, intervals)])
        if not forces.size:
            return 0.0
        error = np.max(np.abs(self._errors(duration_s, intervals)), axis=0)
        return float(np.max(error / max(np.max(np.abs(forces)), 1e-300)))

    def manufactured(self, duration_s: float, intervals: int) -> Manufactured:
        """The scene with tables of so many intervals."""
        times = _knots(duration_s, intervals)
        forces = np.array([self._at(t) for t in times]).T
        tables = [Table(times_s=times, values=tuple(values.tolist())) for values in forces]
        motors = {x.u: table for x, table in zip(self._motors, tables, strict=False)}
        loads = tuple(
            structs.replace(load, function=table)
            for load, table in zip(self._scene.loads[self._own :], tables[len(self._motors) :], strict=True)
        )
        scene = structs.replace(self._scene, loads=(*self._scene.loads[: self._own], *loads))
        scene = _with_state(_with_motors(scene, self._dense.tree.scalars, motors), self._dense, self._motion.at(0.0))
        written, between = DenseSystem(scene), _between(duration_s, intervals)
        errors = self._errors(duration_s, intervals)
        pairs = zip(between, errors, strict=True)
        defect = np.array([self._columns(self._motion.at(t).q) @ error for t, error in pairs])
        rounding = np.zeros(written.nu)
        for i in range(0, intervals, intervals // CHECKED):
            state = self._motion.at(between[i])
            left = _left(written, written.needed(between[i], *state), state, self._held)
            rounding = np.maximum(rounding, np.abs(left - _left(written, defect[i], state, self._held)))
        h = duration_s / intervals
        return Manufactured(scene, self._motion, duration_s, h, np.array(between), defect, rounding)

    def _errors(self, duration_s: float, intervals: int) -> Real:
        """(T,n) loads less their tables in the middle of all intervals."""
        from scipy.interpolate import make_interp_spline  # takes 0.2 s to import

        times, between = _knots(duration_s, intervals), _between(duration_s, intervals)
        exact = np.array([self._at(t) for t in between])
        return np.asarray(exact - make_interp_spline(times, np.array([self._at(t) for t in times]), k=5)(between))

    def _columns(self, q: Real) -> Real:
        """B (nu,n): motors, then loads at nodes."""
        columns = np.zeros((self._dense.nu, len(self._motors)))
        columns[[x.u for x in self._motors], range(len(self._motors))] = 1.0
        return np.concatenate([columns, self._dense.load_columns(q)[:, self._own :]], axis=1)

    def _at(self, t: float) -> Real:
        """The loads (motors, then those at nodes) at one time."""
        if t not in self._forces:
            state = self._motion.at(t)
            needed = self._dense.needed(t, *state)
            B = self._columns(state.q)
            unknown = _unknown(self._dense, B, state.q, self._held)
            self._forces[t] = _solve(unknown, needed)[: B.shape[1]]
        return self._forces[t]

    def _chosen(self, bare: Scene, dense: DenseSystem) -> list[Load]:
        """Loads at nodes for the speeds that have no motor."""
        scalar = np.zeros(dense.nu, dtype=bool)
        scalar[[x.u for x in dense.tree.scalars]] = True
        driven = self._motion.independent & ~scalar
        offered, members = [], []
        for k, member in enumerate(dense.tree.members):
            if np.any(driven[member.u_hinge]) or np.any(driven[member.u_modes]):
                for name in member.model.nodes:
                    for kind in ("force", "torque"):
                        for i, axis in enumerate("xyz"):
                            offered.append(Load(
                                name=f"drive {member.name} {name} {kind} {axis}", body=member.name, node=name,
                                type="force" if kind == "force" else "torque", frame="node",
                                direction=tuple(np.eye(3)[i].tolist()), function=Constant(value=0.0),
                            ))  # fmt: skip
                            members.append(k)
        if not offered:
            return []
        trial = DenseSystem(structs.replace(bare, loads=tuple(offered)))
        q = self._motion.at(0.0).q
        columns = trial.load_columns(q)[driven]
        columns = columns / np.maximum(np.max(np.abs(columns), axis=1, keepdims=True), 1e-300)
        # Columns are not normalised: what moves most for 1 N or 1 Nm comes first, so that loads stay small.
        _, R, order = qr(columns, mode="economic", pivoting=True)
        count = int(np.count_nonzero(driven))
        pivots = np.abs(np.diag(R))
        if len(pivots) < count or pivots[count - 1] < LEAST * pivots[0]:
            reached = int(np.count_nonzero(pivots >= LEAST * pivots[0]))
            flexible = ", ".join(f'"{member.name}"' for member in dense.tree.members if np.any(driven[member.u_modes]))
            raise CaseError(
                f"loads at the nodes of {flexible or 'its bodies'} drive {reached} of {count} coordinates of ball "
                "joints, free bodies and modes: give flexible bodies more nodes, or fewer modes"
            )
        return [offered[i] for i in sorted(order[:count])]


def _knots(duration_s: float, intervals: int) -> tuple[float, ...]:
    return tuple((duration_s * np.arange(-MARGIN, intervals + MARGIN + 1) / intervals).tolist())


def _between(duration_s: float, intervals: int) -> tuple[float, ...]:
    """The middle of every interval of the run: the knots of twice as many that these have not."""
    return tuple((duration_s * np.arange(1, 2 * intervals, 2) / (2 * intervals)).tolist())


def _unknown(dense: DenseSystem, B: Real, q: Real, held: list[ScalarSpeed]) -> Real:
    """(nu,n): generalised forces of unit loads, of closures and couplings, and of unit drives of held coordinates."""
    drives = np.zeros((dense.nu, len(held)))
    drives[[x.u for x in held], range(len(held))] = 1.0
    return np.concatenate([B, constraint_rows(dense, q).T, drives], axis=1)


def _solve(unknown: Real, needed: Real) -> Real:
    if unknown.shape[0] == unknown.shape[1]:
        try:
            return np.asarray(np.linalg.solve(unknown, needed), dtype=float)
        except np.linalg.LinAlgError:
            pass  # redundant closures
    return np.asarray(np.linalg.lstsq(unknown, needed, rcond=1e-12)[0], dtype=float)


def constraint_rows(dense: DenseSystem, q: Real) -> Real:
    """J (G,nu) of closures and couplings."""
    unit = Motions(q, np.eye(dense.nu), np.zeros((dense.nu, dense.nu)))
    found = [rows(dense, constraint, unit)[1].T for constraint in dense.scene.constraints]
    return np.concatenate([*found, np.zeros((0, dense.nu))])


def constraint_loads(dense: DenseSystem, needed: Real, q: Real, held: list[ScalarSpeed]) -> Real:
    """lambda (G,), and the drives of held coordinates, that come nearest to what a motion needs; the least ones."""
    unknown = _unknown(dense, np.zeros((dense.nu, 0)), q, held)
    if not unknown.shape[1]:
        return np.zeros(0)
    return np.asarray(np.linalg.lstsq(unknown, needed, rcond=1e-10)[0], dtype=float)


def _left(dense: DenseSystem, needed: Real, state: DrawnState, held: list[ScalarSpeed]) -> Real:
    """What is left of the equations (nu,) by the best loads of constraints and drives."""
    unknown = _unknown(dense, np.zeros((dense.nu, 0)), state.q, held)
    return needed - unknown @ constraint_loads(dense, needed, state.q, held)


def _refuse(scene: Scene) -> None:
    """CaseError for what no smooth motion with given loads has."""
    if scene.controllers or scene.events:
        what = "controllers" if scene.controllers else "events"
        raise CaseError(f"a motion is manufactured for a scene without {what}: take them out")
    for name, function in _functions(scene):
        if isinstance(function, ControlSignal):
            raise CaseError(f'"{name}" is led by a controller: give it a function of time, or take it out')


def _refuse_singular(dense: DenseSystem, motion: DrawnMotion, duration_s: float) -> None:
    """CaseError for a motion of a tree through a position without a mass matrix, as of a gimbal at its singular angle.

    Its loads exist, but accelerations do not follow from them. The root of the least eigenvalue of the mass matrix,
    with its diagonal scaled to 1, falls to zero there in proportion to time. So the motion passes one where this root
    changes by more from one time to the next than what is left of it.
    """
    if dense.scene.constraints:
        return  # what closures leave free may have a mass where a coordinate alone has none
    free = np.ones(dense.nu, dtype=bool)
    free[[x.u for x in dense.tree.scalars if x.prescribed is not None]] = False
    if not np.any(free):
        return
    times = np.linspace(0.0, duration_s, INTERVALS[0] + 1)
    roots = np.empty(len(times))
    for i, t in enumerate(times.tolist()):
        M = dense.mass_matrix(motion.at(t).q)[np.ix_(free, free)]
        scale = 1.0 / np.sqrt(np.maximum(np.diag(M), 1e-300))
        roots[i] = np.sqrt(max(float(np.linalg.eigvalsh(M * scale * scale[:, None])[0]), 0.0))
    nearest = int(np.argmin(roots))
    if roots[nearest] < np.max(np.abs(np.diff(roots[max(nearest - 1, 0) : nearest + 2]))):
        raise CaseError(
            f"near t = {times[nearest]:.3g} s this motion passes a position in which a freedom has no mass, as a "
            "gimbal at its singular angle: take a smaller --amplitude, or another --seed"
        )


def _functions(scene: Scene) -> list[tuple[str, Function]]:
    found = [(load.name, load.function) for load in scene.loads]
    springs = [c for c in scene.connectors if isinstance(c, SpringDamper | AngularSpring | LinearSpring)]
    return found + [(c.name, push) for c in springs if (push := actuator(c)) is not None]


def without_motors(scene: Scene) -> Scene:
    """The scene with neither motors nor cuts that loads at nodes would add to beams of level exact."""
    bodies = tuple(
        structs.replace(body, modes=structs.replace(body.modes, cuts=tuple([*body.modes.cuts])))
        if isinstance(body, BeamBody) and body.level == "exact" and body.modes.cuts is not None else body
        for body in scene.bodies
    )  # fmt: skip
    scene = structs.replace(scene, bodies=bodies, allow=tuple(dict.fromkeys((*scene.allow, "uncut_beam"))))
    return _with_motors(scene, DenseSystem(scene).tree.scalars, {})


def _with_motors(scene: Scene, scalars: list[ScalarSpeed], motors: dict[int, Table]) -> Scene:
    """The scene with these motors, by their speeds, and no others."""
    places: dict[str, list[int]] = {}
    for x in scalars:
        places.setdefault(x.owner, []).append(x.u)

    def moved(item: Any) -> Any:
        if isinstance(item, Wheel):
            return structs.replace(item, torque_Nm=motors.get(places[item.name][0]))
        given = zip(places.get(item.name, []), coordinates(item), strict=True)
        return with_coordinates(
            item, [structs.replace(c, **{c.KEYS.effort: motors.get(u)}) for u, (_, c) in given]
        )

    return structs.replace(
        scene, hinges=tuple(map(moved, scene.hinges)), point_masses=tuple(map(moved, scene.point_masses)),
        wheels=tuple(map(moved, scene.wheels)),
    )  # fmt: skip


def _with_state(scene: Scene, dense: DenseSystem, state: DrawnState) -> Scene:
    """The scene with the initial coordinates and speeds of a state."""
    tree = dense.tree
    scalars: dict[str, list[ScalarSpeed]] = {}
    for x in tree.scalars:
        scalars.setdefault(x.owner, []).append(x)
    members = {member.hinge.name: member for member in tree.members}

    def begun(item: Any) -> Any:
        if isinstance(item, Wheel):
            (x,) = scalars[item.name]
            motion = {} if x.prescribed else {"angle_rad": float(state.q[x.q]), "speed_rad_s": float(state.u[x.u])}
            return structs.replace(item, **motion)
        given = [
            c if x.prescribed else structs.replace(
                c, **{c.KEYS.value: float(state.q[x.q]), c.KEYS.rate: float(state.u[x.u])}
            )
            for x, (_, c) in zip(scalars.get(item.name, []), coordinates(item), strict=True)
        ]  # fmt: skip
        item = with_coordinates(item, given)
        member = members[item.name]
        q, u = (tuple(map(float, part)) for part in (state.q[member.q_hinge], state.u[member.u_hinge]))
        if item.__struct_config__.tag == "spherical":
            return structs.replace(item, quaternion=q, angular_velocity_rad_s=u)
        if item.__struct_config__.tag == "free":
            return structs.replace(
                item, position_m=q[:3], quaternion=q[3:], angular_velocity_rad_s=u[:3], velocity_m_s=u[3:]
            )
        return item

    modes = tuple(
        ModalState(
            body=member.name, coordinates=tuple(map(float, state.q[member.q_modes])),
            rates=tuple(map(float, state.u[member.u_modes])),
        )
        for member in tree.members if member.q_modes.stop > member.q_modes.start
    )  # fmt: skip
    return structs.replace(
        scene, hinges=tuple(map(begun, scene.hinges)), point_masses=tuple(map(begun, scene.point_masses)),
        wheels=tuple(map(begun, scene.wheels)), modal_states=modes,
    )  # fmt: skip


# Observed orders of convergence of the library's integrators on a manufactured motion, beside those of theory. The
# error is that of the coordinates at the end of the run, against the prescribed ones. Methods of equal steps halve the
# step, those that adapt it take tighter tolerances; the order is the slope of the error against the number of steps.

THEORY: dict[Method, str] = {
    "rk4": "4", "generalised_alpha": "2", "dop853": "8", "radau5": "5", "exponential": "5 to 6",
}  # fmt: skip
STEPS = (1 / 16, 1 / 32, 1 / 64, 1 / 128, 1 / 256)  # of the duration
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)


@dataclass(frozen=True)
class Order:
    """Of one integrator: steps and errors of its runs, coarse to fine, and the slope between them."""

    method: Method
    theory: str
    steps: tuple[int, ...]
    errors: tuple[float, ...]

    @property
    def observed(self) -> float:
        """Least-squares slope of log error against log steps over all runs, with its sign turned."""
        return -float(np.polyfit(np.log(self.steps), np.log(self.errors), 1)[0])


def orders(made: Manufactured) -> list[Order]:
    """One for each integrator of the library."""
    system = fm.compile(made.scene)
    exact = made.motion.at(made.duration_s).q
    found = []
    for method, theory in THEORY.items():
        steps, errors = [], []
        for step, rtol in zip(STEPS, TOLERANCES, strict=True):
            fixed = INTEGRATORS[method].fixed
            settings: RunSettings = (
                {"step": step * made.duration_s} if fixed else {"rtol": rtol, "atol": 1e-2 * rtol}
            )
            run = fm.simulate(system, made.duration_s, method, samples=2, **settings)
            steps.append(run.statistics.accepted_steps)
            errors.append(float(np.max(np.abs(run.q[-1] - exact))))
        found.append(Order(method, theory, tuple(steps), tuple(errors)))
    return found
