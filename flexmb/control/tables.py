"""The arrays of a closed loop: what its kernels read and write besides those of the mechanics.

S signals: the numbers of all sensors, then the outputs of all controllers, in the order of the scene. Inputs, states,
outputs of all controllers stand one controller behind the other. X states belong to continuous controllers, and are
part of the integrator's y = [q, u, x, work].
"""

from __future__ import annotations

import numpy as np

from flexmb.jit.bundle import bundle
from flexmb.typing import Index, Real, Record

COORDINATE, RATE, POSITION, ORIENTATION, VELOCITY, ANGULAR_VELOCITY, DISTANCE, TIME, PROFILE = range(9)
ACCELERATION, ANGULAR_ACCELERATION, SPECIFIC_FORCE, LOAD, DRIVE_LOAD = range(9, 14)
AT_ONCE = ACCELERATION  # sensors of this kind and after depend on the forces of the same instant
WORLD, OWN = range(2)  # axes of a marker sensor

LINEAR, PID, CLAMP, LOOKUP, COMPILED, CALLED = range(6)
SAMPLE, APPLY = range(2)

# Kernels and tables that the loop reaches by address: places in `Loop.address`.
MOTION, MANIFOLD, RETRACTION, CONSTANTS, WORKSPACE, MARKERS, TREE, TREE_WORKSPACE, OBSERVING, OUTPUTS = range(10)
BACK, LEAP, BESIDE = range(10, 13)  # of closed chains; 0 elsewhere
ASKING = 13  # Python, for loads that no kernel finds where the motion was just evaluated; 0 where there is one
ADDRESSES = 14
# The same of `LoopTangent.address`.
JACOBIAN, EXACT, TANGENT = range(3)

_F, _I = np.float64, np.int64


def _record(*fields: tuple) -> np.dtype:
    return np.dtype(list(fields), align=True)


SENSOR = _record(
    ("kind", _I),
    ("signal", _I),  # its first signal
    ("width", _I),
    ("place", _I),  # in y, or the number of a marker, hinge, function or prescribed speed; -1 of one that is free
    ("axes", _I),  # WORLD or OWN; of a distance the other marker
)
CONTROLLER = _record(
    ("law", _I),
    ("sampled", _I),
    ("signal", _I),  # its first output among the signals
    ("input", _I),  # first of its inputs, of its states, of its numbers
    ("inputs", _I),
    ("state", _I),
    ("states", _I),
    ("output", _I),
    ("outputs", _I),
    ("number", _I),
    ("numbers", _I),
    ("function", _I),  # address of a function of the user's
    ("x", _I),  # continuous: where its states begin in x
)
DRIVE = _record(  # function of time whose value is gain times a signal
    ("function", _I),
    ("signal", _I),
    ("gain", _F),
)
INSTANT = _record(
    ("time", _F),
    ("controller", _I),
    ("kind", _I),  # SAMPLE or APPLY
    ("row", _I),  # of `Loop.held`
    ("immediate", _I),  # a sample whose outputs change without delay
)


@bundle
class Loop:
    """A closed loop as kernels see it, constants and workspace in one; made anew for each run."""

    address: Index  # (ADDRESSES,)
    sensor: Record  # SENSOR
    controller: Record  # CONTROLLER
    wire: Index  # signals that the inputs are, of one controller after the other
    number: Real  # constants of the controllers
    drive: Record  # DRIVE
    course: Record  # FUNCTION of the sensors of profiles
    piece: Real  # (T,7) their spline pieces
    function: Record  # FUNCTION of the mechanics, where drives write
    instant: Record  # INSTANT, in time
    has_markers: Index  # (1,) whether a sensor needs the motion of markers
    continuous: Index  # (1,) whether there is a continuous controller
    has_at_once: Index  # (1,) whether a sensor depends on forces of the same instant ...
    follows: Index  # (1,) ... and a continuous controller reads it
    gravity: Real  # (3,)
    slack: Real  # (1,) s: samples of the output this close before an instant see what comes after it

    signal: Real  # (S,)
    input: Real
    state: Real
    output: Real
    change: Real  # rates of states, or what they become
    held: Real  # (samples, most outputs) what each sample of a sampled controller put out
    following: Index  # (1,) instant that comes next
    replaying: Index  # (1,) whether a run is looked at that is over: `held` is read
    now: Real  # (1,) s, of the last evaluation while replaying
    y: Real  # (nq+nu+1,) [q, u, work]
    dy: Real
    stuck: Index  # (1,) whether controllers are too fast for a leap that has been tried
    good: Real  # `state` at the last good state of a closed chain's run
    before: Real  # (nq+nu+1,) on one side of a leap, with its slope ...
    slope_before: Real
    after: Real  # ... and on the other
    slope_after: Real
    driven: Real  # (4,drives) at the nodes of a leap
    rates: Real  # (nu,) accelerations that markers are seen with
    markers: Real  # (K,24) as in flexmb.entry.observation
    loads: Real  # (N+C,6) of hinges, then of closures
    drives: Real  # (nu,)
    doubt: Index  # (1,) of the mechanics' workspace


@bundle
class LoopTangent:
    """What the Jacobian of a closed loop needs besides, y = [q, u, x, work] (n,)."""

    address: Index  # (3,) of the mechanics' Jacobian and its tables
    column: Index  # places in y that sensors read, and those of x
    y: Real  # (n,)
    of_motion: Real  # (nq+nu+1, nq+nu+1)
    slope: Real  # (nq+nu+1,)
    effect: Real  # (drives, nq+nu+1)
    ahead: Real  # (drives + X,) what is driven, and rates of x, on one side of y ...
    behind: Real  # ... and on the other
