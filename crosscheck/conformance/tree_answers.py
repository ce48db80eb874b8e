"""What an engine must answer on the trees of the clauses, by equations that share no code with any engine.

They are those of `crosscheck.export.rebuild`, formed in World axes by NumPy alone from the numbers of the scene; what
only a contract asks for is added here: loads across hinges, accelerations of markers, and derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from crosscheck.engines.conventions import rotation_matrix
from crosscheck.export.model import flexible_bodies, tree_data
from crosscheck.export.rebuild import RebuiltCase
from flexmb.scene.schema import InertiaPoint, ModalBody, ModalNode, Scene
from flexmb.typing import Real

STEP = 2e-3
"""Of differences of fourth order: its fourth power is 1.6e-11, and rounding divided by it 1e-13."""


class Motion(NamedTuple):
    """Position (3,), quaternion (4,), velocity (6,) and acceleration (6,) [angular; linear] of a marker."""

    position: Real
    quaternion: Real
    velocity: Real
    acceleration: Real


class Answer(NamedTuple):
    """What the contract asks of one instant, as in `crosscheck.engines.contract.Snapshot`."""

    markers: dict[str, Motion]
    loads: dict[str, Real]
    drives: dict[str, Real]
    energy: dict[str, float]
    momentum: Real


class KnownDerivatives(NamedTuple):
    """d udot / d xi, d u and d tau (n,n) in the initial state."""

    by_displacement: Real
    by_speed: Real
    by_force: Real


def initial(scene: Scene) -> Answer:
    """The answer at t = 0 in the scene's initial state."""
    case = _rebuilt(scene)
    return _answer(case, 0.0, case.start)


def moving(scene: Scene, times: Real) -> list[Answer]:
    """The answers at sample times of a run, known to 1e-10; clauses allow an engine 1e-7."""
    case = _rebuilt(scene)
    return [_answer(case, t, y) for t, y in zip(times, case.integrate(times, rtol=1e-10), strict=True)]


def derivatives(scene: Scene) -> KnownDerivatives:
    """Those of the n coordinates that are not prescribed: of hinges as the scene has them, wheels, and modes."""
    case = _rebuilt(scene)
    size, start = case.nq, case.start
    coordinates = _free_coordinates(case, scene)

    def slopes(along: Callable[[int], Real]) -> Real:
        directions = [along(n) for n in coordinates]
        return np.array([_slope(case, start, direction)[coordinates] for direction in directions]).T

    def displaced(n: int) -> Real:
        """The rates of all coordinates if this speed alone is 1; quaternions become longer, which does not matter."""
        return np.append(case.coordinate_rates(np.append(start[:size], _unit(n, case.nu))), np.zeros(case.nu))

    mass, _ = case.equations(0.0, case.driven(0.0, start)[0])
    return KnownDerivatives(
        slopes(displaced), slopes(lambda n: _unit(size + n, size + case.nu)),
        np.asarray(np.linalg.inv(mass[np.ix_(coordinates, coordinates)])),
    )  # fmt: skip


def _rebuilt(scene: Scene) -> Any:
    """The equations of a tree of rigid and raw modal bodies of level "full", read from the scene alone."""
    flexible: dict[str, Any] = {}
    for body in flexible_bodies(scene):
        if not isinstance(body, ModalBody) or body.level != "full":
            raise NotImplementedError(f'{body.name}: trees of clauses have rigid and raw modal bodies, of level "full"')
        flexible[body.name] = _modal(body)
    return RebuiltCase(tree_data(scene), flexible)


def _modal(body: ModalBody) -> dict[str, Any]:
    """A raw modal body as the export has it, not by way of flexmb's own modal data; the sums are over its points."""
    count = len(body.stiffness)
    origin = ModalNode(name="origin", position_m=(0.0, 0.0, 0.0), translation_modes=(), rotation_modes=())
    nodes = (origin, *body.nodes)
    at_points = [_shapes(point, count) for point in body.points]
    return {
        "modes": count, "stiffness": body.stiffness_factor * np.array(body.stiffness),
        "damping": body.damping or np.zeros((count, count)),
        "nodes": {node.name: _shapes(node, count) | {"rotation": rotation_matrix(node.quaternion)} for node in nodes},
        "points": {key: [point[key] for point in at_points] for key in at_points[0]} | {
            "mass_kg": [point.mass_kg for point in body.points],
            "mass_centre_offset_m": [point.com_offset_m for point in body.points],
            "inertia_kg_m2": [point.inertia_kg_m2 for point in body.points],
        },
        "integrals": {},
    }  # fmt: skip


