"""From links to the arrays of flexmb.tables.arrays: bodies, ports, wheels, loads, springs, functions of time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import TypeVar

import numpy as np

from flexmb.building.carried import CarriedTables, moved_inertia
from flexmb.building.connector_arrays import connector_arrays, end_ports
from flexmb.building.inertia_arrays import group, inertia_arrays, second_order_rows, shape_rows
from flexmb.building.links import BodyLink, Port, closure_sides, port
from flexmb.building.models import ORIGIN
from flexmb.building.numbering import Numbering
from flexmb.building.rigid_arrays import Frames, inboard_frames, outboard_frames
from flexmb.hinges.catalogue import KINDS
from flexmb.jit.strips import whole
from flexmb.levels.body import LEVELS
from flexmb.levels.rigid import LEVEL as RIGID
from flexmb.scene import schema as s
from flexmb.scene.bodies import IDENTITY, ZERO
from flexmb.scene.tree import GROUND
from flexmb.tables import arrays as a
from flexmb.tables.features import as_asked
from flexmb.tables.functions import pack

DOUBTFUL = 2.0**-33  # of all that a speed moves: chains of hundreds of bodies yield no less than this


Item = TypeVar("Item", s.Wheel, s.Load)


class Functions:
    """Functions of time by number, each stored once."""

    def __init__(self) -> None:
        self._number: dict[s.Function, int] = {}

    def number(self, function: s.Function | None) -> int:
        return -1 if function is None else self._number.setdefault(function, len(self._number))

    def all(self) -> list[s.Function]:
        return list(self._number)


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
        return self._first[body] + i

    @cached_property
    def _first(self) -> list[int]:
        """By body, how many ports those before it have."""
        return list(accumulate((len(ports) for ports in self.by_body), initial=0))

    def all(self) -> list[Port]:
        return [port for ports in self.by_body for port in ports]


def body_port(link: BodyLink, node: str, offset: s.Vector) -> Port:
    """Port at a node of a link for wheels, loads and markers, in the link's frame."""
    return port(link.node(node), offset, IDENTITY, np.eye(3))


@dataclass(frozen=True)
class Assembled:
    """The arrays of a scene, and which of its ports belong to whom: (body, port) each, (-1, -1) on the ground."""

    constants: a.Constants
    markers: dict[str, tuple[int, int]]  # by name
    closures: list[tuple[int, int]]  # sides A and B of the first, of the second ...
    signals: dict[int, s.ControlSignal]  # by number among the functions, those that controllers drive


def assemble(scene: s.Scene, chain: list[BodyLink], numbering: Numbering, null_partitions: bool = False) -> Assembled:
    """The arrays of a scene, from its links and the places of its coordinates.

    `null_partitions` gives a port to inboard hinges at nodes that do not deform too, so that terms which vanish are
    computed all the same.
    """
    index = {link.name: k for k, link in enumerate(chain) if not isinstance(link.body, s.PointMass)}
    functions, ports = Functions(), Ports(chain)
    wheels, loads = _by_body(scene.wheels, index), _by_body(scene.loads, index)

    def place(item: s.Wheel | s.Load | s.Marker) -> tuple[int, int]:
        k = index[item.body]
        return ports.add(k, body_port(chain[k], item.node, getattr(item, "offset_m", ZERO)))

    parent = [index.get(link.parent, -1) for link in chain]
    placement, flexible = _on_rigid_bodies(chain, parent), _on_flexible_bodies(chain, parent)
    for k, at in flexible.items():
        placement.p[k], placement.R[k] = at.origin, at.frame
    held = [k for k, p in enumerate(parent) if null_partitions and p >= 0 and k not in flexible]
    flexible |= {k: _as_port(placement, k) for k in held}
    inboard_ports = [
        ports.add(parent[k], at) if (at := flexible.get(k)) is not None and (at.deforms or null_partitions) else None
        for k in range(len(chain))
    ]
    outboard_ports = [
        ports.add(k, link.outboard) if not link.is_rigid and link.outboard.deforms else None
        for k, link in enumerate(chain)
    ]
    wheel_ports, load_ports = [place(wheel) for wheel in wheels], [place(load) for load in loads]
    marker_ports = {marker.name: place(marker) for marker in scene.markers}
    sides = [
        None if side.body == GROUND else ports.add(index[side.body], side.port(chain[index[side.body]]))
        for closure in scene.closures
        for side in closure_sides(closure)
    ]
    ends = [None if end is None else ports.add(*end) for end in end_ports(scene, chain, index)]

    m = whole(max((link.mode_count for link in chain), default=0))
    inertia, points, of_points = inertia_arrays(chain, m)
    port_rows, of_ports = second_order_rows([at.node.second for at in ports.all()], 0, m)
    points["point"]["second"], second_shape = second_order_rows(of_points, len(of_ports), m)
    body = inertia.pop("body")
    body["parent"] = parent
    body["level"] = [LEVELS.index(link.level) for link in chain]
    body["hinge_kind"] = [KINDS.index(link.kind) for link in chain]
    body["axis"] = [link.kind.axis for link in chain]
    body["sequence"] = [(*link.axes.sequence, 0, 0, 0)[:3] for link in chain]
    body["parameters"] = [(*link.axes.parameters, 0.0, 0.0, 0.0)[:3] for link in chain]
    body["q_index"], body["u_index"] = np.array(numbering.hinges).reshape(-1, 2).T
    body["quaternion"] = [
        -1 if link.kind.quaternion < 0 else q + link.kind.quaternion
        for link, (q, _) in zip(chain, numbering.hinges, strict=True)
    ]
    body["nv"] = [link.kind.speeds for link in chain]
    body["modes"] = [link.mode_count for link in chain]
    body["eta_index"], body["etad_index"] = np.array(numbering.modes).reshape(-1, 2).T
    body["inboard_port"] = [ports.number(at) for at in inboard_ports]
    body["outboard_port"] = [ports.number(at) for at in outboard_ports]
    body["placement_position"], body["placement_rotation"] = placement.p, placement.R.reshape(-1, 9)
    group(body, "port", [len(each) for each in ports.by_body])
    for name, items in (("wheel", wheels), ("load", loads)):
        group(body, name, np.bincount(np.array([index[item.body] for item in items], int), minlength=len(chain)))
    _who_starts(body)
    speed = _speeds(chain, wheels, numbering, functions, body)
    load = _loads(loads, [ports.number(at) for at in load_ports], functions)
    on_bodies = [(-1 if end is None else end[0], ports.number(end)) for end in ends]
    connected = connector_arrays(scene, on_bodies, numbering, functions.number)
    function, table = pack(functions.all())
    port = _ports(ports, port_rows)
    wheel = _wheels(wheels, [ports.number(at) for at in wheel_ports], numbering)
    speed["doubtful"] = DOUBTFUL * moved_inertia(CarriedTables(body, port, inertia["mff"], wheel), len(speed))
    constants = a.Constants(
        gravity=np.array(scene.gravity_m_s2, float),
        body=body,
        port=port,
        port_mode=shape_rows([(p.node.rotation_modes, p.node.translation) for p in ports.all()], m),
        second_shape=np.concatenate([of_ports, second_shape]),
        wheel=wheel,
        load=load,
        speed=speed,
        function=function,
        table=table,
        kernels=as_asked(),
        **connected,
        **inertia,
        **points,
    )
    markers = {name: (at[0], ports.number(at)) for name, at in marker_ports.items()}
    signals = {number: each for number, each in enumerate(functions.all()) if isinstance(each, s.ControlSignal)}
    return Assembled(constants, markers, [(-1 if at is None else at[0], ports.number(at)) for at in sides], signals)


