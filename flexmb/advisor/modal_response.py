"""Response of the modes of flexible bodies to the motion of the scene with all bodies rigid.

One run of the rigid scene gives the motion of every body and the loads at its nodes. In body axes, with the body's
motion w, alpha, a (less gravity) and loads tau, f at its nodes, mode n is driven by

    Q_n = -sum_j m phi_jn . (a + alpha x r_j + w x (w x r_j)) + sum_nodes (psi_n . tau + phi_n . f)

and obeys etadd + 2 zeta omega etad + omega^2 eta = Q_n, which is solved exactly for Q_n linear between the output
times. This accounts for effective masses, participation and the bandwidth of the excitation. It neglects the reaction
of the deformation on the rest of the scene, and second-order effects.
"""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import replace as changed
from functools import lru_cache

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray
from scipy.linalg import eigh, expm
from scipy.spatial.transform import Rotation

from flexmb.advisor.methods import RunMethod, simulated
from flexmb.closure.closures import ClosureError
from flexmb.dense.jets import profile
from flexmb.frisch.normalisation import combined
from flexmb.modal import flexible_model
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import modal_integrals
from flexmb.run.trajectory import Trajectory
from flexmb.scene.bodies import BeamBody, ModalBody
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.schema import Load, Marker, Scene
from flexmb.scene.tree import GROUND, node_frame
from flexmb.surrogate import rigidify
from flexmb.system.compile import compile
from flexmb.system.system import System
from flexmb.typing import Real

MODES = 12
FAMILIES = ("axial", "bending_y", "bending_z", "torsion")
_RTOL = 1e-8


@dataclass(frozen=True)
class RigidRun:
    """The scene with all flexible bodies rigid: its system and run, with a marker on every body and hinge frame."""

    scene: Scene
    system: System
    run: Trajectory

    def own(self) -> Trajectory:
        """The run without the additional markers."""
        extra = {_body(b.name) for b in self.scene.bodies} | {_hinge(h.name) for h in self.scene.hinges}
        return changed(self.run, markers={k: path for k, path in self.run.markers.items() if k not in extra})

    def frame(self, body: str) -> tuple[Real, Real]:
        """World positions (T,3) and rotations (T,3,3) body -> World of a body's frame."""
        path = self.run.markers[_body(body)]
        return path.position, Rotation.from_quat(path.quaternion, scalar_first=True).as_matrix()

    def hinge_point(self, hinge: str) -> Real:
        """World positions (T,3) of a hinge's outboard point."""
        return self.run.markers[_hinge(hinge)].position


@dataclass(frozen=True)
class ModalResponse:
    """Modal response of one body with m eigenmodes: `model` in them, of unit modal mass; `frequencies` (m,) rad/s;
    `family` (m,) index of what moves most, as in `FAMILIES`, or -1; force Q (T,m), eta, etad, etadd (T,m); motion of
    the body (T,3) in body axes: `w`, `alpha`, `acceleration` less gravity; `loads`: (node, torque, force) (T,3)."""

    body: BeamBody | ModalBody
    model: FlexibleModel
    frequencies: Real
    family: NDArray[np.intp]
    force: Real
    eta: Real
    etad: Real
    etadd: Real
    w: Real
    alpha: Real
    acceleration: Real
    loads: tuple[tuple[str, Real, Real], ...]


def rigid_run(scene: Scene, times: Real) -> RigidRun | str:
    """The run of the rigid scene, or the reason why it fails: a mechanism may be locked without flexibility."""
    still = rigidify(scene)
    extra = [Marker(name=_body(b.name), body=b.name) for b in still.bodies]
    extra += [
        Marker(name=_hinge(h.name), body=h.child, node=h.child_node, offset_m=h.child_position_m) for h in still.hinges
    ]
    try:
        system = compile(replace(still, markers=(*still.markers, *extra)))
        run = simulated(system, times, RunMethod("dop853", _RTOL))
    except (ClosureError, ValueError, NotImplementedError) as error:
        return f"all bodies rigid: {error}"
    return RigidRun(still, system, run) if run.finished else f"all bodies rigid: {run.message}"


