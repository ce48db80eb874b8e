"""Whether the modes of a beam leave out a family: no mode stretches it, twists it, or bends it in a plane.

`count` takes the modes of lowest frequency, so that a slender beam of three modes neither twists nor stretches. Whoever
puts a load on a node which only such a family could answer, or joins to it a body, a closure or a connector that does,
would otherwise find a zero without a word. What it would have been is the static answer of the beam's finite elements.
Loads of the scene are taken at their largest at any time, those of what is joined in states of the motion.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple, assert_never

import numpy as np

from flexmb.building.connector_arrays import between_nodes
from flexmb.modal.beam import beam_elements
from flexmb.modal.eigenproblem import solve_definite
from flexmb.modal.flexible import flexible_model
from flexmb.scene.bodies import BeamBody, Family
from flexmb.scene.functions import Constant, ControlSignal, Function, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.scene.schema import Hinge, Load
from flexmb.scene.strains import families
from flexmb.scene.tree import place_along
from flexmb.system.frames import body_pose, node_pose
from flexmb.system.moved_sections import cross
from flexmb.system.section_loads import ExertedLoads, LoadsByName, joined_loads
from flexmb.system.system import System
from flexmb.tables.state import DynamicsError, State
from flexmb.typing import Real

STRETCH, TURN = 1e-3, 3e-3
"""Part of the length by which a load may stretch a beam, and angle (rad) by which it may turn a section, before
something is said: as for stretch that is held, and as for polynomials that are left out."""
LOOKED_AT = 50
"""States in which directions of loads in World axes are looked at."""
FEW = 3
"""States in which the loads of what a beam is joined to are looked at."""
_MOVES: dict[Family, tuple[int, ...]] = {"axial": (0,), "torsion": (3,), "bending_y": (1, 5), "bending_z": (2, 4)}
"""Components of (displacement, rotation) of a section by family."""


class LeftOut(NamedTuple):
    """`loads` would move a section of a beam by up to `size`, a part of the length or an angle in rad, in a family of
    which none of the beam's `given` modes is."""

    body: str
    given: int
    family: Family
    loads: str
    size: float

    @property
    def what(self) -> str:
        unit = "of its length" if self.family == "axial" else "rad"
        return (
            f'beam "{self.body}" has {self.given} modes, none of {self.family}, in which {self.loads} would move its '
            f"node by up to {self.size:.2g} {unit}"
        )

    @property
    def remedy(self) -> str:
        return "give its modes `static = true`, which adds the answers to loads at the tip, or a larger `count`"


def idle(body: BeamBody) -> tuple[Family, ...]:
    """The families of a beam in which none of its modes moves the tip; none of levels rigid and exact.

    Raises ValueError for a beam without so many modes.
    """
    if body.level in ("rigid", "exact"):
        return ()
    tip = flexible_model(body).nodes["tip"]
    motion = np.vstack([tip.translation, body.length_m * tip.rotation_modes])
    rounding = 1e-9 * np.max(np.abs(motion), initial=0.0)
    return tuple(family for family in families(body) if np.all(np.abs(motion[list(_MOVES[family])]) <= rounding))


def left_out(system: System, t: Real, q: Real, u: Real, exerted: ExertedLoads | None) -> Iterator[LeftOut]:
    """Of each beam the worst of what its modes leave out in the states q (T,nq), u (T,nu) at t (T,) s.

    exerted: loads (T,6) by name in these states; None to have them evaluated where there is no controller.
    """
    for body, without in suspects(system):
        loads = [load for load in system.scene.loads if load.body == body.name]
        moved = [_moved(system, body, without, load, (t, q, u)) for load in loads]
        moved += _moved_by_joints(system, body, without, (t, q, u), exerted)
        worst = max(filter(None, moved), key=lambda finding: finding.size, default=None)
        if worst is not None:
            yield worst


