"""Exudyn's beams of finite deflection as an engine of their own: the nonlinear reference for beam scenes.

One beam in a plane has cheaper elements and a model of its own; all other scenes are trees and loops of rigid bodies
and of beams in space.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt

import numpy as np

from crosscheck.engines.contract import Effort, MarkerPath, MarkerSnapshot, Model, Run, Snapshot, Trajectory
from crosscheck.engines.exudyn.beams import PlanarBeam, assemble_beam, axis_sign, floats, root_frame
from crosscheck.engines.exudyn.kkt import initial_state
from crosscheck.engines.exudyn.library import LIBRARY, METHODS
from crosscheck.engines.exudyn.model import ExudynModel
from crosscheck.engines.exudyn.solve import integrate
from crosscheck.engines.exudyn.spatial import fastest_bending, reason, spatial_refusals
from crosscheck.engines.exudyn.state import States
from crosscheck.engines.pace import pace
from crosscheck.engines.peer import PeerEngine
from crosscheck.engines.steps import ladder
from flexmb.scene.hinges import AngularCoordinate, Hinge, LinearCoordinate, Planar, Revolute, Weld
from flexmb.scene.rest_curve import is_curved
from flexmb.scene.schema import BeamBody, Marker, Scene
from flexmb.scene.sections import has_plain_sections
from flexmb.scene.strains import families, polynomials
from flexmb.scene.tree import GROUND, node_frame
from flexmb.typing import Real

PLANAR_STRAINS = {"axial", "shear_y", "bending_y"}
RUNGS, USUAL = 3, 800
"""Of steps, and how many are worth their time at the coarsest: the beam's bending is followed, its axial vibrations
are stepped over."""


class ExudynBeamEngine(PeerEngine):
    """Beams as elements of finite deflection: one in World's x-y plane, or any in space with rigid bodies."""

    name = "exudyn-beam"
    takes = ("connectors",)
    summary = "beams of finite deflection, by beam elements"
    algorithm = "beam elements in redundant coordinates"
    settings = (
        "As many elements as the scene's beams have: one beam in a plane by planar cable elements (shear-flexible ones "
        "where the scene's beam is), all other scenes by geometrically exact elements in space. In Exudyn's own C++ "
        "loop by generalised alpha, with a sensor in Python that takes the state at every sample. Fixed steps follow "
        "the bending; the method damps the axial vibrations that they step over. It is another and richer model than "
        "modes, so its error contains the distance of the models."
    )

    library, methods = LIBRARY, METHODS

    def refusals(self, scene: Scene) -> Iterator[str]:
        return iter(()) if _in_plane(scene) else spatial_refusals(scene)

    def approximations(self, scene: Scene) -> Iterator[str]:
        """All scenes: it is another model of the beam than its modes, and a richer one."""
        yield "a planar beam of finite deflection instead of modes" if _in_plane(scene) else reason(scene)

    def efforts_for(self, scene: Scene, duration_s: float) -> tuple[Effort, ...]:
        """Three steps, with the scene's number of elements; generalised-alpha damps the axial vibrations it skips."""
        fastest = _first_bending(scene) if _in_plane(scene) else fastest_bending(scene)
        return ladder("GeneralizedAlpha", pace(scene, duration_s, fastest), duration_s, RUNGS, USUAL)

    def model(self, scene: Scene) -> Model:
        """The mesh has as many elements as the scene's beams."""
        if _in_plane(scene):
            return BeamModel(assemble_beam(scene, scene.bodies[0].elements))
        return ExudynModel(scene)


def _in_plane(scene: Scene) -> bool:
    """Whether the planar elements can run the scene."""
    return next(_refusals(scene), None) is None


def _first_bending(scene: Scene) -> float:
    """Frequency (rad/s) of the first bending of the beam, clamped or free, by its first station."""
    beam, root = scene.bodies[0], scene.hinges[0]
    assert isinstance(beam, BeamBody)
    station = beam.stations[0]
    number = 22.37 if floats(root) else 3.516
    return number / beam.length_m**2 * sqrt(station.EIz_Nm2 / station.mass_per_length_kg_m)


