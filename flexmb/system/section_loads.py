"""Loads across the sections of a beam, by the momentum balance of the part beyond each section.

A section transmits the rate of momentum of the points beyond it, less gravity and the loads that act on that part:
loads at nodes, wheels, connectors, outboard bodies and closures. In statics this is exact with any number of modes, and
at the root it is the load across the hinge. Loads from the modes' curvature converge slowly, if at all: no clamped
eigenmode has a shear force at its tip.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol, assert_never

import numpy as np

from flexmb.building.connector_arrays import between_nodes
from flexmb.building.links import closure_sides
from flexmb.modal.beam_sections import BeamSections, ByShapes, ByStrains, beam_sections
from flexmb.modal.flexible_model import SecondOrder
from flexmb.scene.bodies import BeamBody
from flexmb.scene.problems import SceneWarning
from flexmb.scene.sections import ABOUT_Y, ABOUT_Z, EXTENSION, TWIST
from flexmb.scene.tree import place_along
from flexmb.system.applied import applied_to
from flexmb.system.frames import MotionTables, Pose, body_pose, closure_frames_of, hinge_frames_of, link_pose
from flexmb.system.moved_sections import cross, moved_sections, rotation_along, turning
from flexmb.system.observables import Evaluation
from flexmb.system.scene_arrays import SceneArrays
from flexmb.tables import arguments
from flexmb.tables.arrays import Workspace
from flexmb.tables.state import finite_result
from flexmb.typing import Real


@dataclass(frozen=True, eq=False)
class SectionLoads:
    """Loads across the sections at x (X,) m of a beam, of one state or of T times.

    load (...,X,6) [torque; force] of the part before the section on the part beyond it (toward x = length), about the
    deformed axis there, in axes that turn with the section: as across a hinge. Masses and loads at x itself count as
    beyond it.
    The properties below have the signs of structures: what the part beyond exerts on the face that looks along +x, so
    that tension is positive. EA (X,) N, EIy, EIz, GJ (X,) N m² are the beam's there. stiffness (X,6,6): all of it about
    the axis, where sections are matrices or stated off the axis; EA and the others are then its diagonal.
    """

    body: str
    x: Real
    load: Real
    EA: Real
    EIy: Real
    EIz: Real
    GJ: Real
    stiffness: Real | None = None

    def __post_init__(self) -> None:
        """TypeError or ValueError for arrays that do not fit together; checked again before they are used."""
        self._refuse_torn()

    def _refuse_torn(self) -> None:
        arguments.held("x", self.x, (None,))
        for name in ("EA", "EIy", "EIz", "GJ"):
            arguments.held(name, getattr(self, name), self.x.shape)
            arguments.finite(name, getattr(self, name))
        if self.stiffness is not None:
            arguments.held("stiffness", self.stiffness, (*self.x.shape, 6, 6))
        more = getattr(self.load, "shape", ())[:-2]
        arguments.held("load", self.load, (*more, len(self.x), 6))

    @property
    def axial(self) -> Real:
        """(...,X) N, positive in tension."""
        return 0.0 - self.load[..., 3]

    @property
    def shear(self) -> Real:
        """(...,X,2) N along the section's y and z."""
        return 0.0 - self.load[..., 4:]

    @property
    def torsion(self) -> Real:
        """(...,X) N m about the section's x."""
        return 0.0 - self.load[..., 0]

    @property
    def bending(self) -> Real:
        """(...,X,2) N m about the section's y and z."""
        return 0.0 - self.load[..., 1:3]

    @property
    def strain(self) -> Real:
        """(...,X,6) [extension, shear y, shear z, twist 1/m, curvature y, curvature z 1/m] of the axis under the loads.

        Shear is zero where the beam has none.
        """
        self._refuse_torn()
        force = 0.0 - np.concatenate([self.load[..., 3:], self.load[..., :3]], axis=-1)
        if self.stiffness is None:
            none = np.zeros_like(self.EA)
            return force * np.stack([1 / self.EA, none, none, 1 / self.GJ, 1 / self.EIy, 1 / self.EIz], axis=-1)
        finite = np.isfinite(np.diagonal(self.stiffness, axis1=1, axis2=2))
        shown = np.einsum("xi,xj->xij", finite, finite)
        compliance = np.where(shown, np.linalg.inv(np.where(shown, self.stiffness, np.eye(6))), 0.0)
        strain: Real = np.einsum("xij,...xj->...xi", compliance, force)
        return strain

    def normal_stress(self, E: float, y: float, z: float) -> Real:
        """(...,X) Pa, tension positive, in the fibre at y, z (m) of the section, with Young's modulus E (Pa).

        E times the strain of the fibre, N/EA + z My/EIy - y Mz/EIz where the section couples nothing.
        """
        strain = self.strain
        E, y, z = arguments.number("E", E), arguments.number("y", y), arguments.number("z", z)
        return E * (strain[..., 0] + z * strain[..., 4] - y * strain[..., 5])

    def torsion_stress(self, G: float, r: float) -> Real:
        """(...,X) Pa of shear at the radius r (m) of a round section or tube with shear modulus G (Pa): G r T / GJ.

        G r times the twist, where the section couples it with other strains.
        """
        return arguments.number("G", G) * arguments.number("r", r) * self.strain[..., 3]


