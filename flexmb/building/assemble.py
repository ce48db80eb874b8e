"""From links to the arrays of flexmb.tables.arrays: bodies, ports, wheels, loads, springs, functions of time."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TypeVar

import numpy as np

from flexmb.building.connector_arrays import connector_arrays
from flexmb.building.inertia_arrays import group, inertia_arrays, second_order_rows, shape_rows
from flexmb.building.links import BodyLink, Port
from flexmb.building.numbering import Numbering
from flexmb.building.ports import attached, inboard_frames_and_ports
from flexmb.building.section_arrays import section_arrays
from flexmb.hinges.catalogue import KINDS
from flexmb.jit.strips import whole
from flexmb.levels.body import LEVELS
from flexmb.levels.rigid import LEVEL as RIGID
from flexmb.scene import schema as s
from flexmb.tables import arrays as a
from flexmb.tables.features import as_asked
from flexmb.tables.functions import pack
from flexmb.typing import Real, Record


def moved_inertia(body: Record, port: Record, mff: Real, wheel: Record, speeds: int) -> Real:
    """(speeds,) mass (kg) or moment of inertia (kg m^2) of all that a hinge's speed moves; modal masses at rest.

    The tables are those of `flexmb.tables.arrays.Constants`. Moments of inertia are about the hinge, for a chain that
    is stretched out and whose sliding hinges are at zero.
    """
    parent, kind, nv, speed = (body[key].tolist() for key in ("parent", "hinge_kind", "nv", "u_index"))
    mass, inertia = body["rigid"][:, 0].tolist(), np.sum(body["rigid"][:, 4:7], axis=1).tolist()
    distance = np.append(np.linalg.norm(port["position"] + port["offset"], axis=1), 0.0)  # the last is for no port, -1
    to_hinge = distance[body["outboard_port"]].tolist()
    placed = np.linalg.norm(body["placement_position"], axis=1)
    arm = np.where(body["inboard_port"] >= 0, distance[body["inboard_port"]], placed).tolist()
    moved = np.zeros(speeds)
    for k in range(len(parent) - 1, -1, -1):
        about_hinge = _about(inertia[k], mass[k], to_hinge[k])
        linear = KINDS[kind[k]].displacements
        for n in range(nv[k]):
            moved[speed[k] + n] = mass[k] if n in linear else about_hinge
        if parent[k] >= 0:
            mass[parent[k]] += mass[k]
            inertia[parent[k]] += _about(about_hinge, mass[k], arm[k])
    for k in np.flatnonzero(body["modes"]):
        first, n = body["etad_index"][k], body["modes"][k]
        by_strain = body["section_stop"][k] > body["section_start"][k]  # unit masses at rest, all of summed points
        moved[first : first + n] = 1.0 if by_strain else np.diagonal(mff[k])[:n]
    moved[wheel["u_index"]] = wheel["axial"]
    return moved


def _about(inertia: float, mass: float, distance: float) -> float:
    """Upper bound of the moment of inertia about a point at a distance, whatever the direction of the mass centre."""
    return (sqrt(inertia) + sqrt(mass) * distance) ** 2


# A pivot below this share of the inertia that its speed moves may consist of rounding errors (docs/notation.md); the
# pivots of sound chains of hundreds of bodies are larger.
DOUBTFUL = 2.0**-33

Item = TypeVar("Item", s.Wheel, s.Load)


class Functions:
    """Numbers the functions of time of a scene; equal functions share a number unless they are kept `apart`."""

    def __init__(self, apart: bool = False) -> None:
        self._apart = apart
        self._number: dict[s.Function, int] = {}
        self._all: list[s.Function] = []
        self.shared = False
        """Whether two have a number in common."""

    def number(self, function: s.Function | None) -> int:
        if function is None:
            return -1
        if self._apart or function not in self._number:
            self._number[function] = len(self._all)
            self._all.append(function)
        else:
            self.shared = True
        return self._number[function]

    def all(self) -> list[s.Function]:
        return self._all


@dataclass(frozen=True)
class Assembled:
    """The arrays of a scene, and (body, port) of its markers and closures; (-1, -1) for a port on the ground."""

    constants: a.Constants
    markers: dict[str, tuple[int, int]]  # by name
    closures: list[tuple[int, int]]  # sides A and B of the first, of the second ...
    signals: dict[int, s.ControlSignal]  # the functions that controllers drive, by their numbers
    shares: bool  # whether equal functions of time share a number


def assemble(
    scene: s.Scene,
    chain: list[BodyLink],
    numbering: Numbering,
    *,
    null_partitions: bool = False,
    like: s.Scene | None = None,
) -> Assembled:
    """The arrays of a scene, from its links and the places of its coordinates.

    With `null_partitions`, inboard hinge frames at nodes that do not deform also get a port, so that the terms that
    vanish for them are computed nevertheless. `like`: the same scene with slightly other numbers (see
    `flexmb.building.links.links`); equal functions of time are then kept apart, because those of `like` may differ.
    """
    index = {link.name: k for k, link in enumerate(chain) if not isinstance(link.body, s.PointMass)}
    parent = [index.get(link.parent, -1) for link in chain]
    wheels, loads = _by_body(scene.wheels, index), _by_body(scene.loads, index)
    placement, hinges = inboard_frames_and_ports(chain, parent, null_partitions)
    ports_by_body, at = attached(scene, chain, index, hinges, wheels, loads, like)
    ports = [port for ports in ports_by_body for port in ports]

    m = whole(max((link.mode_count for link in chain), default=0))
    inertia, points, of_points = inertia_arrays(chain, m)
    port_rows, of_ports = second_order_rows([port.node.second for port in ports], 0, m)
    points["point"]["second"], of_points = second_order_rows(of_points, len(of_ports), m)

    body = inertia.pop("body")
    body["parent"] = parent
    _describe(body, chain, numbering)
    body["inboard_port"], body["outboard_port"] = at.inboard, at.outboard
    body["placement_position"], body["placement_rotation"] = placement.p, placement.R.reshape(-1, 9)
    group(body, "port", [len(ports) for ports in ports_by_body])
    for name, items in (("wheel", wheels), ("load", loads)):
        group(body, name, np.bincount(np.array([index[item.body] for item in items], int), minlength=len(chain)))
    _mark_first_contributions(body)

    functions = Functions(apart=like is not None)
    speed = _speeds(chain, wheels, numbering, functions, body)
    load = _loads(loads, at.loads, functions)
    connected = connector_arrays(scene, at.connectors, numbering, functions.number)
    function, table = pack(functions.all())
    port, wheel = _ports(ports, port_rows), _wheels(wheels, at.wheels, numbering)
    sections = section_arrays(chain, ports_by_body, body, points["point"], port, m)
    moved = moved_inertia(body, port, inertia["mff"], wheel, len(speed))
    speed["doubtful"] = DOUBTFUL * (moved + speed["armature"])
    constants = a.Constants(
        gravity=np.array(scene.gravity_m_s2, float),
        body=body,
        port=port,
        port_mode=shape_rows([(p.node.rotation_modes, p.node.translation) for p in ports], m),
        second_shape=np.concatenate([of_ports, of_points]),
        wheel=wheel,
        load=load,
        speed=speed,
        function=function,
        table=table,
        kernels=as_asked(),
        **connected,
        **inertia,
        **points,
        **sections,
    )
    signals = {
        number: function for number, function in enumerate(functions.all()) if isinstance(function, s.ControlSignal)
    }
    return Assembled(constants, at.markers, at.closures, signals, functions.shared)


def _by_body(items: tuple[Item, ...], index: dict[str, int]) -> list[Item]:
    """The items in the order of their bodies, and within a body in the order of the scene."""
    return sorted(items, key=lambda item: index[item.body])


def _describe(body: a.Record, chain: list[BodyLink], numbering: Numbering) -> None:
    """Write the kinds and parameters of bodies and hinges, and the places of their coordinates and speeds."""
    body["level"] = [LEVELS.index(link.level) for link in chain]
    body["modes"] = [link.mode_count for link in chain]
    body["hinge_kind"] = [KINDS.index(link.kind) for link in chain]
    body["axis"] = [link.kind.axis for link in chain]
    body["sequence"] = [(*link.axes.sequence, 0, 0, 0)[:3] for link in chain]
    body["parameters"] = [(*link.axes.parameters, 0.0, 0.0, 0.0)[:3] for link in chain]
    body["nv"] = [link.kind.speeds for link in chain]
    body["q_index"], body["u_index"] = np.array(numbering.hinges).reshape(-1, 2).T
    body["eta_index"], body["etad_index"] = np.array(numbering.modes).reshape(-1, 2).T
    in_hinge = np.array([link.kind.quaternion for link in chain], int)
    body["quaternion"] = np.where(in_hinge < 0, -1, body["q_index"] + in_hinge)


def _mark_first_contributions(body: a.Record) -> None:
    """Mark the outboard body that is the first to add to its parent's inertia in the inward sweep: the last one.

    It also adds the parent's own inertia, which the sweep then need not write beforehand. Only rigid parents without
    wheels are treated in this way.
    """
    steady = (body["level"] == LEVELS.index(RIGID)) & (body["wheel_start"] == body["wheel_stop"])
    last = np.full(len(body), -1)
    on = np.flatnonzero(body["parent"] >= 0)
    np.maximum.at(last, body["parent"][on], on)
    started = steady & (last >= 0) & (body["inboard_port"][last] < 0)
    body["started"], body["starts"][last[started]] = started, 1


def _ports(ports: list[Port], second: list[int]) -> a.Record:
    out = np.zeros(len(ports), a.PORT)
    out["second"] = second
    for row, at in zip(out, ports, strict=True):
        row["position"], row["offset"], row["frame"] = at.node.position, at.offset, at.frame.ravel()
    return out


def _wheels(wheels: list[s.Wheel], ports: list[int], numbering: Numbering) -> a.Record:
    out = np.zeros(len(wheels), a.WHEEL)
    for row, wheel, at in zip(out, wheels, ports, strict=True):
        row["port"], row["axis"] = at, wheel.axis
        row["q_index"], row["u_index"] = numbering.q[wheel.name].start, numbering.u[wheel.name].start
        row["mass"], row["axial"] = wheel.mass_kg, wheel.axial_inertia_kg_m2
        row["transverse"] = wheel.transverse_inertia_kg_m2
    return out


def _loads(loads: list[s.Load], ports: list[int], functions: Functions) -> a.Record:
    out = np.zeros(len(loads), a.LOAD)
    for row, load, at in zip(out, loads, ports, strict=True):
        row["port"], row["direction"], row["function"] = at, load.direction, functions.number(load.function)
        row["type"] = a.FORCE if load.type == "force" else a.TORQUE
        row["frame"] = a.WORLD_AXES if load.frame == "world" else a.NODE_AXES
    return out


def _speeds(
    chain: list[BodyLink], wheels: list[s.Wheel], numbering: Numbering, functions: Functions, body: a.Record
) -> a.Record:
    """Springs, dampers, armatures, motors, given motion by speed; isotropic springs of spherical hinges by body."""
    out = np.zeros(numbering.nu, a.SPEED)
    for name in ("coordinate", "motor", "prescribed"):
        out[name] = -1
    at, rows = list[int](), list[tuple[float, ...]]()
    for k, (link, (q, u)) in enumerate(zip(chain, numbering.hinges, strict=True)):
        stiffness, damping = link.kind.ball(link.hinge)
        if stiffness or damping:
            body["ball_spring"][k], out["damping"][u : u + 3] = stiffness, damping
        for n, (_, c) in enumerate(link.scalar):
            at.append(u + n)
            rows.append((q + n, functions.number(c.effort), functions.number(c.prescribed), *c.spring, c.armature))
    for wheel in wheels:
        at.append(numbering.u[wheel.name].start)
        motor, motion = functions.number(wheel.torque_Nm), functions.number(wheel.prescribed_rad)
        rows.append((numbering.q[wheel.name].start, motor, motion, 0.0, wheel.friction_Nms_rad, 0.0, 0.0))
    keys = ("coordinate", "motor", "prescribed", "stiffness", "damping", "rest", "armature")
    for key, values in zip(keys, np.array(rows, float).reshape(-1, len(keys)).T, strict=True):
        out[key][at] = values
    return out