def _shapes(point: InertiaPoint | ModalNode, count: int) -> dict[str, Real]:
    """Position and modes (3,m) of a point; modes that are left out are zero."""

    def modes(shapes: Sequence[Sequence[float]]) -> Real:
        return np.array(shapes).T if shapes else np.zeros((3, count))

    return {
        "position_m": np.array(point.position_m),
        "translation_modes": modes(point.translation_modes), "rotation_modes": modes(point.rotation_modes),
    }  # fmt: skip


def _answer(case: Any, t: float, y: Real) -> Answer:
    y, udot, drive = case.solved(t, y)
    answer, frames = case.observed(t, y), case.frames(y)
    markers = {}
    for marker in case.data["markers"]:
        name, there = f"marker:{marker['name']}", case.node(frames, marker["body"], marker["node"], y)
        there = there.at(np.array(marker["offset_m"]), np.eye(3))
        acceleration = np.concatenate([there.alpha + there.W @ udot, there.a + there.V @ udot])
        velocity = np.concatenate([answer[f"{name}.angular_velocity"], answer[f"{name}.velocity"]])
        markers[marker["name"]] = Motion(
            answer[f"{name}.position"], answer[f"{name}.orientation"], velocity, acceleration
        )
    driven = {joint["name"]: drive[[j for j in _speeds(case, joint) if j in case.prescribed]] for joint in case.joints}
    return Answer(
        markers,
        {joint["name"]: _load(case, t, y, udot, frames, joint) for joint in case.joints},
        {name: load for name, load in driven.items() if load.size},
        {kind: float(answer[f"energy.{kind}"]) for kind in ("kinetic", "gravity", "spring", "strain")},
        np.concatenate([answer["momentum.angular"], answer["momentum.linear"]]),
    )


def _load(case: Any, t: float, y: Real, udot: Real, frames: dict[str, Any], joint: dict[str, Any]) -> Real:
    """[torque; force] across a joint on its child about its own point: what all outboard needs beyond other loads."""
    outboard = _outboard(case, joint["child"])
    here = case.node(frames, joint["child"], joint["child_node"], y)
    here = here.at(np.array(joint["child_offset"]["position_m"]), np.eye(3)).r
    total = np.zeros(6)
    for body in outboard:
        for m, x, V, a, W, w, alpha, J in zip(*case.points(frames, body, y), strict=True):
            force = m * (V @ udot + a - case.gravity)
            torque = J @ (W @ udot + alpha) + np.cross(w, J @ w) + np.cross(x - here, force)
            total += np.concatenate([torque, force])
    for load, function in case.loads:
        if load["body"] in outboard:
            node = case.node(frames, load["body"], load["node"], y)
            direction = np.array(load["direction"])
            vector = function(t)[0] * (direction if load["frame"] == "world" else node.R @ direction)
            if load["type"] == "torque":
                total[:3] -= vector
            else:
                total -= np.concatenate([np.cross(node.r - here, vector), vector])
    return total


def _outboard(case: Any, body: str) -> set[str]:
    """A body and all that hangs on it."""
    children = [joint["child"] for joint in case.joints if joint["parent"] == body]
    return {body}.union(*(_outboard(case, child) for child in children))


def _speeds(case: Any, joint: dict[str, Any]) -> list[int]:
    """The places of a joint's speeds in u."""
    counts = {"ball": 3, "free": 6}
    return [
        case.slots[joint["name"], n][1] + k
        for n, freedom in enumerate(joint["freedoms"])
        for k in range(counts.get(freedom["motion"], 1))
    ]


def _free_coordinates(case: Any, scene: Scene) -> list[int]:
    """Places in u of the coordinates that are not prescribed, in the contract's order."""
    joints = {joint["name"]: joint for joint in case.joints}
    speeds = [j for item in (*scene.hinges, *scene.wheels) for j in _speeds(case, joints[item.name])]
    modes = [j for body in scene.bodies if body.name in case.eta for j in range(case.nu)[case.eta[body.name][1]]]
    return [j for j in speeds + modes if j not in case.prescribed]


def _slope(case: Any, y: Real, along: Real) -> Real:
    """The derivative of the accelerations along a direction of the state."""
    near, far = (case.accelerations(0.0, y + h * along) - case.accelerations(0.0, y - h * along)
                 for h in (STEP, 2.0 * STEP))  # fmt: skip
    return np.asarray((8.0 * near - far) / (12.0 * STEP))


def _unit(n: int, size: int) -> Real:
    unit = np.zeros(size)
    unit[n] = 1.0
    return unit