def suspects(system: System) -> list[tuple[BeamBody, tuple[Family, ...]]]:
    """The beams that carry loads or are joined to others beyond their root, and have families without a mode, and
    these families."""
    scene, found = system.scene, list[tuple[BeamBody, tuple[Family, ...]]]()
    loaded = {load.body for load in scene.loads} | {wheel.body for wheel in scene.wheels}
    loaded |= {mass.body for mass in scene.point_masses}
    loaded |= {hinge.parent for hinge in scene.hinges} | {hinge.child for hinge in scene.hinges if _far(hinge)}
    loaded |= {end for closure in scene.closures for end in (closure.body_a, closure.body_b)}
    loaded |= {end for connector in between_nodes(scene) for end in (connector.body_a, connector.body_b)}
    for body in scene.bodies:
        if isinstance(body, BeamBody) and body.name in loaded and (without := _idle(system, body)):
            found.append((body, without))
    return found


def _far(hinge: Hinge) -> bool:
    """Whether it holds its child elsewhere than at the root."""
    return hinge.child_node not in ("origin", "root")


def _idle(system: System, body: BeamBody) -> tuple[Family, ...]:
    key = ("families without a mode", body.name)
    without = system.kept.get(key)
    return system.kept.setdefault(key, idle(body)) if without is None else without


def _moved(
    system: System, body: BeamBody, without: tuple[Family, ...], load: Load, states: tuple[Real, Real, Real]
) -> LeftOut | None:
    """The family that the load would move most, when it is largest and as it points in any of the states; None where
    that is little."""
    node = flexible_model(body).nodes[load.node]
    directions = _directions(system, body, load, states) if load.frame == "world" else [node.rotation @ load.direction]
    if not directions:
        return None
    most = max(_largest(load.function, float(time)) for time in states[0])
    unit = np.eye(6)[:, :3] if load.type == "force" else np.eye(6)[:, 3:]
    wrenches = most * unit @ np.transpose(directions)
    x = np.array([float(node.position[0])])
    return _most(
        body, without, f'its load "{load.name}"', {family: _answer(body, family, x, wrenches) for family in without}
    )


def _moved_by_joints(
    system: System, body: BeamBody, without: tuple[Family, ...], states: tuple[Real, Real, Real],
    exerted: ExertedLoads | None,
) -> list[LeftOut | None]:  # fmt: skip
    """What the loads of all that the beam is joined to would do together, in the FEW states with the largest of them.

    Loads that closures leave undetermined count as zero.
    """
    t, q, u = states
    sound = np.flatnonzero(np.isfinite(q).all(axis=1) & np.isfinite(u).all(axis=1))
    if not len(sound) or (exerted is None and system.scene.controllers):
        return []
    if exerted is None:
        sound = sound[np.unique(np.linspace(0, len(sound) - 1, min(FEW, len(sound))).astype(int))]
    else:
        sound = sound[np.argsort(-_sizes(body, exerted)[sound], kind="stable")[:FEW]]
    k, w, found = system.body_names.index(body.name), system.own_workspace, list[LeftOut | None]()
    for n in sound.tolist():
        state = State(q[n], u[n], float(t[n]))
        try:
            at = _of_state(exerted, n) if exerted is not None else system.evaluate(state.t, state.q, state.u)
        except DynamicsError:
            continue  # whoever asked for this state says so
        system.turns(state.t, state.q, state.u)  # for the poses in the workspace
        R, places, wrenches = body_pose(system, w, k).rotation, list[float](), list[Real]()
        for joined in joined_loads(system, w, k, at):
            arm = joined.point - node_pose(system, w, body.name, joined.node).position
            places.append(place_along(body, joined.node))
            pull = np.concatenate([R.T @ joined.force, R.T @ (joined.torque + cross(arm, joined.force))])
            wrenches.append(np.nan_to_num(pull))
        loads, x = f"what it is joined to, at t = {state.t:g} s,", np.array(places)
        together = np.concatenate(wrenches)[:, None]
        found.append(_most(body, without, loads, {family: _answer(body, family, x, together) for family in without}))
    return found


