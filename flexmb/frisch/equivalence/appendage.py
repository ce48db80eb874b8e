"""An elastic appendage: modal data of a body of a scene that is clamped to its inboard body and carries nothing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import assert_never

import msgspec
import numpy as np
from numpy.typing import NDArray

from flexmb.frisch.elements import inertia_of
from flexmb.frisch.normalisation import combined, normalised
from flexmb.frisch.parameters import ModeParameters, mode_parameters
from flexmb.kept import kept
from flexmb.modal.beam import beam_elements
from flexmb.modal.flexible import flexible_model
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.scene.bodies import BeamBody, Level, ModalBody, RigidBody, SidBody
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.problems import closest
from flexmb.scene.quaternions import cross_matrix
from flexmb.scene.schema import Scene
from flexmb.typing import Real

DEFAULT_MODES = 40
_POINT_ARRAYS = ("mass", "position", "com_offset", "inertia", "translation", "rotation")


@dataclass(frozen=True)
class Appendage:
    """A flexible body clamped at its origin, body axes, modes normalised as in (41) and ordered by frequency.

    `name`; `level` of the body in its scene; `model` with those modes; `parameters`, the corrected ones; `frequencies`
    (n,) rad/s with the base fixed.
    """

    name: str
    model: FlexibleModel
    parameters: ModeParameters
    frequencies: Real
    level: Level = "full"

    @property
    def mode_count(self) -> int:
        return len(self.frequencies)

    @kept
    def rigid_inertia(self) -> Real:
        """(6,6), order [angular; linear]: the undeformed body about its clamp."""
        return inertia_about_origin(self.parameters)

    @kept
    def moving(self) -> ModeParameters:
        """Parameters of the points that some mode moves or turns; points at the clamp move with the base."""
        model = self.model
        size = np.sqrt(np.sum(model.position**2, axis=1).max())
        shapes = np.maximum(np.abs(model.translation), size * np.abs(model.rotation)).max(axis=(1, 2))
        moved = shapes > 1e-12 * shapes.max()
        points = {name: getattr(model, name)[moved] for name in _POINT_ARRAYS}
        return mode_parameters(replace(model, **points))

    @kept
    def momenta(self) -> Real:
        """(n,6) [angular about the clamp; linear] momentum of each mode at unit rate: Q_n + m alpha x A_n and m A_n."""
        p = self.parameters
        linear = p.mass * p.A
        return np.hstack([p.Q + np.cross(p.alpha, linear), linear])


def inertia_about_origin(p: ModeParameters) -> Real:
    """(6,6), order [angular; linear], of an undeformed body with these parameters about its origin."""
    arm = p.mass * cross_matrix(p.alpha)
    inertia = p.Phi + p.mass * inertia_of(np.outer(p.alpha, p.alpha))
    return np.block([[inertia, arm], [arm.T, p.mass * np.eye(3)]])


def appendage(model: FlexibleModel, name: str = "appendage") -> Appendage:
    """The appendage of a flexible model.

    Raises ValueError, which calls it `name`, if the comparison is not defined: without modes, with modes that are not
    clamped at the origin, or with modes without stiffness.
    """
    if model.mode_count == 0:
        raise ValueError(f"{name}: a rigid body has no modes to compare with a hinge; choose a flexible body")
    if not model.clamped:
        raise ValueError(
            f"{name}: its modes are free-free, but a hinge is compared with modes clamped at the hinge point; give the "
            'body modes with the boundary "clamped-free"'
        )
    own = normalised(model, name)
    squares = np.diag(own.stiffness) / own.mass.sum()
    if np.any(squares <= 0.0):
        n = int(np.argmin(squares))
        raise ValueError(f"{name}: mode {n + 1} has no stiffness; a mode of a clamped body needs a frequency")
    # Frequencies that agree to nine digits keep their order, so that rounding does not exchange a degenerate pair.
    order = np.argsort([float(f"{square:.8e}") for square in squares], kind="stable")
    own = with_modes(own, order)
    return Appendage(name, own, mode_parameters(own), np.sqrt(squares[order]))


def with_modes(model: FlexibleModel, chosen: NDArray[np.intp]) -> FlexibleModel:
    """The same body with some of its modes, in the order of `chosen`."""
    return combined(model, np.eye(model.mode_count)[:, chosen])


def appendage_of(scene: Scene, body: str, modes: int | None = None) -> Appendage:
    """The body of that name as an appendage of its inboard body.

    `modes` is the number of modes to use. Those of a beam are computed from its finite elements, at level exact from as
    many polynomials, whatever number the scene gives; a modal body has only the modes it was given. Default: all modes
    of a modal body; of a beam the lower half of the modes of its finite elements, which is accurate, up to
    `DEFAULT_MODES`. Raises ValueError if the body does not exist, is not flexible or not clamped, or if anything is
    attached to it.
    """
    body_of_name = next((candidate for candidate in scene.bodies if candidate.name == body), None)
    if body_of_name is None:
        names = [candidate.name for candidate in scene.bodies if not isinstance(candidate, RigidBody)]
        raise ValueError(f'the scene has no flexible body "{body}": {closest(body, names)}')
    if isinstance(body_of_name, RigidBody):
        raise ValueError(f'body "{body}" is rigid: it has no modes to compare with a hinge; choose a flexible body')
    if isinstance(body_of_name, SidBody):
        raise ValueError(f'body "{body}": SID files are not supported yet; use kind = "modal"')
    _check_limb_end(scene, body)
    name = f'body "{body}"'
    if modes is not None and modes < 1:
        raise ValueError(f"{name}: at least one mode is needed, got {modes}")
    match body_of_name:
        case BeamBody():
            chosen = appendage(flexible_model(_with_modes(body_of_name, modes)), name)
        case ModalBody():
            chosen = _first(appendage(flexible_model(body_of_name), name), modes)
        case _:
            assert_never(body_of_name)
    return replace(chosen, level=body_of_name.level)


def _with_modes(body: BeamBody, modes: int | None) -> BeamBody:
    """The beam with its lowest eigenmodes; damping does not matter here, nor at how many points the scene sums them."""
    elements = beam_elements(body)
    rotary = np.any(elements.table.inertia[:, 3, 3] > 0.0)
    idle = {"torsion"} if body.points == "line" or not rotary else set()
    moving = [field for family, field in elements.fields.items() if family not in idle]
    coordinates = sum(field.size - len(field.clamped_coordinates) for field in moving)
    count = max(body.modes.count, min(DEFAULT_MODES, coordinates // 2)) if modes is None else modes
    eigenmodes = msgspec.structs.replace(body.modes, count=count, static=False, damping_ratio=0.0, points=None)
    return msgspec.structs.replace(body, modes=eigenmodes)


def _first(body: Appendage, modes: int | None) -> Appendage:
    """The lowest modes of an appendage."""
    if modes is None or modes >= body.mode_count:
        return body
    return appendage(with_modes(body.model, np.arange(modes)), body.name)


def _check_limb_end(scene: Scene, body: str) -> None:
    """Raise ValueError unless the hinge of the body is at the clamp and nothing else is attached to the body."""
    attached = [f'hinge "{hinge.name}"' for hinge in scene.hinges if hinge.parent == body]
    attached += [f'point mass "{mass.name}"' for mass in scene.point_masses if mass.body == body]
    attached += [f'wheel "{wheel.name}"' for wheel in scene.wheels if wheel.body == body]
    attached += [f'closure "{closure.name}"' for closure in scene.closures if body in (closure.body_a, closure.body_b)]
    ends = [connector for connector in scene.connectors if isinstance(connector, BetweenNodes)]
    attached += [f'connector "{end.name}"' for end in ends if body in (end.body_a, end.body_b)]
    if attached:
        raise ValueError(
            f'body "{body}" carries {", ".join(attached)}: a hinge cannot replace its modes, because it does not '
            "move the attached frames as the modes do"
        )
    for hinge in scene.hinges:
        if hinge.child == body and hinge.child_node not in ("origin", "root"):
            raise ValueError(
                f'body "{body}" is clamped at its origin, but hinge "{hinge.name}" is at its node '
                f'"{hinge.child_node}"; the comparison needs the clamp at the hinge'
            )
