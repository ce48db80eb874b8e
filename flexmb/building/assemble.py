"""From links to the arrays of flexmb.tables.arrays: bodies, ports, wheels, loads, springs, functions of time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexmb.building.carried import moved_inertia
from flexmb.building.inertia_arrays import group, inertia_arrays, second_order_rows, shape_records
from flexmb.building.links import BodyLink, Port, closure_sides, port
from flexmb.building.numbering import Numbering
from flexmb.hinges.catalogue import KINDS
from flexmb.levels.body import LEVELS
from flexmb.scene import schema as s
from flexmb.scene.bodies import IDENTITY, ZERO
from flexmb.scene.tree import GROUND
from flexmb.tables import arrays as a
from flexmb.tables.functions import pack

DOUBTFUL = 2.0**-33  # of all that a speed moves: chains of hundreds of bodies yield no less than this


class Functions:
    """Functions of time by number, each stored once."""

    def __init__(self) -> None:
        self.all: list[s.Function] = []

    def number(self, function: s.Function | None) -> int:
        if function is None:
            return -1
        if function not in self.all:
            self.all.append(function)
        return self.all.index(function)


class Ports:
    """Ports by body; numbered when all are known."""

    def __init__(self, chain: list[BodyLink]) -> None:
        self.by_body: list[list[Port]] = [[] for _ in chain]

    def add(self, body: int, at: Port) -> tuple[int, int]:
        self.by_body[body].append(at)
        return body, len(self.by_body[body]) - 1

    def number(self, place: tuple[int, int] | None) -> int:
        """Number of a port once all are added; -1 for none."""
        if place is None:
            return -1
        body, i = place
        return sum(len(ports) for ports in self.by_body[:body]) + i

    def all(self) -> list[Port]:
        return [port for ports in self.by_body for port in ports]


def body_port(link: BodyLink, node: str, offset: s.Vector) -> Port:
    """Port at a node of a link for wheels, loads and markers, in the link's frame."""
    return port(link.model, node, offset, IDENTITY, np.eye(3))


@dataclass(frozen=True)
class Assembled:
    """The arrays of a scene, and which of its ports belong to whom: (body, port) each, (-1, -1) on the ground."""

    constants: a.Constants
    markers: dict[str, tuple[int, int]]  # by name
    closures: list[tuple[int, int]]  # sides A and B of the first, of the second ...