class ExertedLoads(Protocol):
    """What is read here of the loads of a state: see `flexmb.system.observables.Evaluation`."""

    @property
    def loads(self) -> Mapping[str, Real]: ...
    @property
    def wheel_loads(self) -> Mapping[str, Real]: ...
    @property
    def connectors(self) -> Mapping[str, Real]: ...


class LoadsByName(NamedTuple):
    """`ExertedLoads` of one state, (6,) each, or of T of them, (T,6)."""

    loads: dict[str, Real]
    wheel_loads: dict[str, Real]
    connectors: dict[str, Real]


class AllLoads(NamedTuple):
    """All loads on the bodies of a system at time t (s), `exerted`, and a workspace that has their motion.

    Where the motion does not determine all loads, `changes` has for each null load the changes (6,) of the loads of
    hinges and closures by name; changes of `rounding` or less count as zero.
    """

    t: float
    exerted: Evaluation
    motion: Workspace
    changes: Sequence[dict[str, Real]] = ()
    rounding: float = 0.0


class _Outer(NamedTuple):
    """A load on the beam; it acts on the parts beyond the first `beyond` cuts."""

    beyond: int
    wrench: Real  # (6,) [torque about the body's origin; force], body axes


class SectionBalance:
    """Section loads of one beam of a system at fixed cuts, state by state."""

    def __init__(self, arrays: SceneArrays, body: str, x: Any) -> None:
        self._arrays, self.body = arrays, body
        self._beam = _beam(arrays, body)
        if self._beam.mass == "lumped":
            warnings.warn(_lumped(self._beam), SceneWarning, stacklevel=3)
        cuts = arguments.finite("x", np.atleast_1d(arguments.array("x", x)))
        if cuts.ndim != 1 or np.any(cuts < 0.0) or np.any(cuts > self._beam.length_m):
            raise ValueError(f'x: give positions from 0 to {self._beam.length_m:g} m along beam "{body}", in a row')
        self.x = cuts
        self._cuts, self._places = np.unique(cuts, return_inverse=True)
        self._k = arrays.body_names.index(body)
        self.sections = beam_sections(self._beam, self._cuts)

    def at(self, state: AllLoads) -> Real:
        """Loads (X,6) of `SectionLoads` at a state, NaN where the motion does not determine them.

        DynamicsError where a number is not finite.
        """
        t, exerted, w, changes, rounding = state
        loads = finite_result(self.transmitted(exerted, w), t)
        is_open = np.zeros(loads.shape, bool)
        for change in changes:
            other = {name: load + change[name] for name, load in exerted.loads.items()}
            is_open |= np.abs(self.transmitted(replace(exerted, loads=other), w) - loads) > rounding
        return np.where(is_open, np.nan, loads)

    def transmitted(self, exerted: Evaluation, w: MotionTables) -> Real:
        """Loads (X,6) of `SectionLoads` that balance the momentum of a motion and the loads that others exert.

        An analytic function of all these numbers, which may be complex: `flexmb.system.complex_step`.
        """
        arrays, k = self._arrays, self._k
        pose = body_pose(arrays, w, k)
        m = arrays.links[k].mode_count
        eta, etad, etadd = w.eta[k, :m], w.etad[k, :m], w.etadd[k, :m]
        moved, cuts = _moved(self.sections, eta, etad, etadd)
        needed = self._inertial(_motion_in(pose, link_pose(w, k), w, k), moved)
        for outer in self._outer(w, pose, exerted):
            needed[: outer.beyond] -= outer.wrench
        return _in_sections(needed, *cuts)[self._places]

    def loads(self, values: Real) -> SectionLoads:
        """`SectionLoads` with these loads (...,X,6)."""
        s, p = self.sections, self._places
        K = s.stiffness[p]
        EA, EIy, EIz, GJ = (K[:, i, i] for i in (EXTENSION, ABOUT_Y, ABOUT_Z, TWIST))
        return SectionLoads(self.body, self.x, values, EA, EIy, EIz, GJ, None if s.plain else K)

    def _inertial(self, motion: _Motion, moved: _Moved) -> Real:
        """Rate of momentum (X,6), less gravity, of the parts beyond each cut, about the body's origin, body axes."""
        points = self.sections.points
        w, alpha, a = motion
        r = moved.r
        acceleration = a + cross(alpha, r) + cross(w, cross(w, r)) + 2.0 * cross(w, moved.v) + moved.a
        torque = np.zeros_like(r)
        if np.any(points.com_offset) or np.any(points.inertia):
            R, omega, turn = moved.R, w + moved.omega, alpha + moved.alpha + cross(w, moved.omega)
            arm = np.einsum("nab,nb->na", R, points.com_offset)
            J = R @ points.inertia @ np.swapaxes(R, 1, 2)
            r = r + arm
            acceleration = acceleration + cross(turn, arm) + cross(omega, cross(omega, arm))
            torque = np.einsum("nab,nb->na", J, turn) + cross(omega, np.einsum("nab,nb->na", J, omega))
        force = points.mass[:, None] * acceleration
        return np.asarray(self.sections.share @ np.hstack([cross(r, force) + torque, force]))

    def _outer(self, w: MotionTables, pose: Pose, exerted: Evaluation) -> list[_Outer]:
        """All loads on the beam, with their places along it."""
        arrays, k = self._arrays, self._k
        outer: list[_Outer] = []

        def add(node: str, torque: Real, force: Real, point: Real, *, at: bool = True) -> None:
            x = place_along(self._beam, node)
            beyond = int(np.searchsorted(self._cuts, x, side="right" if at else "left"))
            about = torque + cross(point - pose.position, force)
            outer.append(_Outer(beyond, np.concatenate([pose.rotation.T @ about, pose.rotation.T @ force])))

        for n, joined in enumerate(joined_loads(arrays, w, k, exerted)):
            # a section at the beam's own hinge itself, the first of them, transmits its load: the hinge is not beyond
            add(*joined, at=n > 0)
        for applied in applied_to(arrays, w, k):
            add(applied.load.node, applied.torque, applied.force, applied.point)
        return outer


