"""Effect of modal truncation of beams on the eigenvalues of a linear model, by a model with twice as many modes.

Beams of level exact get twice as many polynomials of each strain instead.

By the Rayleigh-Ritz principle, truncation makes an undamped structure stiffer: its frequencies decrease towards their
limit when modes are added. So the change by the next modes estimates the truncation error. The effect of still higher
modes is not included: for eigenmodes of a beam with a heavy body at its tip it is of about the same size.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeGuard

import msgspec
import numpy as np
from scipy.optimize import linear_sum_assignment

from flexmb.linear.linear_model import Complex, LinearModel, modal_assurance
from flexmb.linear.linearize import linearize
from flexmb.modal.flexible import flexible_model
from flexmb.scene.bodies import MOST_POLYNOMIALS, BeamBody, BeamNode, Body, RigidBody, StrainPolynomials
from flexmb.scene.check.beams import available_modes, mode_count
from flexmb.scene.pieces import piece_count
from flexmb.scene.schema import ModalState, Scene
from flexmb.scene.strains import polynomials
from flexmb.system.compile import compile
from flexmb.system.system import System
from flexmb.typing import Real

MORE = 2  # times the modes, and the elements that they need
ALIKE = 0.5  # modal assurance criterion: with less, a mode of the finer model is a different one
NEARNESS = 0.1  # weight of the eigenvalues' distance, since growth and decay of a motion have the same shape
SEEN_AT = 4  # sample positions along a beam, for each mode


@dataclass(frozen=True, eq=False)
class Truncation:
    """By mode of a model, in its order: eigenvalue (rad/s) in the finer one, NaN where none is alike.

    `change`: of it relative to its modulus, NaN for rigid-body motions too. `likeness`: modal assurance of the two
    shapes by kinetic energy, 0 to 1. `unrefined`: flexible bodies of which there is no finer model.
    """

    eigenvalues: Complex
    change: Real
    likeness: Real
    unrefined: tuple[str, ...]


def truncation(
    model: LinearModel, scene: Scene, linearized: Callable[[System], LinearModel] = linearize
) -> Truncation:
    """The modes of a scene's linear model against those with twice the modes of every beam.

    `linearized` makes the finer model as `model` was made: about its initial state by default. Raises as it does.
    """
    finer = linearized(compile(finer_scene(scene)))
    across, modes = _embedding(model, finer, scene), model.modes
    candidates = [mode for mode in finer.modes if not mode.is_rigid_body]
    likeness = np.zeros((len(modes), len(candidates)))
    apart = np.ones_like(likeness)
    shapes = np.array([other.shape for other in candidates]).reshape(len(candidates), -1).T
    for i, mode in enumerate(modes):
        if not mode.is_rigid_body:
            likeness[i] = modal_assurance(finer.mass, across @ mode.shape[:, None], shapes)
            apart[i] = [abs(other.eigenvalue - mode.eigenvalue) / abs(mode.eigenvalue) for other in candidates]
    found, change, alike = np.full(len(modes), np.nan, complex), np.full(len(modes), np.nan), np.zeros(len(modes))
    for i, j in zip(*linear_sum_assignment(NEARNESS * np.minimum(apart, 1.0) - likeness), strict=True):
        if likeness[i, j] >= ALIKE:
            found[i], alike[i] = candidates[j].eigenvalue, likeness[i, j]
            change[i] = abs(found[i] - modes[i].eigenvalue) / abs(modes[i].eigenvalue)
    others = (body for body in scene.bodies if not isinstance(body, RigidBody | BeamBody))
    return Truncation(found, change, alike, tuple(body.name for body in others if body.level != "rigid"))


def finer_scene(scene: Scene) -> Scene:
    """The scene with twice the eigenmodes of every flexible beam, and the elements for them; twice the polynomials of
    beams of level exact."""
    finer = {body.name: _finer(body) for body in scene.bodies if _bends(body)}
    bodies = tuple(finer.get(body.name, body) for body in scene.bodies)
    states = tuple(_moved(state, scene, finer) for state in scene.modal_states)
    return msgspec.structs.replace(scene, bodies=bodies, modal_states=states)


def _bends(body: Body) -> TypeGuard[BeamBody]:
    return isinstance(body, BeamBody) and body.level != "rigid"


def _finer(body: BeamBody) -> BeamBody:
    if body.level == "exact":
        return _more_strains(body)
    count = MORE * max(body.modes.count, 1)
    attached = mode_count(body) - body.modes.count
    finer = msgspec.structs.replace(body, elements=max(MORE * body.elements, count + attached))
    count = min(count, available_modes(finer) - attached)
    ratio = body.modes.damping_ratio
    if isinstance(ratio, tuple):
        ratio = (*ratio, *[ratio[-1]] * (count - body.modes.count))
    modes = msgspec.structs.replace(body.modes, count=count, damping_ratio=ratio)
    return msgspec.structs.replace(finer, modes=modes)


def _more_strains(body: BeamBody) -> BeamBody:
    more = {strain: min(MORE * count, MOST_POLYNOMIALS) for strain, count in polynomials(body).items()}
    modes = msgspec.structs.replace(body.modes, polynomials=StrainPolynomials(**more), points=None)
    ratio = modes.damping_ratio
    if isinstance(ratio, tuple):
        count = sum(more.values()) * piece_count(body)
        modes = msgspec.structs.replace(modes, damping_ratio=(*ratio, *[ratio[-1]] * (count - len(ratio))))
    return msgspec.structs.replace(body, modes=modes)


def _moved(state: ModalState, scene: Scene, finer: dict[str, BeamBody]) -> ModalState:
    """The same shape and speed of deformation in the modes of the finer beam."""
    if state.body not in finer:
        return state
    coarse = next(body for body in scene.bodies if body.name == state.body and _bends(body))
    across = _across(coarse, finer[state.body])
    return ModalState(
        body=state.body, coordinates=tuple((across @ state.coordinates).tolist()),
        rates=tuple((across @ state.rates).tolist()) if state.rates else (),
    )  # fmt: skip


def _across(coarse: BeamBody, fine: BeamBody) -> Real:
    """(fine, coarse) modal coordinates of the finer beam for unit coordinates of the other, by least squares."""
    shapes = []
    count = SEEN_AT * (mode_count(fine) + 2)
    for body in (coarse, fine):
        nodes = tuple(BeamNode(name=f"seen {i}", x_m=i / count * body.length_m) for i in range(1, count + 1))
        found = flexible_model(msgspec.structs.replace(body, nodes=nodes)).nodes
        length = body.length_m
        rows = [np.vstack([found[n.name].translation, length * found[n.name].rotation_modes]) for n in nodes]
        shapes.append(np.concatenate(rows))
    solved: Real = np.linalg.lstsq(shapes[1], shapes[0], rcond=None)[0]
    return solved


def _embedding(model: LinearModel, finer: LinearModel, scene: Scene) -> Real:
    """(n_fine, n) displacements of the finer model for unit displacements of the other, by their names.

    Coordinates that are independent in the finer model of a closed chain may depend on others here.
    """
    modal = dict[str, Real]()
    for body in scene.bodies:
        if _bends(body):
            across = _across(body, _finer(body))
            coarse = model.displacements_by([f"{body.name}.mode[{n}]" for n in range(across.shape[1])])
            modal |= {f"{body.name}.mode[{n}]": row for n, row in enumerate(across @ coarse)}
    others = [name for name in finer.displacements if name not in modal]
    rows = modal | dict(zip(others, model.displacements_by(others), strict=True))
    return np.array([rows[name] for name in finer.displacements])
