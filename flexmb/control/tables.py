"""The arrays of a closed loop that its kernels read and write, in addition to those of the mechanics.

S signals: the values of all sensors, then the outputs of all controllers, in the order of the scene. Inputs, states and
outputs of all controllers are concatenated in that order. X states belong to continuous controllers, and are part of
the integrator's y = [q, u, x, work].
"""

from __future__ import annotations

import numpy as np

from flexmb.jit.bundle import bundle
from flexmb.jit.duals import DUAL
from flexmb.typing import Index, Real, Record

COORDINATE, RATE, POSITION, ORIENTATION, VELOCITY, ANGULAR_VELOCITY, DISTANCE, TIME, PROFILE = range(9)
ACCELERATION, ANGULAR_ACCELERATION, SPECIFIC_FORCE, LOAD, DRIVE_LOAD = range(9, 14)
AT_ONCE = ACCELERATION  # kinds from this one on depend directly on the forces of the same instant
WORLD, OWN = range(2)  # axes of a marker sensor

LINEAR, PID, CLAMP, LOOKUP, COMPILED, CALLED = range(6)
SAMPLE, APPLY = range(2)

# Indices in `Loop.address` of the kernels and tables that the loop reaches by address.
MOTION, MANIFOLD, RETRACTION, CONSTANTS, WORKSPACE, MARKERS, TREE, TREE_WORKSPACE, OBSERVING, OUTPUTS = range(10)
BACK, LEAP, BESIDE = range(10, 13)  # of closed chains; 0 elsewhere
ASKING = 13  # callback to Python for loads where no kernel computes them; 0 where one does
AXES = 14  # of increments
ADDRESSES = 15
# Indices in `LoopTangent.address`.
JACOBIAN, EXACT, TANGENT = range(3)

_F, _I = np.float64, np.int64


def _record(*fields: tuple) -> np.dtype:
    return np.dtype(list(fields), align=True)


SENSOR = _record(
    ("kind", _I),
    ("signal", _I),  # index of its first signal
    ("width", _I),
    ("place", _I),  # index in y, or of a marker, hinge, function or prescribed speed; -1 of a free one
    ("axes", _I),  # WORLD or OWN; for a distance the other marker
)
CONTROLLER = _record(
    ("law", _I),
    ("sampled", _I),
    ("signal", _I),  # index of its first output among the signals
    ("input", _I),  # index of its first input; likewise state and parameter
    ("inputs", _I),
    ("state", _I),
    ("states", _I),
    ("output", _I),
    ("outputs", _I),
    ("number", _I),
    ("numbers", _I),
    ("function", _I),  # address of a user function
    ("x", _I),  # continuous: start index of its states in x
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
    """A closed loop for kernels, both constants and workspace; a new one is made for each run."""

    address: Index  # (ADDRESSES,)
    sensor: Record  # SENSOR
    controller: Record  # CONTROLLER
    wire: Index  # signal of each input, by controller
    number: Real  # parameters of the controllers
    drive: Record  # DRIVE
    course: Record  # FUNCTION of the sensors of profiles
    piece: Real  # (T,7) their spline pieces
    function: Record  # FUNCTION of the mechanics, to which drives write
    instant: Record  # INSTANT, in order of time
    has_markers: Index  # (1,) whether a sensor needs the motion of markers
    continuous: Index  # (1,) whether there is a continuous controller
    has_at_once: Index  # (1,) whether a sensor depends directly on forces ...
    follows: Index  # (1,) ... and a continuous controller reads it
    gravity: Real  # (3,)
    slack: Real  # (1,) s: an output sample this close before an instant shows the signals after it

    signal: Real  # (S,)
    input: Real
    state: Real
    output: Real
    change: Real  # rates of states; next values for sampled controllers
    held: Real  # (samples, most outputs) outputs of each sample of a sampled controller
    following: Index  # (1,) index of the next instant
    replaying: Index  # (1,) whether a finished run is replayed: `held` is read
    now: Real  # (1,) s, time of the last evaluation in a replay
    y: Real  # (nq+nu+1,) [q, u, work]
    dy: Real
    stuck: Index  # (1,) whether a leap failed because controllers are too fast
    good: Real  # `state` at the last accepted state of a closed chain's run
    before: Real  # (nq+nu+1,) on one side of a leap, with its slope ...
    slope_before: Real
    after: Real  # ... and on the other
    slope_after: Real
    driven: Real  # (4,drives) drive values at the nodes of a leap
    rates: Real  # (nu,) accelerations for the motion of markers
    markers: Real  # (K,24) as in flexmb.entry.observation
    loads: Real  # (N+C,6) of hinges, then of closures
    drives: Real  # (nu,)
    doubt: Index  # (1,) of the mechanics' workspace


@bundle
class PlainLaw:
    """Arrays of floats for laws that take no other numbers: those of the loop of floats, in which Python laws look."""

    input: Real
    state: Real
    number: Real
    output: Real
    change: Real
    value: Real  # (most outputs and states of a controller,) of the law at one point ...
    coarse: Real  # ... its differences over a step ...
    fine: Real  # ... and over half of it ...
    bend: Real  # ... and how much slopes on both sides of the point differ, over a step ...
    less_bend: Real  # ... and over half of it


@bundle
class LoopVariation:
    """A closed loop in dual numbers, whose lanes carry derivatives along seven directions.

    Entries of equal names are those of `Loop`; its helpers are compiled for both. In `address` are the kernels of the
    motion in dual numbers, which find its state themselves: MOTION (t, WORKSPACE), OBSERVING (WORKSPACE, OUTPUTS),
    MARKERS (t, TREE, TREE_WORKSPACE, OUTPUTS).
    """

    numbers = DUAL

    plain: PlainLaw
    address: Index
    sensor: Record
    controller: Record
    wire: Index
    number: Real
    drive: Record
    course: Record
    piece: Real
    function: Record
    instant: Record
    has_markers: Index
    continuous: Index
    has_at_once: Index
    follows: Index
    gravity: Real
    slack: Real

    signal: Real
    input: Real
    state: Real
    output: Real
    change: Real
    held: Real
    following: Index
    replaying: Index
    now: Real
    y: Real
    dy: Real
    rates: Real
    markers: Real
    loads: Real
    drives: Real


@bundle
class LoopTangent:
    """Additional tables of the Jacobian of a closed loop, y = [q, u, x, work] (n,)."""

    address: Index  # (3,) of the mechanics' Jacobian and its tables
    column: Index  # indices in y that sensors read, and those of x
    y: Real  # (n,)
    of_motion: Real  # (nq+nu+1, nq+nu+1)
    slope: Real  # (nq+nu+1,)
    effect: Real  # (drives, nq+nu+1)
    ahead: Real  # (drives + X,) drive values and rates of x on one side of y ...
    behind: Real  # ... and on the other
