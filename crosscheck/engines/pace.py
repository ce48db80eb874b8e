"""The fastest motions of a scene, which a fixed step must resolve: from rates, gravity, springs and profiles.

They are estimated at the initial state of the scene's rigid links, for choosing steps and not for predicting
frequencies: later motion by motors, and bodies beyond a free hinge, may be faster by a small factor.
"""

from __future__ import annotations

from typing import Any, NamedTuple, assert_never

import numpy as np
from scipy.linalg import eigh

from crosscheck.engines.connections import Connection
from crosscheck.engines.conventions import Frame, axis_rotation, cross, cross_matrix, frame
from crosscheck.engines.functions_of_time import fastest_change, fastest_rate, profile, scene_functions
from crosscheck.engines.links import Attachment, Ball, Floating, Freedom, Link, Scalar, links
from flexmb.scene.connectors import AlongHinge, Bushing, Connector, SpringDamper, by_stem
from flexmb.scene.schema import Scene
from flexmb.scene.tree import coordinate_of
from flexmb.typing import Real

_ROUNDING = 1e-12  # of a normalised mass matrix: massless directions have no frequency
_OFF_AXIS = 1e-2  # of a mass centre's distance from a hinge: least distance from its axis to count as a pendulum


class Pace(NamedTuple):
    """Fastest of each kind (rad/s): `motion` turns by rates, prescribed motion and gravity; `elastic` are the poles of
    springs, dampers and connectors, and the profiles of drives and loads; `modes` are those of flexible bodies, which
    an implicit method may step over.
    """

    motion: float
    elastic: float
    modes: float = 0.0


def pace(scene: Scene, duration_s: float, modes: float = 0.0) -> Pace:
    """The pace of a scene without SID bodies over a run from t = 0."""
    chain = links(scene)
    tree = _Columns(chain)
    turning = max(_turning(freedom, duration_s) for link in chain for freedom in link.freedoms or (None,))
    swinging = tree.swinging(float(np.linalg.norm(scene.gravity_m_s2)))
    profiles = [fastest_change(function, duration_s) for function in scene_functions(scene)]
    return Pace(max(turning, swinging), max((tree.poles(scene), *profiles)), modes)


def fastest_mode(mass: Real, translation: Real, inertia: Real, rotation: Real, stiffness: Real) -> float:
    """Highest frequency (rad/s) of m modes: masses (n,) kg and inertias (n,3,3) kg m² of n points, which move by
    `translation` and turn by `rotation` (n,3,m); stiffness (m,m)."""
    moving = np.einsum("n,nim,nik->mk", mass, translation, translation)
    return _fastest(stiffness, moving + np.einsum("nim,nij,njk->mk", rotation, inertia, rotation))