def _refusals(scene: Scene) -> Iterator[str]:
    """Why the scene is not one of a planar beam."""
    if len(scene.bodies) != 1 or not isinstance(scene.bodies[0], BeamBody):
        yield "it takes scenes with one beam and nothing else"
        return
    beam, hinge = scene.bodies[0], scene.hinges[0]
    if scene.wheels or scene.point_masses or scene.constraints or scene.connectors or beam.tip_masses:
        yield "it takes a bare beam: no wheels, point masses, tip masses, closures or connectors"
    for load in scene.loads:
        if load.frame != "world":
            yield f'load "{load.name}" turns with its node: it takes loads in World axes'
        elif any(load.direction[:2]) if load.type == "torque" else load.direction[2]:
            yield f'load "{load.name}" acts out of the plane'
    if scene.modal_states:
        yield "initial modal coordinates have no meaning here"
    if scene.gravity_m_s2[2]:
        yield "gravity pulls out of the plane"
    yield from _mode_refusals(beam)
    if not has_plain_sections(beam):
        yield (
            "its elements have EA, EI and GA on the axis alone: a section that is a matrix, or stated off the axis, "
            'couples them; compare with engine "exudyn" after the beam is made points and modes'
        )
        return
    if beam.theory == "timoshenko" and any(station.GAy_N is None for station in beam.stations):
        yield "a shear-flexible beam needs GAy_N at every station"
    if beam.level == "rigid":
        yield "the beam is rigid in this scene"
    yield from _hinge_refusals(beam, hinge)


def _mode_refusals(beam: BeamBody) -> Iterator[str]:
    if beam.level == "exact":
        if beyond := set(polynomials(beam)) - PLANAR_STRAINS:
            yield f"it is planar, and the beam has polynomials of {', '.join(sorted(beyond))}"
        if is_curved(beam):
            yield f'its elements are straight, and beam "{beam.name}" is curved where it is not loaded'
    elif set(families(beam)) - {"bending_y", "axial"}:
        yield 'it is planar: the beam may want the families "bending_y" and "axial" only'
    if np.any(beam.modes.damping_ratio) or beam.modes.viscosity_s:
        yield "it has no modal damping, and none by the rate of strain"


def _hinge_refusals(beam: BeamBody, hinge: Hinge) -> Iterator[str]:
    if hinge.parent != GROUND or not isinstance(hinge, Revolute | Weld | Planar):
        yield "the beam must be hinged (revolute, planar) or welded to the ground"
        return
    if node_frame(beam, hinge.child_node).position[0] != 0.0 or any(hinge.child_position_m):
        yield "the hinge must be at the root of the beam"
    if abs(root_frame(beam, hinge).rotation[2, 2] - 1.0) > 1e-12:
        yield "the beam's x-y plane must be World's x-y plane"
    if isinstance(hinge, Revolute):
        turned = root_frame(beam, hinge).rotation @ np.array(hinge.axis)
        if abs(abs(turned[2]) - 1.0) > 1e-12:
            yield "the hinge axis must be World z"
        if not _bare(hinge.rotation, "prescribed_rad"):
            yield "the hinge may be free or prescribed, without spring, damper or motor"
    if isinstance(hinge, Planar) and not all(map(_bare, (hinge.x, hinge.y, hinge.rotation))):
        yield "a beam that moves in the plane must do so without spring, damper, motor or prescribed motion"


def _bare(coordinate: AngularCoordinate | LinearCoordinate, *given: str) -> bool:
    """Whether nothing but its initial value and rate, or the keys `given`, is set."""
    keys = set(coordinate.__struct_fields__) - {"angle_rad", "rate_rad_s", "position_m", "rate_m_s", *given}
    return all(getattr(coordinate, key) == getattr(type(coordinate)(), key) for key in keys)


