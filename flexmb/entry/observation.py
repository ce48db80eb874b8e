"""Entry points of the outputs at one state: markers, loads, energy and momentum, for any algorithm.

A new output begins here, with a member of `Outputs`, its shape in `shapes`, and the lines of a kernel that fill it. Its
names are given in `flexmb.system.observables`, its values over time in `flexmb.run.trajectory`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from flexmb.entry.articulated import world_loads
from flexmb.jain.accelerations import acceleration_sweep
from flexmb.jain.balance import energy_and_momentum
from flexmb.jain.kinematics import pose_sweep, velocity_sweep
from flexmb.jain.loads import hinge_loads, wheel_load
from flexmb.jain.ports import port_acceleration, port_velocity
from flexmb.jit.bundle import bundle
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel
from flexmb.levels.body import AT_REST
from flexmb.motion.coordinates import load_state
from flexmb.spatial.spatial_vector import store6, times6, vec6
from flexmb.spatial.vector import add, mat3, matmul, store3, store9, times, vec3
from flexmb.tables.features import CONNECTORS, COORDINATE_LAWS, HINGE_SPRINGS, WHEELS
from flexmb.typing import Index, Real

Places = dict[str, tuple[slice, tuple[int, ...]]]


@bundle
class Outputs:
    """The outputs at one state, World axes. All numbers except `drives` are views of `every`."""

    marker_body: Index  # (K,) input: the markers' bodies
    marker_port: Index  # (K,) input: the markers' ports
    drives: Real  # (nu,) loads of prescribed speeds; not in `every`, because the entries of free speeds are undefined
    every: Real  # all of the following, as one row
    rates: Real  # (nu,) accelerations
    markers: Real  # (K,24) position, R_World_marker (9), velocity (6), classical acceleration (6), true deformation
    loads: Real  # (N,6) [torque; force] of hinges, at level ruthless those of the undeformed body
    wheel_loads: Real  # (W,6)
    energy: Real  # (4,) as in flexmb.jain.balance
    momentum: Real  # (6,) likewise
    connectors: Real  # (C,6) [torque; force] of connectors between nodes, on B about B
    hinge_forces: Real  # (S,) loads of springs, then of other laws, along coordinates


def shapes(
    speeds: int, markers: int, hinges: int, wheels: int, connectors: int = 0, hinge_forces: int = 0
) -> dict[str, tuple[int, ...]]:
    """Shapes of the parts of `Outputs.every`, in their order."""
    return {
        "rates": (speeds,),
        "markers": (markers, 24),
        "loads": (hinges, 6),
        "wheel_loads": (wheels, 6),
        "energy": (4,),
        "momentum": (6,),
        "connectors": (connectors, 6),
        "hinge_forces": (hinge_forces,),
    }


def places(of: Mapping[str, tuple[int, ...]]) -> Places:
    """The slices of parts of these shapes in one row."""
    found, start = {}, 0
    for name, shape in of.items():
        stop = start + math.prod(shape)
        found[name], start = (slice(start, stop), shape), stop
    return found


def parts(every: Real, of: Places) -> dict[str, Real]:
    """Views of the parts of a row, by name."""
    return {
        name: every[place] if len(shape) == 1 else every[place].reshape(shape) for name, (place, shape) in of.items()
    }


def outputs(of: Mapping[str, tuple[int, ...]], marker_body: Index, marker_port: Index) -> Outputs:
    """Outputs of these shapes, for markers at these ports of these bodies."""
    every = np.zeros(sum(math.prod(shape) for shape in of.values()))
    return Outputs(marker_body, marker_port, np.zeros(of["rates"]), every, **parts(every, places(of)))


@kernel
def observe(c, w, out):
    """All outputs at the state at which the right-hand side of the recursion was just evaluated, with status OK.

    It does not evaluate the right-hand side itself: a run needs that kernel anyway, and most of the code is in it.
    """
    observe_free_motion(c, w, out)
    observe_bodies(c, w, out)


@helper
def observe_free_motion(c, w, out):
    """Accelerations, drives and loads of hinges that the right-hand side of the recursion has left."""
    pose_sweep(c, w)
    hinge_loads(c, w)
    world_loads(c, w, out.loads)
    for j in range(out.rates.shape[0]):
        out.rates[j] = w.speed[j].acceleration
        out.drives[j] = w.speed[j].drive


@kernel
def transmitted(c, w, loads):
    """Loads (N,6) across all hinges, World axes, without the other outputs of `observe`."""
    pose_sweep(c, w)
    hinge_loads(c, w)
    world_loads(c, w, loads)


@kernel
def observe_motion(t, y, c, w, out):
    """Outputs that follow from the state and the given accelerations out.rates without solving equations of motion.

    These are markers, loads of wheels, energy and momentum.
    """
    load_state(t, y, c, w)
    for j in range(out.rates.shape[0]):
        w.speed[j].acceleration = out.rates[j]
    velocity_sweep(c, w, False, False)
    pose_sweep(c, w)
    acceleration_sweep(c, w)
    observe_bodies(c, w, out)


@kernel
def sense_markers(t, y, c, w, out):
    """Markers at y = [q, u, work] and given accelerations out.rates, to out.markers.

    Positions and velocities do not depend on the accelerations. Bodies of level ruthless have their true deformation.
    """
    load_state(t, y, c, w)
    for j in range(out.rates.shape[0]):
        w.speed[j].acceleration = out.rates[j]
    velocity_sweep(c, w, True, True)
    pose_sweep(c, w)
    acceleration_sweep(c, w)
    _observe_each_marker(c, w, out)


@kernel
def observe_bodies(c, w, out):
    """Loads of wheels, energy, momentum, connectors and markers. It is a kernel because four others share it.

    Needs the velocity, pose and acceleration sweeps of the equations of motion. For bodies of level ruthless the sweeps
    are repeated: energy and momentum need their true modal speeds, markers their true deformation, too.
    """
    if has(c, WHEELS):
        _world_wheel_loads(c, w, out.wheel_loads)
    if has(c, AT_REST):
        velocity_sweep(c, w, False, True)
    energy_and_momentum(c, w, out.energy, out.momentum)
    if has(c, CONNECTORS):
        for i in range(c.connector.shape[0]):
            store6(out.connectors[i], 0, vec6(w.connector[i].load, 0))
    if has(c, HINGE_SPRINGS) or has(c, COORDINATE_LAWS):
        _observe_along_hinges(c, w, out.hinge_forces)
    observe_markers(c, w, out)


@helper
def observe_markers(c, w, out):
    """All markers; bodies of level ruthless are seen deformed."""
    if has(c, AT_REST):
        velocity_sweep(c, w, True, True)
        pose_sweep(c, w)
        acceleration_sweep(c, w)
    _observe_each_marker(c, w, out)


@helper
def _observe_along_hinges(c, w, loads):
    """Write the loads of springs, then of other laws, along coordinates to loads (S,)."""
    springs = c.hinge_spring.shape[0]
    for i in range(springs):
        loads[i] = w.hinge_spring[i].load
    for i in range(c.coordinate_law.shape[0]):
        loads[springs + i] = w.coordinate_law[i].load


@helper
def _observe_each_marker(c, w, out):
    for i in range(out.marker_port.shape[0]):
        _observe_marker(c, w, out.marker_body[i], out.marker_port[i], out.markers[i])


@helper
def _observe_marker(c, w, k, port, row):
    """The row (24,) of a marker at a port of body k."""
    R = mat3(w.body[k].pose_rotation, 0)
    alpha, a = times6(R, port_acceleration(c, w, k, port))
    store3(row, 0, add(vec3(w.body[k].pose_position, 0), times(R, vec3(w.port[port].r, 0))))
    store9(row, 3, matmul(R, mat3(w.port[port].R, 0)))
    store6(row, 12, times6(R, port_velocity(w, k, port)))
    store6(row, 18, (alpha, add(a, vec3(c.gravity, 0))))


@helper
def _world_wheel_loads(c, w, loads):
    """Loads on all wheels in World axes."""
    for k in range(c.body.shape[0]):
        R = mat3(w.body[k].pose_rotation, 0)
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            store6(loads[i], 0, times6(R, wheel_load(c, w, k, i)))