class _Columns:
    """The tree's speeds u (n,) at t = 0, in World: the motion (6,n) [angular; linear at the World origin] that each
    gives to all links beyond it, what it carries, and the mass matrix (n,n)."""

    def __init__(self, chain: tuple[Link, ...]) -> None:
        self._chain = chain
        self._first: dict[str, int] = {}
        self._freedoms: list[Freedom] = []
        motions: list[Real] = []
        owners: list[int] = []
        origins: list[Real] = []
        frames: list[Frame] = []
        for number, link in enumerate(chain):
            at = (frames[link.parent] if link.parent >= 0 else Frame(np.zeros(3), np.eye(3))) @ link.inboard
            self._first[link.joint] = len(motions)
            for freedom in link.freedoms:
                at, given = _moved(at, freedom)
                motions += given
                owners += [number] * len(given)
                origins += [at.position] * len(given)
                self._freedoms += [freedom] * len(given)
            frames.append(at)
        self._motion = np.array(motions).reshape(-1, 6).T
        self._origin = np.array(origins).reshape(-1, 3)
        self._carried = _subtrees(chain, frames)[owners]
        self._frames = frames
        self._moves = _beyond(chain)[owners]  # (n, links)
        beyond = self._moves[:, owners]
        upper = np.einsum("ia,jik,kj->aj", self._motion, self._carried, self._motion) * beyond
        self._mass = np.where(beyond, upper, upper.T)
        for column, freedom in enumerate(self._freedoms):
            if isinstance(freedom, Scalar):
                self._mass[column, column] += freedom.armature

    def swinging(self, gravity: float) -> float:
        """sqrt(m g r / I) of the fastest pendulum (rad/s): everything beyond one axis, at any angle at t = 0."""
        fastest = 0.0
        for column, freedom in enumerate(self._freedoms):
            spatial = self._carried[column]
            if isinstance(freedom, Floating) or (m := spatial[5, 5]) == 0.0:
                continue
            centre = np.array([spatial[2, 4], spatial[0, 5], spatial[1, 3]]) / m
            turn, shift = np.split(self._motion[:, column], 2)
            arm = float(np.linalg.norm(shift + cross(turn, centre)))
            if turn.any() and arm > _OFF_AXIS * np.linalg.norm(centre - self._origin[column]):
                fastest = max(fastest, m * gravity * arm / self._mass[column, column])
        return float(np.sqrt(fastest))

    def poles(self, scene: Scene) -> float:
        """The fastest pole (rad/s) of the springs and dampers of hinges, wheels, point masses and connectors."""
        count = len(self._freedoms)
        K, C = np.zeros((2, count, count))
        free = np.ones(count, dtype=bool)
        for column, freedom in enumerate(self._freedoms):
            if not isinstance(freedom, Floating):
                K[column, column], C[column, column] = freedom.stiffness, freedom.damping
                free[column] = not isinstance(freedom, Scalar) or freedom.prescribed is None
        for connector in scene.connectors:
            rows, stiffness, damping = self._resisted(scene, connector)
            K += rows.T @ stiffness @ rows
            C += rows.T @ damping @ rows
        M = self._mass[np.ix_(free, free)]
        return max(_fastest(K[np.ix_(free, free)], M), _fastest(C[np.ix_(free, free)], M) ** 2)

    def _resisted(self, scene: Scene, connector: Connector) -> tuple[Real, Real, Real]:
        """What a connector resists: k rates of n speeds (k,n), and stiffness and damping (k,k) of them.

        Friction, which has neither, resists none of them in this sense.
        """
        stems = by_stem(connector)
        if isinstance(connector, AlongHinge):
            item, number = coordinate_of(scene, connector)
            column = np.eye(len(self._freedoms))[[self._first[item.name] + number]]
            stiffness = _steepest(stems) + stems["stop_stiffness"] if "stiffness" in stems else 0.0
            return column, stiffness * np.eye(1), stems.get("damping", 0.0) * np.eye(1)
        ends = Connection(scene, self._chain, connector)
        a, b = self._frame(ends.a), self._frame(ends.b)
        turning, moving = (
            a.rotation.T @ (beyond - before)
            for beyond, before in zip(self._motion_of(ends.b, b), self._motion_of(ends.a, b), strict=True)
        )
        match connector:
            case Bushing():
                return np.concatenate([turning, moving]), np.array(connector.stiffness), np.array(connector.damping)
            case SpringDamper():
                line = a.rotation.T @ (b.position - a.position)
                length = np.linalg.norm(line)
                along = (line / length @ moving)[None] if length > 0.0 else moving
                return along, _steepest(stems) * np.eye(len(along)), stems["damping"] * np.eye(len(along))
            case _:
                assert_never(connector)

    def _frame(self, at: Attachment) -> Frame:
        return at.frame if at.link < 0 else self._frames[at.link] @ at.frame

    def _motion_of(self, at: Attachment, place: Frame) -> tuple[Real, Real]:
        """Angular velocity, and velocity at the place, (3,n) each, of what a frame is attached to."""
        turns, shifts = self._motion[:3], self._motion[3:]
        moves = self._moves[:, at.link] if at.link >= 0 else np.zeros(len(self._freedoms), dtype=bool)
        return turns * moves, (shifts - cross_matrix(place.position) @ turns) * moves