def modal_response(rigid: RigidRun, scene: Scene, body: BeamBody | ModalBody) -> ModalResponse:
    """The response of the eigenmodes of `body`: the lowest `MODES` of a beam, all of a raw body."""
    model = eigenmodes(body)
    path = rigid.run.markers[_body(body.name)]
    _, turn = rigid.frame(body.name)
    w, alpha = _into(turn, path.velocity[:, :3]), _into(turn, path.acceleration[:, :3])
    acceleration = _into(turn, path.acceleration[:, 3:] - np.array(scene.gravity_m_s2))
    loads = tuple(_loads(rigid, scene, body, turn))
    momentum, angular = momenta(model)
    centre = model.position + model.com_offset
    spread = np.einsum("p,pim,pj->mij", model.mass, mass_shapes(model), centre)  # sum m phi_n r'
    force = -(acceleration @ momentum + alpha @ angular)
    force -= np.einsum("ti,tj,mij->tm", w, w, spread) - np.sum(w**2, axis=1)[:, None] * np.einsum("mii->m", spread)
    for node, torque, push in loads:
        at = model.nodes[node]
        force += torque @ at.rotation_modes + push @ at.translation
    omega = np.sqrt(np.maximum(np.diag(model.stiffness), 0.0))
    eta, etad = _oscillators(omega, np.diag(model.damping), force, rigid.run.t, _initial(scene, body, model))
    etadd = force - eta * omega**2 - etad * np.diag(model.damping)
    return ModalResponse(body, model, omega, _families(model), force, eta, etad, etadd, w, alpha, acceleration, loads)


def eigenmodes(body: BeamBody | ModalBody) -> FlexibleModel:
    """The body's eigenmodes with unit modal mass, lowest first; of a beam up to `MODES`, whatever its scene has, unless
    it has strains in their place."""
    if isinstance(body, BeamBody):
        return flexible_model(body) if body.level == "exact" else _beam(replace(body, name="beam", level="full"))
    model = flexible_model(body)
    m = model.mode_count
    return combined(model, eigh(model.stiffness, modal_integrals(model).spatial_mass[:m, :m])[1])


@lru_cache(maxsize=64)
def _beam(beam: BeamBody) -> FlexibleModel:
    ratio = beam.modes.damping_ratio
    for count in range(max(MODES, beam.modes.count), 0, -1):
        listed = (*ratio, *[ratio[-1]] * count)[:count] if isinstance(ratio, tuple) else ratio
        try:
            return flexible_model(
                replace(beam, modes=replace(beam.modes, count=count, static=False, damping_ratio=listed))
            )
        except ValueError:  # fewer modes with inertia than that
            continue
    raise ValueError(f'beam "{beam.name}" has no mode')


def mass_shapes(model: FlexibleModel) -> Real:
    """Mode shapes (n,3,m) of the points' mass centres."""
    return model.translation + np.cross(model.rotation, model.com_offset[:, :, None], axis=1)


def momenta(model: FlexibleModel) -> tuple[Real, Real]:
    """Linear and angular momenta (3,m) of the modes about the origin, body axes: sum m phi and sum m r x phi."""
    centre, shapes = model.position + model.com_offset, mass_shapes(model)
    arms = np.cross(centre[:, :, None], shapes, axis=1)
    return np.einsum("p,pim->im", model.mass, shapes), np.einsum("p,pim->im", model.mass, arms)


def _families(model: FlexibleModel) -> NDArray[np.intp]:
    """What each mode does most to the tip of a beam; of a raw body the axis along which it moves most mass."""
    if (tip := model.nodes.get("tip")) is not None and tip.position[0] > 0.0:
        return np.argmax(np.abs([*tip.translation, tip.position[0] * tip.rotation_modes[0]]), axis=0)
    moved = np.einsum("p,pim->im", model.mass, mass_shapes(model) ** 2)
    return np.argmax(moved, axis=0)


def _oscillators(omega: Real, damping: Real, force: Real, times: Real, start: Real) -> tuple[Real, Real]:
    """eta and etad (T,m) of etadd + damping etad + omega^2 eta = force (T,m), linear between equally spaced times."""
    step = times[1] - times[0]
    chain = np.zeros((len(omega), 4, 4))  # of [eta, etad, force, its change in a step], in steps
    chain[:, 0, 1] = chain[:, 1, 2] = step
    chain[:, 1, 0], chain[:, 1, 1] = -step * omega**2, -step * damping
    chain[:, 2, 3] = 1.0
    forward = expm(chain)[:, :2]
    states = np.empty((len(times), len(omega), 2))
    states[0] = start
    for k, change in enumerate(np.diff(force, axis=0)):
        now = np.column_stack([states[k], force[k], change])
        states[k + 1] = np.einsum("mij,mj->mi", forward, now)
    return states[:, :, 0], states[:, :, 1]