def _sizes(body: BeamBody, exerted: ExertedLoads) -> Real:
    """Sizes (T,) of all loads, N m: with forces at the length of the beam."""
    size: Real = np.zeros(1)
    for loads in (exerted.loads, exerted.wheel_loads, exerted.connectors):
        for load in loads.values():
            sizes = np.linalg.norm(load[:, :3], axis=1) + body.length_m * np.linalg.norm(load[:, 3:], axis=1)
            size = size + np.nan_to_num(sizes)
    return size


def _of_state(exerted: ExertedLoads, n: int) -> LoadsByName:
    """The loads (6,) in the n-th state."""
    kinds = (exerted.loads, exerted.wheel_loads, exerted.connectors)
    return LoadsByName(*({name: load[n] for name, load in loads.items()} for loads in kinds))


def _most(body: BeamBody, without: tuple[Family, ...], loads: str, answers: Mapping[Family, Real]) -> LeftOut | None:
    """The family that `loads` would move most, by the displacements and rotations (...,6,n) of sections in each; None
    where that is little."""
    shares = {}
    for family in without:
        motion = np.max(np.abs(answers[family]).reshape(-1, 6, answers[family].shape[-1]), axis=(0, 2))
        shares[family] = motion[0] / body.length_m / STRETCH if family == "axial" else np.max(motion[3:]) / TURN
    worst = max(shares, key=lambda family: float(shares[family]))
    if not shares[worst] > 1.0:
        return None
    size = float(shares[worst]) * (STRETCH if worst == "axial" else TURN)
    return LeftOut(body.name, flexible_model(body).mode_count, worst, loads, size)


def _directions(system: System, body: BeamBody, load: Load, states: tuple[Real, Real, Real]) -> list[Real]:
    """A load's direction in World axes seen from the body, in LOOKED_AT states at most; none of these is NaN."""
    t, q, u = states
    directions, k = [], system.body_names.index(body.name)
    sound = np.flatnonzero(np.isfinite(q).all(axis=1) & np.isfinite(u).all(axis=1))
    for n in sound[np.unique(np.linspace(0, len(sound) - 1, min(LOOKED_AT, len(sound))).astype(int))]:
        system.turns(float(t[n]), q[n], u[n])  # for the poses in the workspace
        directions.append(body_pose(system, system.own_workspace, k).rotation.T @ load.direction)
    return directions


def _answer(body: BeamBody, family: Family, x: Real, wrenches: Real) -> Real:
    """(X,6,n) Displacements and rotations of the sections at x (X,) m of the beam, clamped at its root, in one family,
    under forces and moments (6 X,n) there."""
    elements = beam_elements(body)
    free = np.arange(elements.size)[elements.coordinates(family)]
    free = free[~np.isin(free, elements.clamped_coordinates())]
    shapes = elements.motion(x, np.eye(elements.size))[:, :, free].reshape(-1, len(free))
    answer: Real = shapes @ solve_definite(elements.stiffness()[np.ix_(free, free)], shapes.T @ wrenches)
    return answer.reshape(len(x), 6, -1)


def _largest(function: Function, t: float) -> float:
    """The largest size of a function at any time, of one that grows without bound that at t (s)."""
    match function:
        case Constant(value=value) | Pulse(value=value):
            return abs(value)
        case Ramp(value=value, rate=rate, start_s=start):
            return abs(value + rate * (t - start))
        case Sine(amplitude=amplitude, offset=offset):
            return abs(offset) + abs(amplitude)
        case SmoothStep(start_value=start, end_value=end):
            return max(abs(start), abs(end))
        case SpinUp(rate=rate):
            return abs(rate * t)
        case Table(values=values):
            return max(map(abs, values))
        case ControlSignal():
            return 0.0  # the controller decides it
        case _:
            assert_never(function)
