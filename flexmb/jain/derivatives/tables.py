"""The arrays of the derivatives of a tree, and the order of its rows and columns.

A *place* is a row of the matrices, as in `flexmb.jain.places`: depth first. A *slot* is a source of motion as the
bodies beyond it see it: a hinge speed has one slot, a mode has one for each body that sits on its body, because each
port moves differently. The slots from the base to a body are divided into *runs*: contiguous slots whose
places are contiguous too, and whose spatial vectors are about one point, so that loops over them run in strips.

All spatial vectors are in World axes. They are about a *base point* near the body: the hinge point of the body itself
or of one of a few bodies inboard, `BODIES_A_POINT` in a row. A common point of the whole tree would save all shifts,
but moments about a far point lose digits; a point for each body would need a shift at every body.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from flexmb.jain.places import Matrices, matrices
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import DUAL
from flexmb.jit.lanes import LANES
from flexmb.jit.strips import strip_zeros, whole
from flexmb.jit.wide_arrays import as_duals
from flexmb.tables.arrays import ON_GROUND, Constants, Workspace
from flexmb.tables.workspaces import workspace
from flexmb.typing import Flags, Index, Real, Record

BODIES_A_POINT = 8
"""Moments about a point eight bodies away lose two digits at most."""

BLOCK = 4
"""Strips of columns that are solved together: as many independent sums hide the time that one product takes."""

_F, _I = np.float64, np.int64

PLACES = np.dtype(
    [
        ("hinge", _I),  # first place of the body's hinge
        ("modes", _I),  # of its modes
        ("wheels", _I),  # of its wheels
        ("stop", _I),  # end of what it carries
        ("slot", _I),  # first slot of the body's hinge
        ("seen", _I),  # first slot of its parent's modes as it sees them
        ("sees", _I),  # number of these: none where neither its inboard port nor its parent's frame moves by them
        ("inboard_run", _I),  # the last run of all sources inboard of its hinge, or -1
        ("inboard_end", _I),  # end of the slots there
        ("run", _I),  # the same of all sources inboard of the body, with its hinge
        ("end", _I),
        ("new_point", _I),  # whether its hinge point is a base point
        ("leaves_point", _I),  # whether no source inboard of its hinge is about its base point
        ("branches", _I),  # whether it sits on a body that is not the one before it
    ],
    align=True,
)
STRETCH = np.dtype(
    [
        ("start", _I),  # first place in `order`
        ("stop", _I),
        ("ends", _I),  # whether the next body in `order` does not sit on its last one
        ("forks", _I),  # whether any body that is not the next one sits on its last one
    ],
    align=True,
)
RUN = np.dtype(
    [
        ("start", _I),  # first slot
        ("offset", _I),  # place less slot
        ("inboard", _I),  # the run inboard, or -1
        ("stop", _I),  # end of the slots of that run that are inboard of this one
        ("body", _I),  # the first body of this run, whose base point is new if `new_point`
        ("new_point", _I),
    ],
    align=True,
)
BODY = np.dtype(
    [
        ("rotation", _F, (9,)),  # R_World_body
        ("position", _F, (3,)),  # of O
        ("origin", _F, (3,)),  # of the body frame, which is O unless the modes move O in the body
        ("step", _F, (3,)),  # from the parent's base point to the body's, where they differ
        ("velocity", _F, (6,)),  # V
        ("accel", _F, (6,)),  # A, relative to free fall
        ("inertia", _F, (21,)),  # I of the body, then of all that it carries too
        # columns of (6,3): change of the force with the angular part of s1, of all that it carries too
        ("by_rate", _F, (18,)),
        ("by_turn", _F, (18,)),  # likewise of s0: of loads that keep their direction in World
        ("force", _F, (6,)),  # F, the load across the hinge on all that it carries
    ],
    align=True,
)
PORT = np.dtype(
    [
        ("used", _I),  # whether a body, wheel or load is attached to it
        ("position", _F, (3,)),
        ("velocity", _F, (6,)),
        ("accel", _F, (6,)),
        ("inertia", _F, (21,)),  # of all that is attached to it
        ("by_rate", _F, (18,)),
        ("by_turn", _F, (18,)),
        ("force", _F, (6,)),  # on all that is attached to it
    ],
    align=True,
)
# Rows of `mode`: l2 (M_fr, and what the ports and the motion of the body frame add), l1, l0, and the change of the
# body's own force by displacement, then by speed.
MODE_ROW, MODE_BY_RATE, MODE_BY_TURN, MODE_FORCE, MODE_ROWS = 0, 6, 9, 12, 24
# Rows of `seed`: what a unit of a source does to all bodies beyond. The first four, six rows each, are also those of
# what a mode does to a port relative to its body, and to the body frame relative to O. At level ruthless a mode has no
# other effect than its acceleration J.
MOTION, BY_RATE, BY_ACCELERATION, SPEED_BY_ACCELERATION, TURN, SPEED_BY_RATE, ROWS = 0, 6, 12, 18, 24, 27, 30
MOVED_ROWS = 24
# What `shape` says: whether the tree branches; whether the order of places is that of u; whether it is that of q too.
BRANCHES, IN_ORDER, ALIKE = range(3)
# Rows of `end`, six each: J; s0 and s1 of displacements; s1 of speeds.
END_MOTION, END_DISPLACED, END_MOVED, END_SPEED, END_ROWS = 0, 6, 12, 18, 24


AT_SECTION = np.dtype(  # of a beam of level exact
    [
        # `section_rows` times modal displacements, speeds and accelerations, without derivatives
        ("displaced", _F, (12,)),
        ("rates", _F, (12,)),
        ("accelerations", _F, (12,)),
        ("whole", _F, (3,)),  # the three integrals of its curvature since the section before
        ("linear", _F, (3,)),
        ("square", _F, (3,)),
        ("rate", _F, (3,)),  # of its tangent, at a Gauss point
        ("force", _F, (3,)),  # on the section, body axes, and on those of which it is the base
        ("pull", _F, (3,)),  # on its tangent, at a Gauss point
        ("torque", _F, (3,)),  # on it and on what turns with it
        ("held", _F, (6,)),  # force of what is attached to its ports, with the sign of inertia, about the body origin
    ],
    align=True,
)


@bundle
class Duals(Workspace):
    """A workspace whose numbers are duals, for derivatives of single hinges and bodies."""

    at_section: Record  # (sections,) AT_SECTION

    numbers = DUAL


@bundle
class Derivatives:
    """The arrays that the derivatives of a tree write. One set per thread."""

    places: Record  # (N,) PLACES
    run: Record  # (runs,) RUN
    body: Record  # (N,) BODY
    speed: Index  # (nu,) number in u of a place
    place: Index  # (nu,) place of a speed
    shape: Index  # (3,) BRANCHES, IN_ORDER, ALIKE
    # (ROWS,slots) MOTION: the motion J at unit speed; BY_RATE: s1 of a displacement; BY_ACCELERATION: its s2;
    # SPEED_BY_ACCELERATION: s2 of a speed; and only for scenes with modes, because they are else those of J, TURN
    # and SPEED_BY_RATE: angular parts of s0 of a displacement and of s1 of a speed
    seed: Real
    force: Real  # (18,nu) change of the load across each hinge inboard, [torque; force]: by displacement, speed, rate
    matrix: Real  # (nu,3nu) d(M udot + b) by displacement, by speed, and M or -1; then the solution
    gain: Real  # (nu,6) of the factors of M
    factor: Real  # (nu,)
    order: Index  # (N,) bodies by their places
    stretch: Record  # STRETCH: bodies in `order` about one base point, each of which carries the next and no other
    fork: Index  # bodies at the ends of stretches that fork
    carried: Real  # (N,28) in trees of rigid bodies on single axes: what branches answer where they meet
    passed: Real  # (N,6,block) their forces, then accelerations, of one block of columns
    moved: Real  # (N,6,6,6) of hinges that are no single axis: derivatives of H in outboard axes by displacement
    turned: Real  # (3,6,6) of one such hinge: of V_r and A_r by displacement, of A_r by speed, in columns
    port: Record  # (P,) PORT
    port_mode: Real  # (P,MOVED_ROWS,m) what modes do to ports relative to the body
    frame_mode: Real  # (N,MOVED_ROWS,m) to the body frame relative to O; zero unless they move O in the body
    mode: Real  # (N,MODE_ROWS,m)
    answer: Real  # (m,12) l2, l1 and l0 of the modes of one body
    # (P,m,6,m) derivatives of the motion of a port at unit speed of mode j by displacement n: [j, ., n]; zero where a
    # section carries it
    bent: Real
    change: Real  # (18,m) of one port: of its V_r and A_r by displacements, of A_r by speeds, in body axes
    end: Real  # (2,END_ROWS,nu) what all sources do to the two ends of a connector
    # (C,13,24) derivatives of the forces on the bodies of A and B, and of the power, by s0 and s1 of A, then of B
    link: Real
    passed_row: Real  # (24,) of one row
    work: Real  # (3nu,) derivatives of the power by displacements and speeds, and by accelerations
    local: Real  # (6,3) of one body: derivatives of its force by its angular velocity, body axes
    plain: Workspace  # for the inertia of single bodies
    duals: Duals


def duals(c: Constants, nq: int, nu: int) -> Duals:
    """A dual workspace of the right sizes."""
    tables = workspace(c, nq, nu)
    return Duals(
        **{field.name: as_duals(getattr(tables, field.name)) for field in fields(tables)},
        at_section=as_duals(np.zeros(len(c.section), AT_SECTION)),
    )


def derivatives(c: Constants, nq: int, nu: int) -> Derivatives:
    """Arrays of the right sizes."""
    order = matrices(c)
    places, runs, slots = _places_and_runs(c, order)
    visited, stretch = _stretches(c, places)
    place = np.empty(nu, np.int64)
    place[order.speed] = np.arange(nu)
    columns = whole(3 * nu + BLOCK * LANES)  # room for the last block
    m = c.mfr.shape[2]
    return Derivatives(
        places=places,
        run=runs,
        body=np.zeros(len(c.body), BODY),
        speed=order.speed,
        place=place,
        shape=_shape(c, place, nq),
        seed=strip_zeros((ROWS, slots + LANES)),
        force=strip_zeros((18, nu + LANES)),
        matrix=strip_zeros((nu, columns)),
        gain=np.zeros((nu, 6)),
        factor=np.zeros(nu),
        order=visited,
        stretch=stretch,
        fork=visited[stretch["stop"][stretch["forks"] != 0] - 1],
        carried=np.zeros((len(c.body), 28)),
        passed=strip_zeros((len(c.body), 6, BLOCK * LANES)),
        moved=np.zeros((len(c.body) if np.any(c.body["axis"] < 0) else 1, 6, 6, 6)),
        turned=np.zeros((3, 6, 6)),
        port=_ports(c),
        port_mode=strip_zeros((len(c.port), MOVED_ROWS, m)),
        frame_mode=strip_zeros((len(c.body), MOVED_ROWS, m)),
        mode=strip_zeros((len(c.body), MODE_ROWS, m)),
        answer=np.zeros((m, 12)),
        bent=strip_zeros((len(c.port), m, 6, m)),
        change=strip_zeros((18, m)),
        end=strip_zeros((2, END_ROWS, (nu if len(c.connector) + len(c.load) else 0) + LANES)),
        link=np.zeros((len(c.connector), 13, 24)),
        passed_row=np.zeros(24),
        work=strip_zeros((3 * nu + LANES,)),
        local=np.zeros((6, 3)),
        plain=workspace(c, nq, nu),
        duals=duals(c, nq, nu),
    )


def _shape(c: Constants, place: Index, nq: int) -> Index:
    """(3,) for `Derivatives.shape`."""
    body, nu = c.body, len(place)
    in_order = np.array_equal(place, np.arange(nu))
    coordinate = np.full(nu, -1)
    for own in body:
        if own["quaternion"] < 0:
            coordinate[own["u_index"] : own["u_index"] + own["nv"]] = own["q_index"] + np.arange(own["nv"])
        coordinate[own["etad_index"] : own["etad_index"] + own["modes"]] = own["eta_index"] + np.arange(own["modes"])
    coordinate[c.wheel["u_index"]] = c.wheel["q_index"]
    alike = in_order and nq == nu and np.array_equal(coordinate, np.arange(nu))
    return np.array([len(set(body["parent"].tolist())) < len(body), in_order, alike], np.int64)


def ports_in_use(c: Constants) -> Flags:
    """(P,) which ports a body, wheel, load or connector is attached to."""
    used = np.zeros(len(c.port), bool)
    ends = c.end["port"][c.end["body"] != ON_GROUND]
    for attached in (c.body["inboard_port"], c.wheel["port"], c.load["port"], ends):
        used[attached[attached >= 0]] = True
    return used


def _ports(c: Constants) -> Record:
    """(P,) PORT with what is attached where."""
    port = np.zeros(len(c.port), PORT)
    port["used"] = ports_in_use(c)
    return port


def _places_and_runs(c: Constants, order: Matrices) -> tuple[Record, Record, int]:
    """Places of each body, the runs, and the number of slots."""
    body = c.body
    places = np.zeros(len(body), PLACES)
    for name in ("hinge", "modes", "wheels", "stop"):
        places[name] = getattr(order, name)
    since = np.zeros(len(body), np.int64)  # bodies since the last base point
    paths = _Paths()
    for k in np.argsort(places["hinge"], kind="stable").tolist():  # a weld has the place of what it carries first
        own, p = places[k], int(body["parent"][k])
        moves = p >= 0 and (body["inboard_port"][k] >= 0 or body["outboard_port"][p] >= 0)
        seen = int(body["modes"][p]) if moves else 0
        count = int(body["nv"][k])
        since[k] = since[p] + 1 if p >= 0 else BODIES_A_POINT
        new = since[k] >= BODIES_A_POINT and (p < 0 or seen + count > 0)
        since[k] = 0 if new else since[k]
        path = (-1, 0) if p < 0 else (int(places["run"][p]), int(places["end"][p]))
        own["new_point"], own["leaves_point"], own["seen"] = new, new and not seen, paths.slots
        own["sees"] = seen
        path = paths.extended(path, k, int(places["modes"][p]), seen, new)
        own["inboard_run"], own["inboard_end"] = path
        own["slot"] = paths.slots
        own["run"], own["end"] = paths.extended(path, k, int(own["hinge"]), count, new and not seen)
    return places, np.array(paths.runs or [(0, 0, -1, 0, 0, 0)], RUN), paths.slots


def _stretches(c: Constants, places: Record) -> tuple[Index, Record]:
    """Bodies in the order of the solution, and its stretches; writes to `places` which bodies branch off."""
    order = np.argsort(places["hinge"], kind="stable")  # a weld has the place of what it carries
    parent = c.body["parent"][order]
    follows = parent == np.concatenate([[-1], order[:-1]])
    branches = ~follows & (parent >= 0)
    places["branches"][order] = branches
    forks = np.isin(order, parent[branches])
    begins = ~follows | (places["new_point"][order] != 0) | np.append(False, forks[:-1])
    begins[:1] = True
    start = np.flatnonzero(begins)
    stretch = np.zeros(len(start), STRETCH)
    stretch["start"], stretch["stop"] = start, np.append(start[1:], len(order))
    stretch["ends"] = ~np.append(follows[1:], False)[stretch["stop"] - 1]
    stretch["forks"] = forks[stretch["stop"] - 1]
    return order, stretch


class _Paths:
    """Runs as they are found. A path is the number of its last run, and the end of its slots there."""

    def __init__(self) -> None:
        self.runs: list[tuple[int, ...]] = []
        self.slots = 0

    def extended(self, path: tuple[int, int], body: int, place: int, count: int, new_point: bool) -> tuple[int, int]:
        """The path with `count` further slots, for places from `place` on."""
        if not count:
            return path
        run, end = path
        goes_on = run >= 0 and not new_point and end == self.slots and self.runs[run][1] == place - self.slots
        if not goes_on:
            self.runs.append((self.slots, place - self.slots, run, end, body, int(new_point)))
            run = len(self.runs) - 1
        self.slots += count
        return run, self.slots