class JoinedLoad(NamedTuple):
    """[torque; force] (3,) each on a body at a node, about a point (3,) m, all in World axes."""

    node: str
    torque: Real
    force: Real
    point: Real


def joined_loads(arrays: SceneArrays, w: MotionTables, k: int, exerted: ExertedLoads) -> Iterator[JoinedLoad]:
    """The loads on body k of all that it is joined to: of its own hinge, which is the first, of hinges, point masses
    and wheels that it carries, of connectors and of closures."""
    loads, wheels, constants, scene = exerted.loads, exerted.wheel_loads, arrays.constants, arrays.scene
    own, body = arrays.links[k], arrays.body_names[k]
    load = loads[own.hinge.name]
    yield JoinedLoad(own.outboard_end.node, load[:3], load[3:], hinge_frames_of(arrays, w, k).point)
    for j in np.flatnonzero(constants.body["parent"] == k).tolist():
        link, load = arrays.links[j], loads[arrays.links[j].hinge.name]
        yield JoinedLoad(link.inboard_end.node, -load[:3], -load[3:], hinge_frames_of(arrays, w, j).point)
    carrier = link_pose(w, k)
    rows = range(int(constants.body[k]["wheel_start"]), int(constants.body[k]["wheel_stop"]))
    for wheel, row in zip((wheel for wheel in scene.wheels if wheel.body == body), rows, strict=True):
        centre = carrier.position + carrier.rotation @ w.port["r"][constants.wheel[row]["port"]]
        yield JoinedLoad(wheel.node, -wheels[wheel.name][:3], -wheels[wheel.name][3:], centre)
    for i, connector in enumerate(between_nodes(scene)):
        load, (body_b, port_b) = exerted.connectors[connector.name], constants.end[i][["body", "port"]][1]
        on = link_pose(w, int(body_b))
        point = constants.end[i]["position"][1] if body_b < 0 else on.position + on.rotation @ w.port["r"][port_b]
        for node, end, sign in ((connector.node_a, connector.body_a, -1.0), (connector.node_b, connector.body_b, 1.0)):
            if end == body:
                yield JoinedLoad(node, sign * load[:3], sign * load[3:], point)
    for i, closure in enumerate(scene.closures):
        for side, sign in zip(closure_sides(closure), (-1.0, 1.0), strict=True):
            if side.body == body:
                load = sign * loads[closure.name]
                yield JoinedLoad(side.node, load[:3], load[3:], closure_frames_of(arrays, w, i).point)