def _initial(scene: Scene, body: BeamBody | ModalBody, model: FlexibleModel) -> Real:
    """Initial eta and etad (m,2)."""
    start = np.zeros((model.mode_count, 2))
    state = next((state for state in scene.modal_states if state.body == body.name), None)
    if state is not None:
        # At level stiffened, equivalent masses would replace the points that both models have at level full.
        own = flexible_model(body if body.level == "exact" else replace(body, level="full"))
        onto = np.einsum("p,pim,pin->mn", own.mass, mass_shapes(model), mass_shapes(own), optimize=True)
        start[:, 0] = onto @ np.array(state.coordinates)
        start[:, 1] = onto @ np.array(state.rates or [0.0] * own.mode_count)
    return start


def _loads(rigid: RigidRun, scene: Scene, body: BeamBody | ModalBody, turn: Real) -> list[tuple[str, Real, Real]]:
    """Loads of hinges, wheels, point masses, connectors and at nodes on the body: (node, torque, force), body axes."""
    origin, _ = rigid.frame(body.name)
    model = eigenmodes(body)
    found = []

    def add(node: str, point: Real, load: Real, sign: float) -> None:
        arm = point - origin - np.einsum("tij,j->ti", turn, model.nodes[node].position)
        force = sign * load[:, 3:]
        found.append((node, _into(turn, sign * load[:, :3] + np.cross(arm, force)), _into(turn, force)))

    for hinge in scene.hinges:
        if hinge.parent == body.name:
            across = np.nan_to_num(rigid.run.loads[hinge.name])  # NaN: statically indeterminate with rigid bodies
            add(hinge.parent_node, rigid.hinge_point(hinge.name), across, -1.0)
    for key, loads in (("point_masses", rigid.run.loads), ("wheels", rigid.run.wheel_loads)):
        for item in getattr(scene, key):
            if item.body == body.name:
                at = model.nodes[item.node]
                point = origin + np.einsum("tij,j->ti", turn, at.position + at.rotation @ np.array(item.offset_m))
                add(item.node, point, loads[item.name], -1.0)
    for connector in scene.connectors:
        if isinstance(connector, BetweenNodes):
            for side, sign in (("a", -1.0), ("b", 1.0)):
                if getattr(connector, f"body_{side}") == body.name:
                    point = _acting_on(rigid, scene, connector)
                    add(getattr(connector, f"node_{side}"), point, rigid.run.connectors[connector.name], sign)
    for load in scene.loads:
        if load.body == body.name:
            at = model.nodes[load.node]
            point = origin + np.einsum("tij,j->ti", turn, at.position)
            add(load.node, point, _given(load, rigid.run.t, turn @ at.rotation), 1.0)
    return found


def _acting_on(rigid: RigidRun, scene: Scene, connector: BetweenNodes) -> Real:
    """World positions (T,3) of frame B of a connector, to which its load refers."""
    offset = np.array(connector.position_b_m)
    if connector.body_b == GROUND:
        return np.tile(offset, (len(rigid.run.t), 1))
    node = node_frame(next(body for body in scene.bodies if body.name == connector.body_b), connector.node_b)
    origin, turn = rigid.frame(connector.body_b)
    return origin + np.einsum("tij,j->ti", turn, np.array(node.position) + rotation_matrix(node.quaternion) @ offset)


def _given(load: Load, times: Real, turn: Real) -> Real:
    """A load of the scene over time (T,6), World axes; `turn` (T,3,3) node -> World."""
    size = np.array([float(profile(load.function, t).value) for t in times])
    direction = np.array(load.direction)
    along = np.einsum("tij,j->ti", turn, direction) if load.frame == "node" else direction
    wrench = np.zeros((len(times), 6))
    wrench[:, slice(3, 6) if load.type == "force" else slice(0, 3)] = size[:, None] * along
    return wrench


def _into(turn: Real, vectors: Real) -> Real:
    """World components (T,3) turned to body axes."""
    return np.einsum("tji,tj->ti", turn, vectors)


def _body(name: str) -> str:
    return f"frame of body {name}"


def _hinge(name: str) -> str:
    return f"frame of hinge {name}"
