"""The models that can replace a flexible body, as transformations of scenes.

A `BodyModel` is one model of one body, a rung of its ladder; a `Model` has one for every flexible body.
`flexmb.advisor.ladder` predicts their errors and costs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, assert_never

import numpy as np
from msgspec.structs import replace
from scipy.spatial.transform import Rotation

from flexmb.advisor.modes import with_modes, with_strains
from flexmb.frisch.equivalence.appendage import appendage_of
from flexmb.frisch.equivalence.relations import HingeFit, best_hinge
from flexmb.levels import body as fidelity
from flexmb.modal import flexible_model
from flexmb.scene.bodies import BeamBody, Level, ModalBody, Node, RigidBody
from flexmb.scene.check.modal import second_order
from flexmb.scene.modal_data import modal_arrays
from flexmb.scene.problems import Place
from flexmb.scene.rest_curve import is_curved
from flexmb.scene.rigid_equivalent import rigid_equivalent, vector
from flexmb.scene.schema import AngularCoordinate, Hinge, Revolute, Scene, Universal
from flexmb.surrogate import finite_segments, substructured
from flexmb.typing import Real

_ACROSS = 1e-6  # axes count as orthogonal if the cosine of their angle is below this
_CLAMP = ("origin", "root")


def spring_hinged(scene: Scene, name: str) -> Scene:
    """The scene with the flexible body `name` rigid, on a spring hinge.

    Its inboard hinge carries a clamp without mass, `<name>.clamp`, to which the hinge `<name>.spring` joins the body.
    It has one axis, or two if low modes bend in two planes, at the point with the least mismatch of (149)-(151).
    Springs and dampers give each axis the frequency and the damping of its mode with the base fixed. Loads and markers
    at the clamp remain there. Raises ValueError if the body is not clamped, carries other bodies, or starts deformed,
    or if its modes do not turn it.
    """
    body = next((body for body in scene.bodies if body.name == name), None)
    if not isinstance(body, BeamBody | ModalBody):
        raise ValueError(f'the scene has no flexible body "{name}"')
    if any(state.body == name for state in scene.modal_states):
        raise ValueError(f'body "{name}" starts deformed: a spring hinge has no modal state')
    if any(total.body == name for total in scene.total_loads):
        raise ValueError(f'the clamp of body "{name}" becomes a body of its own: leave out its total loads')
    spring = _spring(body, fitted_hinge(scene, name))
    clamp = RigidBody(name=spring.parent, mass_kg=0.0, inertia_kg_m2=((0.0,) * 3,) * 3, nodes=(Node(name="root"),))
    bodies = [part for each in scene.bodies for part in ((clamp, rigid_equivalent(each)) if each is body else (each,))]
    hinges: list[Hinge] = []
    for hinge in scene.hinges:
        hinges += [replace(hinge, child=clamp.name), spring] if hinge.child == name else [hinge]

    def placed(item: Any) -> Any:
        return replace(item, body=clamp.name) if item.body == name and item.node in _CLAMP else item

    loads, markers = tuple(map(placed, scene.loads)), tuple(map(placed, scene.markers))
    return replace(scene, bodies=tuple(bodies), hinges=tuple(hinges), loads=loads, markers=markers)


def fitted_hinge(scene: Scene, name: str) -> HingeFit:
    """The best hinge for the lowest mode, or for the lowest two that turn the body about orthogonal axes."""
    body = appendage_of(scene, name)
    one = best_hinge(body)
    for mode in range(1, min(body.mode_count, 4)):
        try:
            other = best_hinge(body, modes=(mode,))
        except ValueError:  # a mode that does not turn the body
            continue
        if abs(one.hinge.axes[0] @ other.hinge.axes[0]) < _ACROSS:
            return best_hinge(body, np.vstack([one.hinge.axes, other.hinge.axes]), (0, mode))
    return one


def _spring(body: BeamBody | ModalBody, fit: HingeFit) -> Hinge:
    """The hinge between clamp and body, with its frames at the fitted point, x (and y) along its axes at rest."""
    first = fit.hinge.axes[0]
    second = fit.hinge.axes[1] if len(fit.hinge.axes) == 2 else _across(first)
    frame = Rotation.from_matrix(np.column_stack([first, second, np.cross(first, second)]))
    w, x, y, z = (float(value) for value in frame.as_quat(scalar_first=True))
    lag = _damping_rate(body)
    turns = [AngularCoordinate(stiffness_Nm_rad=float(k), damping_Nms_rad=lag * float(k)) for k in fit.hinge.stiffness]
    point = vector(fit.hinge.point)
    placed: dict[str, Any] = {
        "name": f"{body.name}.spring", "parent": f"{body.name}.clamp", "child": body.name,
        "parent_position_m": point, "child_position_m": point,
        "parent_quaternion": (w, x, y, z), "child_quaternion": (w, x, y, z),
    }  # fmt: skip
    if len(turns) == 1:
        return Revolute(**placed, axis=(1.0, 0.0, 0.0), rotation=turns[0])
    return Universal(**placed, first=turns[0], second=turns[1])


def _across(axis: Real) -> Real:
    """A unit vector orthogonal to `axis`."""
    other = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    return np.asarray(other / np.linalg.norm(other))


def _damping_rate(body: BeamBody | ModalBody) -> float:
    """Ratio (s) of damping and stiffness of the lowest mode."""
    model = flexible_model(body)
    if model.mode_count == 0 or not np.any(model.damping):
        return 0.0
    lowest = int(np.argmin(np.diag(model.stiffness)))
    return float(model.damping[lowest, lowest] / model.stiffness[lowest, lowest])


LEVELS: tuple[Level, ...] = tuple(level.name for level in fidelity.LEVELS if level.flexible and not level.by_strain)
"""Levels of modes, each of which neglects less than the one before."""
EXACT: Level = "exact"
COUNTS = (1, 2, 3, 4, 6, 8)
SEGMENTS = (2, 4, 8)
PIECES = (2, 4, 8, 16)
STRAINS = (*((1, n) for n in COUNTS), (2, 3), (2, 4), (2, 6), (4, 3), (4, 4), (4, 6), (8, 3), (8, 4))
"""Pieces of level exact, and polynomials of each curvature along one."""
PLURAL = {1: "mode"}

Kind = Literal["rigid", "sprung", "modes", "segments", "pieces", "strains"]


@dataclass(frozen=True)
class BodyModel:
    """One model of a flexible body.

    "rigid"; "sprung": rigid on a spring hinge; "modes": its `modes` lowest of `families` (all if empty), at `level`,
    with attachment modes if `static`; "segments": `pieces` rigid pieces on sprung hinges; "pieces": flexible ones, with
    `modes` eigenmodes; "strains": `pieces` of level exact with that many `polynomials` of each curvature of `families`,
    and of stretch and shear, as far as the body has them, if `stretching`.
    """

    kind: Kind
    modes: int = 0
    level: Level = "rigid"
    static: bool = False
    families: tuple[str, ...] = ()
    pieces: int = 0
    polynomials: int = 0
    stretching: bool = False

    def __str__(self) -> str:
        if self.kind == "rigid":
            return "rigid"
        if self.kind == "sprung":
            return "rigid on a spring hinge"
        if self.kind == "segments":
            return f"{self.pieces} rigid segments"
        if self.kind == "pieces":
            more = f" and {self.modes} eigenmodes" if self.modes else ""
            return f"{self.pieces} pieces with static shapes{more}, {self.level}"
        of = f" of {', '.join(self.families)}" if self.families else ""
        if self.kind == "strains":
            pieces = f"{self.pieces} pieces with " if self.pieces > 1 else ""
            number = "1 polynomial" if self.polynomials == 1 else f"{self.polynomials} polynomials"
            more = " and stretch and shear" if self.stretching else ""
            return f"{pieces}{number}{of or ' of each curvature'}{more}, {self.level}"
        static = " and static shapes" if self.static else ""
        return f"{self.modes} {PLURAL.get(self.modes, 'modes')}{of}{static}, {self.level}"


Model = tuple[tuple[str, BodyModel], ...]
"""(body, rung) of every flexible body, in the scene's order."""


