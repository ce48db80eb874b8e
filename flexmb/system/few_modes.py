"""Whether the modes of a beam leave out a family: no mode stretches it, twists it, or bends it in a plane.

`count` takes the modes of lowest frequency, so that a slender beam of three modes neither twists nor stretches. Whoever
puts a load on a node which only such a family could answer would otherwise find a zero without a word. What it would
have been is the static answer of the beam's finite elements.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, assert_never

import numpy as np

from flexmb.modal.beam import beam_elements
from flexmb.modal.eigenproblem import solve_definite
from flexmb.modal.flexible import flexible_model
from flexmb.scene.bodies import BeamBody, Family
from flexmb.scene.functions import Constant, ControlSignal, Function, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.scene.schema import Load
from flexmb.scene.strains import families
from flexmb.system.frames import body_pose
from flexmb.system.system import System
from flexmb.typing import Real

STRETCH, TURN = 1e-3, 3e-3
"""Part of the length by which a load may stretch a beam, and angle (rad) by which it may turn a section, before
something is said: as for stretch that is held, and as for polynomials that are left out."""
LOOKED_AT = 50
"""States in which directions of loads in World axes are looked at."""
_MOVES: dict[Family, tuple[int, ...]] = {"axial": (0,), "torsion": (3,), "bending_y": (1, 5), "bending_z": (2, 4)}
"""Components of (displacement, rotation) of a section by family."""


class LeftOut(NamedTuple):
    """A `load` would move a section of a beam by up to `size`, a part of the length or an angle in rad, in a family of
    which none of the beam's `given` modes is."""

    body: str
    given: int
    family: Family
    load: str
    size: float

    @property
    def what(self) -> str:
        unit = "of its length" if self.family == "axial" else "rad"
        return (
            f'beam "{self.body}" has {self.given} modes, none of {self.family}, in which its load "{self.load}" would '
            f"move its node by up to {self.size:.2g} {unit}"
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


def left_out(system: System, t: Real, q: Real, u: Real) -> Iterator[LeftOut]:
    """Of each beam the worst of what its modes leave out in the states q (T,nq), u (T,nu) at t (T,) s."""
    for body, without in suspects(system):
        loads = [load for load in system.scene.loads if load.body == body.name]
        moved = (_moved(system, body, without, load, (t, q, u)) for load in loads)
        worst = max(filter(None, moved), key=lambda finding: finding.size, default=None)
        if worst is not None:
            yield worst


def suspects(system: System) -> list[tuple[BeamBody, tuple[Family, ...]]]:
    """The beams that carry loads and have families without a mode, and these families."""
    loaded = {load.body for load in system.scene.loads}
    beams = [body for body in system.scene.bodies if isinstance(body, BeamBody) and body.name in loaded]
    return [(body, without) for body in beams if (without := _idle(system, body))]


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
    shares = {}
    for family in without:
        motion = np.max(np.abs(_answer(body, family, float(node.position[0]), wrenches)), axis=1)
        shares[family] = motion[0] / body.length_m / STRETCH if family == "axial" else np.max(motion[3:]) / TURN
    worst = max(shares, key=lambda family: float(shares[family]))
    if not shares[worst] > 1.0:
        return None
    size = float(shares[worst]) * (STRETCH if worst == "axial" else TURN)
    return LeftOut(body.name, flexible_model(body).mode_count, worst, load.name, size)


def _directions(system: System, body: BeamBody, load: Load, states: tuple[Real, Real, Real]) -> list[Real]:
    """A load's direction in World axes seen from the body, in LOOKED_AT states at most; none of these is NaN."""
    t, q, u = states
    directions, k = [], system.body_names.index(body.name)
    sound = np.flatnonzero(np.isfinite(q).all(axis=1) & np.isfinite(u).all(axis=1))
    for n in sound[np.unique(np.linspace(0, len(sound) - 1, min(LOOKED_AT, len(sound))).astype(int))]:
        system.turns(float(t[n]), q[n], u[n])  # for the poses in the workspace
        directions.append(body_pose(system, system.own_workspace, k).rotation.T @ load.direction)
    return directions


def _answer(body: BeamBody, family: Family, x: float, wrenches: Real) -> Real:
    """(6,n) Displacements and rotations of the section at x (m) of the beam, clamped at its root, in one family, under
    forces and moments (6,n) there."""
    elements = beam_elements(body)
    free = np.arange(elements.size)[elements.coordinates(family)]
    free = free[~np.isin(free, elements.clamped_coordinates())]
    shapes = elements.motion(np.array([x]), np.eye(elements.size))[0][:, free]
    answer: Real = shapes @ solve_definite(elements.stiffness()[np.ix_(free, free)], shapes.T @ wrenches)
    return answer


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