def assemble(scene: s.Scene, chain: list[BodyLink], numbering: Numbering, null_partitions: bool = False) -> Assembled:
    """The arrays of a scene, from its links and the places of its coordinates.

    `null_partitions` gives a port to inboard hinges at nodes that do not deform too, so that terms which vanish are
    computed all the same.
    """
    index = {link.name: k for k, link in enumerate(chain)}
    functions, ports = Functions(), Ports(chain)
    wheels = [wheel for link in chain for wheel in scene.wheels if wheel.body == link.name]
    loads = [load for link in chain for load in scene.loads if load.body == link.name]

    def place(item: s.Wheel | s.Load | s.Marker) -> tuple[int, int]:
        k = index[item.body]
        return ports.add(k, body_port(chain[k], item.node, getattr(item, "offset_m", ZERO)))

    inboard = [
        link.inboard if link.parent == GROUND else _moved(link.inboard, chain[index[link.parent]]) for link in chain
    ]
    inboard_ports = [
        ports.add(index[link.parent], at) if at.deforms or (null_partitions and link.parent != GROUND) else None
        for link, at in zip(chain, inboard, strict=True)
    ]
    outboard_ports = [ports.add(k, link.outboard) if link.outboard.deforms else None for k, link in enumerate(chain)]
    wheel_ports, load_ports = [place(wheel) for wheel in wheels], [place(load) for load in loads]
    marker_ports = {marker.name: place(marker) for marker in scene.markers}
    sides = [
        None if side.body == GROUND else ports.add(index[side.body], side.port(chain[index[side.body]].model))
        for closure in scene.closures
        for side in closure_sides(closure)
    ]

    m = max((link.model.mode_count for link in chain), default=0)
    inertia, points, of_points = inertia_arrays(chain, m)
    port_rows, of_ports = second_order_rows([at.node.second for at in ports.all()], 0, m)
    points["point"]["second"], second_shape = second_order_rows(of_points, len(of_ports), m)
    body = inertia.pop("body")
    body["parent"] = [index.get(link.parent, -1) for link in chain]
    body["level"] = [LEVELS.index(link.level) for link in chain]
    body["hinge_kind"] = [KINDS.index(link.kind) for link in chain]
    body["axis"] = [link.kind.axis for link in chain]
    body["sequence"] = [(*link.sequence, 0, 0, 0)[:3] for link in chain]
    body["q_index"] = [numbering.q[link.hinge.name].start for link in chain]
    body["quaternion"] = [
        -1 if link.kind.quaternion < 0 else numbering.q[link.hinge.name].start + link.kind.quaternion for link in chain
    ]
    body["u_index"] = [numbering.u[link.hinge.name].start for link in chain]
    body["nv"] = [link.kind.speeds for link in chain]
    body["modes"] = [link.model.mode_count for link in chain]
    body["eta_index"] = [numbering.q[f"{link.name}.modes"].start for link in chain]
    body["etad_index"] = [numbering.u[f"{link.name}.modes"].start for link in chain]
    body["inboard_port"] = [ports.number(at) for at in inboard_ports]
    body["outboard_port"] = [ports.number(at) for at in outboard_ports]
    body["placement_position"] = [at.node.position + at.offset for at in inboard]
    body["placement_rotation"] = [at.frame.ravel() for at in inboard]
    group(body, "port", [len(each) for each in ports.by_body])
    group(body, "wheel", [sum(wheel.body == link.name for wheel in wheels) for link in chain])
    group(body, "load", [sum(load.body == link.name for load in loads) for link in chain])
    speed = _speeds(chain, wheels, numbering, functions, body)
    load = _loads(loads, [ports.number(at) for at in load_ports], functions)
    function, table = pack(functions.all)
    constants = a.Constants(
        gravity=np.array(scene.gravity_m_s2, float),
        body=body,
        port=_ports(ports, port_rows),
        port_mode=shape_records([(p.node.translation, p.node.rotation_modes) for p in ports.all()], m),
        second_shape=np.concatenate([of_ports, second_shape]),
        wheel=_wheels(wheels, [ports.number(at) for at in wheel_ports], numbering),
        load=load,
        speed=speed,
        function=function,
        table=table,
        **inertia,
        **points,
    )
    speed = speed.copy()  # those in the constants are read-only
    speed["doubtful"] = DOUBTFUL * moved_inertia(constants)
    constants = replace(constants, speed=speed)
    markers = {name: (at[0], ports.number(at)) for name, at in marker_ports.items()}
    return Assembled(constants, markers, [(-1 if at is None else at[0], ports.number(at)) for at in sides])


def _moved(inboard: Port, parent: BodyLink) -> Port:
    """An inboard port in its parent's link frame (the parent may have been referred to its own hinge frame)."""
    if parent.outboard.deforms:
        return inboard
    back, origin = parent.outboard.frame.T, parent.outboard.origin
    return Port(inboard.node.seen_from(origin, back), back @ inboard.offset, back @ inboard.frame)


def _ports(ports: Ports, second: list[int]) -> a.Record:
    out = np.zeros(len(ports.all()), a.PORT)
    out["second"] = second
    for row, at in zip(out, ports.all(), strict=True):
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
    """Springs, dampers, motors and prescribed motion by speed; isotropic springs of spherical hinges by body."""
    out = np.zeros(numbering.nu, a.SPEED)
    for name in ("coordinate", "motor", "prescribed"):
        out[name] = -1
    for k, link in enumerate(chain):
        q, u = numbering.q[link.hinge.name].start, numbering.u[link.hinge.name].start
        body["ball_spring"][k], damping = link.kind.ball(link.hinge)
        if damping:
            out["damping"][u : u + 3] = damping
        for n, (_, c) in enumerate(link.scalar):
            if isinstance(c, s.AngularCoordinate):
                spring, motor, prescribed = (
                    (c.stiffness_Nm_rad, c.damping_Nms_rad, c.rest_rad),
                    c.torque_Nm,
                    c.prescribed_rad,
                )
            else:
                spring, motor, prescribed = (c.stiffness_N_m, c.damping_Ns_m, c.rest_m), c.force_N, c.prescribed_m
            out[u + n] = (q + n, functions.number(motor), functions.number(prescribed), *spring, 0.0)
    for wheel in wheels:
        out[numbering.u[wheel.name].start] = (
            numbering.q[wheel.name].start,
            functions.number(wheel.torque_Nm),
            functions.number(wheel.prescribed_rad),
            0.0,
            wheel.friction_Nms_rad,
            0.0,
            0.0,
        )
    return out