def _steepest(stems: dict[str, Any]) -> float:
    """Stiffness of a law at rest, or the largest slope of its table."""
    rise = np.diff(stems["loads"]) / np.diff(stems["table"]) if stems["table"] else np.zeros(1)
    return max(stems["stiffness"], float(rise.max()))


def _fastest(stiffness: Real, mass: Real) -> float:
    """Root of the largest eigenvalue of K v = λ M v, without massless directions."""
    massive = np.diag(mass) > 0.0
    if not stiffness[np.ix_(massive, massive)].any():
        return 0.0
    size = np.sqrt(np.diag(mass)[massive])
    K, M = (matrix[np.ix_(massive, massive)] / np.outer(size, size) for matrix in (stiffness, mass))
    last = len(size) - 1
    eigenvalues = eigh(K, M + _ROUNDING * np.eye(len(size)), eigvals_only=True, subset_by_index=[last, last])
    return float(np.sqrt(max(eigenvalues[0], 0.0)))


def _turning(freedom: Freedom | None, duration_s: float) -> float:
    """Turning rate (rad/s) at the start, or the largest that is prescribed."""
    match freedom:
        case Scalar(motion="slide") | None:
            return 0.0
        case Scalar(rate=rate, prescribed=function):
            return abs(rate) if function is None else fastest_rate(function, duration_s)
        case Ball() | Floating():
            return float(np.linalg.norm(freedom.angular_velocity))
        case _:
            assert_never(freedom)


def _moved(at: Frame, freedom: Freedom) -> tuple[Frame, list[Real]]:
    """A frame in World beyond a freedom at its initial value, and the motions (6,) that the freedom gives."""
    match freedom:
        case Scalar():
            value = freedom.value if freedom.prescribed is None else profile(freedom.prescribed)(0.0).value
            axis, turned = at.rotation @ freedom.axis, at.rotation @ axis_rotation(freedom.axis, value)
            turning, sliding = np.concatenate([axis, cross(at.position, axis)]), np.concatenate([np.zeros(3), axis])
            match freedom.motion:
                case "turn":
                    return Frame(at.position, turned), [turning]
                case "slide":
                    return Frame(at.position + value * axis, at.rotation), [sliding]
                case "screw":
                    moved = at.position + value * freedom.pitch * axis
                    return Frame(moved, turned), [turning + freedom.pitch * sliding]
                case _:
                    assert_never(freedom.motion)
        case Ball():
            at = at @ frame(np.zeros(3), freedom.quaternion)
            return at, _turns(at)
        case Floating():
            at = at @ frame(freedom.position, freedom.quaternion)
            return at, _turns(at) + [np.concatenate([np.zeros(3), axis]) for axis in at.rotation.T]
        case _:
            assert_never(freedom)


def _turns(at: Frame) -> list[Real]:
    return [np.concatenate([axis, cross(at.position, axis)]) for axis in at.rotation.T]


def _subtrees(chain: tuple[Link, ...], frames: list[Frame]) -> Real:
    """Spatial inertia (n,6,6) about the World origin of each link with all beyond it."""
    inertias = np.zeros((len(chain), 6, 6))
    for number in reversed(range(len(chain))):
        own, at = chain[number].inertia, frames[number]
        to_centre = cross_matrix(at.position + at.rotation @ own.com)
        inertias[number, :3, :3] += at.rotation @ own.inertia @ at.rotation.T - own.mass * to_centre @ to_centre
        inertias[number, :3, 3:] += own.mass * to_centre
        inertias[number, 3:, :3] -= own.mass * to_centre
        inertias[number, 3:, 3:] += own.mass * np.eye(3)
        if chain[number].parent >= 0:
            inertias[chain[number].parent] += inertias[number]
    return inertias


def _beyond(chain: tuple[Link, ...]) -> Real:
    """(n,n): whether the second link is the first or beyond it."""
    beyond = np.eye(len(chain), dtype=bool)
    for number, link in enumerate(chain):
        if link.parent >= 0:
            beyond[:, number] |= beyond[:, link.parent]
    return beyond