class _Motion(NamedTuple):
    """Angular velocity, angular acceleration, acceleration of the origin less gravity (3,) of a body, its own axes."""

    omega: Real
    alpha: Real
    acceleration: Real


def _motion_in(pose: Pose, link: Pose, w: MotionTables, k: int) -> _Motion:
    """The motion of body k in its frame of the scene, from that of its link frame."""
    turn = pose.rotation.T @ link.rotation
    r = link.rotation.T @ (pose.position - link.position)
    omega, (alpha, a) = w.body["velocity"][k, :3], w.body["accel"][k].reshape(2, 3)
    at_origin = a + cross(alpha, r) + cross(omega, cross(omega, r))
    return _Motion(turn @ omega, turn @ alpha, turn @ at_origin)


class _Moved(NamedTuple):
    """As `flexmb.system.moved_sections.MovedSections`, of inertia points."""

    r: Real
    v: Real
    a: Real
    R: Real
    omega: Real
    alpha: Real


def _moved(s: BeamSections, eta: Real, etad: Real, etadd: Real) -> tuple[_Moved, tuple[Real, Real]]:
    """The inertia points relative to the body; positions (X,3) and axes (X,3,3), section to body, of the cuts."""
    match s.motion:
        case ByShapes(points=points, second=second, sections=shapes, second_sections=second_sections):
            r, v, a = _field(points.translation, second, "translation", eta, etad, etadd)
            turns = turning(*_field(points.rotation, second, "rotation", eta, etad, etadd))
            none = np.zeros_like(eta)
            axis = _field(shapes[:, :3], second_sections, "translation", eta, none, none)[0]
            theta = _field(shapes[:, 3:], second_sections, "rotation", eta, none, none)[0]
            axis[:, 0] += s.x
            return _Moved(points.position + r, v, a, *turns), (axis, rotation_along(theta))
        case ByStrains(field=field, points=at, cuts=cuts, rotation=rotation):
            moved = moved_sections(field, eta, etad, etadd)
            return _Moved(*(quantity[at] for quantity in moved)), (moved.r[cuts], moved.R[cuts] @ rotation)
        case _:
            assert_never(s.motion)


def _in_sections(wrench: Real, axis: Real, R: Real) -> Real:
    """Wrenches (X,6) about the body's origin in body axes, referred to sections at `axis` (X,3) with axes R (X,3,3)."""
    torque = wrench[:, :3] - cross(axis, wrench[:, 3:])
    return np.hstack([np.einsum("nba,nb->na", R, vector) for vector in (torque, wrench[:, 3:])])


def _field(
    shapes: Real, second: SecondOrder | None, part: str, eta: Real, etad: Real, etadd: Real
) -> tuple[Real, Real, Real]:
    """Value, rate and second rate (n,3) of shapes (n,3,m) and, where there is one, a part of a second-order field."""
    value, rate, again = shapes @ eta, shapes @ etad, shapes @ etadd
    if second is not None:
        G = getattr(second, part)
        by_eta = G @ eta
        value, rate = value + 0.5 * by_eta @ eta, rate + by_eta @ etad
        again = again + G @ etad @ etad + by_eta @ etadd
    return value, rate, again


def _lumped(beam: BeamBody) -> str:
    n = beam.elements
    return (
        f'beam "{beam.name}" has its mass lumped at the nodes of {n} elements: at every node the section loads step by '
        f"what an element needs, so that forces are off by up to half of it, {50.0 / n:.2g} % of that at the root "
        f"under an even load, and moments by {25.0 / n**2:.2g} %; they are right half-way between nodes, and "
        'everywhere with mass = "consistent"'
    )


def _beam(arrays: SceneArrays, body: str) -> BeamBody:
    beams = {body.name: body for body in arrays.scene.bodies if isinstance(body, BeamBody)}
    if body not in beams:
        raise ValueError(f'"{body}" is no beam of the scene; these are: {", ".join(beams) or "none"}')
    return beams[body]