def _who_starts(body: a.Record) -> None:
    """Whose inertia the first body to reach it in the inward sweep starts: that is the last one hinged to it."""
    steady = (body["level"] == LEVELS.index(RIGID)) & (body["wheel_start"] == body["wheel_stop"])
    last = np.full(len(body), -1)
    on = np.flatnonzero(body["parent"] >= 0)
    np.maximum.at(last, body["parent"][on], on)
    started = steady & (last >= 0) & (body["inboard_port"][last] < 0)
    body["started"], body["starts"][last[started]] = started, 1


def _by_body(items: tuple[Item, ...], index: dict[str, int]) -> list[Item]:
    """In the order of the bodies, those of one body in the scene's order."""
    return sorted(items, key=lambda item: index[item.body])


def _on_rigid_bodies(chain: list[BodyLink], parent: list[int]) -> Frames:
    """Inboard hinge frames in the frames of their parents' links, where the parent is rigid or the ground."""
    placement = Frames(np.zeros((len(chain), 3, 3)), np.zeros((len(chain), 3)))
    placed = [k for k, p in enumerate(parent) if p < 0 or chain[p].is_rigid]
    inboard = inboard_frames([chain[k] for k in placed])
    rigid = [k for k, link in enumerate(chain) if link.is_rigid]
    outboard = outboard_frames([chain[k] for k in rigid])
    base = Frames(np.tile(np.eye(3), (len(chain) + 1, 1, 1)), np.zeros((len(chain) + 1, 3)))  # the last is the ground's
    base.R[rigid], base.p[rigid] = outboard
    on = [parent[k] for k in placed]
    placement.R[placed], placement.p[placed] = inboard.seen_from(Frames(base.R[on], base.p[on]))
    return placement


def _on_flexible_bodies(chain: list[BodyLink], parent: list[int]) -> dict[int, Port]:
    """By link, the inboard hinge frames in the frames of their parents' links, where the parent is flexible."""
    return {
        k: _moved(link.inboard, chain[p])
        for k, (link, p) in enumerate(zip(chain, parent, strict=True))
        if p >= 0 and not chain[p].is_rigid
    }


def _as_port(placement: Frames, k: int) -> Port:
    """A frame on a rigid body."""
    return Port(ORIGIN, placement.p[k], placement.R[k])


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
    at, rows = list[int](), list[tuple[float, ...]]()
    for k, (link, (q, u)) in enumerate(zip(chain, numbering.hinges, strict=True)):
        stiffness, damping = link.kind.ball(link.hinge)
        if stiffness or damping:
            body["ball_spring"][k], out["damping"][u : u + 3] = stiffness, damping
        for n, (_, c) in enumerate(link.scalar):
            at.append(u + n)
            rows.append((q + n, functions.number(c.effort), functions.number(c.prescribed), *c.spring))
    for wheel in wheels:
        at.append(numbering.u[wheel.name].start)
        motor, motion = functions.number(wheel.torque_Nm), functions.number(wheel.prescribed_rad)
        rows.append((numbering.q[wheel.name].start, motor, motion, 0.0, wheel.friction_Nms_rad, 0.0))
    keys = ("coordinate", "motor", "prescribed", "stiffness", "damping", "rest")
    for key, values in zip(keys, np.array(rows, float).reshape(-1, len(keys)).T, strict=True):
        out[key][at] = values
    return out