def flexible_bodies(scene: Scene) -> tuple[BeamBody | ModalBody, ...]:
    """Bodies with modes whose level is not "rigid"."""
    return tuple(b for b in scene.bodies if isinstance(b, BeamBody | ModalBody) and b.level != "rigid")


def undamped(body: BeamBody | ModalBody) -> bool:
    """Whether a body has no damping of its own."""
    if isinstance(body, ModalBody):
        return not np.any(np.array(body.damping))
    return not np.any(body.modes.damping_ratio) and body.modes.viscosity_s == 0.0


def levels(body: BeamBody | ModalBody) -> tuple[Level, ...]:
    """Levels for which the body has the data: raw bodies seldom have a second-order field, and only beams have
    strains, in which alone those with a curved axis can be expressed."""
    if isinstance(body, BeamBody):
        return (EXACT,) if is_curved(body) else (*LEVELS, EXACT)
    stiffened = replace(body, level="stiffened")
    return LEVELS[:-1] if any(second_order(Place(), stiffened, modal_arrays(body))) else LEVELS


def built(scene: Scene, model: Model) -> Scene:
    """The scene with every body modelled by its rung. Raises ValueError if a rung is not possible for its body."""
    for name, rung in model:
        match rung.kind:
            case "rigid":
                scene = rigid(scene, name)
            case "sprung":
                scene = spring_hinged(scene, name)
            case "segments":
                scene = finite_segments(scene, name, rung.pieces)
            case "pieces":
                scene = substructured(scene, name, rung.pieces, level=rung.level, eigenmodes=rung.modes)
            case "strains":
                scene = with_strains(scene, name, rung.polynomials, rung.pieces, rung.stretching, rung.families)
            case "modes":
                scene = with_modes(scene, name, rung.modes, rung.level, rung.static, rung.families)
            case _:
                assert_never(rung.kind)
    return scene


def rigid(scene: Scene, name: str) -> Scene:
    """The scene with that body at level "rigid" and without its modal state; nothing else changes."""
    bodies = tuple(replace(b, level="rigid") if b.name == name else b for b in scene.bodies)
    return replace(scene, bodies=bodies, modal_states=tuple(s for s in scene.modal_states if s.body != name))