class BeamModel:
    def __init__(self, beam: PlanarBeam) -> None:
        self.beam = beam

    def warm_up(self) -> None:
        """Nothing to compile."""

    def evaluate(self) -> Snapshot:
        states = initial_state(self.beam)
        markers = {}
        for marker in self.beam.scene.markers:
            path, acceleration = self._marker(marker, states)
            markers[marker.name] = MarkerSnapshot(
                path.position[0], path.quaternion[0], path.velocity[0], acceleration[0]
            )
        loads = {name: values[0] for name, values in self._loads(states).items()}
        drives = {name: values[0] for name, values in self._drives(states).items()}
        return Snapshot(markers, loads, {}, drives, {}, None)

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        solution = integrate(self.beam, run.times, effort)
        states = solution.states
        states.multipliers[:1] = initial_state(self.beam).multipliers
        return Trajectory(
            status=solution.status, message=solution.message, times=run.times[: len(states.times)],
            markers={marker.name: self._marker(marker, states)[0] for marker in self.beam.scene.markers},
            loads=self._loads(states), drives=self._drives(states), wall_s=solution.wall_s,
            evaluations=solution.evaluations, steps=solution.steps,
        )  # fmt: skip

    def _multiplier(self, states: States, hold: int) -> Real:
        return states.multipliers[:, self.beam.shop.mbs.systemData.GetObjectLTGAE(self.beam.holds[hold])[0]]

    def _loads(self, states: States) -> dict[str, Real]:
        """(T,6) [torque; force] on the beam about the hinge point: what holds the massless hub."""
        load = np.zeros((len(states.times), 6))
        for hold, column in zip(range(len(self.beam.holds)), (3, 4, 2), strict=False):
            load[:, column] = -self._multiplier(states, hold)
        return {self.beam.scene.hinges[0].name: load}

    def _drives(self, states: States) -> dict[str, Real]:
        hinge = self.beam.scene.hinges[0]
        if not self.beam.prescribed:
            return {}
        return {hinge.name: -axis_sign(hinge) * self._multiplier(states, 2)[:, None]}

    def _marker(self, marker: Marker, states: States) -> tuple[MarkerPath, Real]:
        """Motion of a section plus offset, and its spatial acceleration (T,6), zeros where the states have none."""
        beam, T = self.beam, len(states.times)
        rest = node_frame(beam.scene.bodies[0], marker.node)
        node = beam.nodes[int(np.argmin(np.abs(beam.stations - rest.position[0])))]
        first, size = beam.shop.mbs.GetNodeODE2Index(node), 3 if beam.sheared else 4
        reference = np.array(beam.shop.mbs.GetNodeParameter(node, "referenceCoordinates"))
        q = states.q[:, first : first + size] + reference
        v = states.v[:, first : first + size]
        a = np.zeros_like(v) if states.a is None else states.a[:, first : first + size]
        angle, rate, second = self._turn(q, v, a)
        offset = np.array(marker.offset_m)
        arm = np.stack(
            [
                np.cos(angle) * offset[0] - np.sin(angle) * offset[1],
                np.sin(angle) * offset[0] + np.cos(angle) * offset[1],
            ],
            axis=1,
        )
        normal = np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        position = np.column_stack([q[:, :2] + arm, np.full(T, beam.height + offset[2])])
        zero = np.zeros(T)
        linear = v[:, :2] + rate[:, None] * normal
        classical = a[:, :2] + second[:, None] * normal - rate[:, None] ** 2 * arm
        velocity = np.column_stack([zero, zero, rate, linear, zero])
        acceleration = np.column_stack([zero, zero, second, classical, zero])
        quaternion = np.column_stack([np.cos(angle / 2.0), zero, zero, np.sin(angle / 2.0)])
        return MarkerPath(position, quaternion, velocity), acceleration

    def _turn(self, q: Real, v: Real, a: Real) -> tuple[Real, Real, Real]:
        """Angle of the section (rad), its rate and acceleration."""
        if self.beam.sheared:
            return q[:, 2], v[:, 2], a[:, 2]
        s, s_rate, s_second = q[:, 2:], v[:, 2:], a[:, 2:]
        square = np.sum(s * s, axis=1)
        rate = _cross(s, s_rate) / square
        second = _cross(s, s_second) / square - 2.0 * rate * np.sum(s * s_rate, axis=1) / square
        return np.unwrap(np.arctan2(s[:, 1], s[:, 0])), rate, second


def _cross(a: Real, b: Real) -> Real:
    """z component of a x b for (T,2) vectors."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
