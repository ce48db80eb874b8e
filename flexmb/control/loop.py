"""The right-hand side of the closed loop for integrators: the equations of motion with controllers.

Controller outputs are the values of functions of time of the mechanics, `Loop.drive`: every right-hand side uses them
as torques or forces and needs no knowledge of controllers. Sampled controllers act at the first evaluation of the
right-hand side at their instant. Instants are ends of segments (`flexmb.integrate.problem.Clock`), and integrators
evaluate nothing at or beyond the end of a segment before they have reached it: the first evaluation at an instant is at
the state of the run there.

A loop holds constants and workspace; it is passed for both arguments, as `s` and `same`.
"""

from flexmb.control import tables as a
from flexmb.control.laws import FILTERED, act, pid_error
from flexmb.control.measuring import measure_at_once, measure_motion
from flexmb.jit.direct import nothing_at, real_at, status_at
from flexmb.jit.kernel import by_bundle, helper, kernel, sweep
from flexmb.tables.status import CLOSURE_SINGULAR, OK


@kernel
def rhs(t, y, dy, s, same):
    """dy/dt of y = [q, u, x, work] at time t; returns a status code."""
    if s.stuck[0]:
        return CLOSURE_SINGULAR
    take(y, s)
    status = set_drives(t, s)
    if status == OK:
        status = accelerate(t, s)
    if status == OK and s.follows[0]:
        status = follow(t, s)
    give(s.dy, s.change, s, dy)
    return status


@kernel
def project(t, y, s):
    """Project the mechanical part of y on its manifold."""
    settle(t, y, s)


@kernel
def move(y, increment, result, s):
    """Coordinates of result = q o exp(increment), as for the mechanics alone; increments of x have no effect."""
    nothing_at(s.address[a.RETRACTION], (y, increment, result, s.address[a.CONSTANTS]))


@kernel
def resolve(y, u, x, how, s):
    """Resolve speeds, or their rates, as for the mechanics alone."""
    nothing_at(s.address[a.AXES], (y, u, x, how, s.address[a.CONSTANTS]))


@kernel
def observe(s, same, out):
    """Observe with the mechanics' kernel where `rhs` was just evaluated."""
    nothing_at(s.address[a.OBSERVING], (s.address[a.CONSTANTS], s.address[a.WORKSPACE], out))


@kernel
def start(t, y, s):
    """Begin a run at t and y, and write the continuous controllers' states to y.

    Derivative filters of continuous PID controllers start at the initial error, which may depend on the outputs of
    controllers listed before. Those of sampled ones start at the error of their first instant (`flexmb.control.laws`).
    """
    take(y, s)
    begin_laws(t, s)
    give(s.y, s.state, s, y)


@helper
def begin_laws(t, s):
    """Begin the continuous controllers at s.y, as `start` does."""
    measure_motion(t, s)
    for i in range(s.controller.shape[0]):
        o = s.controller[i]
        if not o.sampled:
            _gather(i, s)
            if o.law == a.PID:
                s.state[o.state + FILTERED] = pid_error(i, s)
            if act(t, i, s) != OK:
                break  # the first evaluation fails too, and reports it
            for j in range(o.outputs):
                s.signal[o.signal + j] = s.output[o.output + j]


@kernel
def retrace(times, states, s, course):
    """Signals (T,S) of a finished run at its output times (T,), from its states (T,n); returns how many were found."""
    for sample in range(times.shape[0]):
        t = times[sample]
        take(states[sample], s)
        if _keep_time(t, s) != OK or steer(t, s) != OK:
            return sample
        if s.has_at_once[0]:
            if accelerate(t, s) != OK:
                return sample
            measure_at_once(t, s)
        for i in range(s.signal.shape[0]):
            course[sample, i] = s.signal[i]
    return times.shape[0]


@kernel
def hold(t, y, s):
    """Set the functions of the mechanics to the controller outputs at t and y; returns a status code."""
    take(y, s)
    return set_drives(t, s)


@kernel
def look(t, y, signal, s):
    """All signals (S,) at t and y, between instants; returns a status code."""
    take(y, s)
    status = sense(t, s)
    for i in range(signal.shape[0]):
        signal[i] = s.signal[i]
    return status


@kernel
def respond(t, s):
    """Evaluate continuous controllers for the present sensor signals and states; returns a status code."""
    status = _act_continuously(t, s)
    _drive(s)
    return status


@kernel
def put_drive(i, value, s):
    """Give the function of time that drive i sets another value."""
    s.function[s.drive[i].function].data[0] = value


@helper
def settle(t, y, s):
    """Project the mechanical part of y on its manifold, and keep the controller states with the last accepted state."""
    take(y, s)
    nothing_at(s.address[a.MANIFOLD], (t, s.y, s.address[a.CONSTANTS]))
    if s.address[a.BACK] and real_at(s.address[a.BACK], (s.before, s.address[a.CONSTANTS])) == t:
        keep_good(s)
    give(s.y, s.state, s, y)


@helper
def keep_good(s):
    """Store the controller states with the last accepted state of the motion."""
    for i in range(s.state.shape[0]):
        s.good[i] = s.state[i]


@helper
def set_drives(t, s):
    """Set the drive values at t; returns a status code. Sensors are evaluated only for continuous controllers."""
    status = _keep_time(t, s)
    if status == OK and s.continuous[0]:
        return steer(t, s)
    _drive(s)
    return status


@sweep
def take(y, s):
    """Split y = [q, u, x, work] into s.y = [q, u, work] and the continuous controllers' states."""
    n = s.y.shape[0] - 1
    for i in range(n):
        s.y[i] = y[i]
    s.y[n] = y[y.shape[0] - 1]
    for i in range(s.controller.shape[0]):
        o = s.controller[i]
        if not o.sampled:
            for j in range(o.states):
                s.state[o.state + j] = y[n + o.x + j]


@sweep
def give(of_mechanics, of_controllers, s, y):
    """Join states of mechanics and controllers, or their rates, to y = [q, u, x, work]."""
    n = s.y.shape[0] - 1
    for i in range(n):
        y[i] = of_mechanics[i]
    y[y.shape[0] - 1] = of_mechanics[n]
    for i in range(s.controller.shape[0]):
        o = s.controller[i]
        if not o.sampled:
            for j in range(o.states):
                y[n + o.x + j] = of_controllers[o.state + j]


@helper
def _keep_time(t, s):
    """Execute all pending instants up to t; returns a status code."""
    reached = t
    if s.replaying[0]:
        if t < s.now[0].real:
            _rewind(s)
        s.now[0] = t
        reached = t + s.slack[0].real
    looked_at = -1.0
    while s.following[0] < s.instant.shape[0] and reached >= s.instant[s.following[0]].time.real:
        due = s.instant[s.following[0]]
        if due.kind == a.APPLY:
            _put_out(due.controller, due.row, s)
        elif not s.replaying[0]:
            if looked_at != due.time.real:
                status = sense(t, s)
                if status != OK:
                    return status
                looked_at = due.time.real
            status = _sample(t, due.controller, due.row, s)
            if status != OK:
                return status
        if due.immediate:
            _put_out(due.controller, due.row, s)
        s.following[0] += 1
    return OK


@helper
def _rewind(s):
    """Go back to before the first instant."""
    s.following[0] = 0
    for i in range(s.controller.shape[0]):
        if s.controller[i].sampled:
            for j in range(s.controller[i].outputs):
                s.signal[s.controller[i].signal + j] = 0.0


@helper
def sense(t, s):
    """Evaluate everything that a sampled controller may read at t: all sensors and the continuous controllers."""
    status = steer(t, s)
    if status == OK and s.has_at_once[0]:
        status = accelerate(t, s)
        if status == OK:
            measure_at_once(t, s)
    return status


@helper
def _sample(t, i, row, s):
    """Execute controller i; its outputs are held in a row of s.held."""
    o = s.controller[i]
    _gather(i, s)
    status = act(t, i, s)
    for j in range(o.outputs):
        s.held[row, j] = s.output[o.output + j]
    for j in range(o.states):
        s.state[o.state + j] = s.change[o.state + j]
    return status


@helper
def _put_out(i, row, s):
    """Apply the held outputs in this row as those of controller i."""
    for j in range(s.controller[i].outputs):
        s.signal[s.controller[i].signal + j] = s.held[row, j]


@helper
def _gather(i, s):
    """Copy the inputs of controller i from the signals."""
    o = s.controller[i]
    for j in range(o.inputs):
        s.input[o.input + j] = s.signal[s.wire[o.input + j]]


@sweep
def steer(t, s):
    """Evaluate sensors, continuous controllers and drives; returns a status code.

    Signals that depend directly on the forces are not known yet and are zero here; they reach outputs only through
    controller states.
    """
    measure_motion(t, s)
    if s.follows[0]:
        _forget_at_once(s)
    status = _act_continuously(t, s)
    _drive(s)
    return status


@helper
def _drive(s):
    """Set the functions of time of the mechanics that are driven by signals."""
    for i in range(s.drive.shape[0]):
        s.function[s.drive[i].function].data[0] = s.drive[i].gain * s.signal[s.drive[i].signal]


@helper
def _forget_at_once(s):
    for i in range(s.sensor.shape[0]):
        if s.sensor[i].kind >= a.AT_ONCE:
            for n in range(s.sensor[i].width):
                s.signal[s.sensor[i].signal + n] = 0.0


@helper
def _act_continuously(t, s):
    for i in range(s.controller.shape[0]):
        o = s.controller[i]
        if not o.sampled:
            _gather(i, s)
            status = act(t, i, s)
            if status != OK:
                return status
            for j in range(o.outputs):
                s.signal[o.signal + j] = s.output[o.output + j]
    return OK


@helper
def accelerate(t, s):
    """Evaluate the mechanics' right-hand side into s.dy; returns a status code."""
    return _move(s, t)


@helper
def _move_alone(s, t):
    return status_at(s.address[a.MOTION], (t, s.y, s.dy, s.address[a.CONSTANTS], s.address[a.WORKSPACE]))


@helper
def _move_varied(s, t):
    return status_at(s.address[a.MOTION], (t, s.address[a.WORKSPACE]))


_move = by_bundle(a.LoopVariation, _move_varied, _move_alone)


@helper
def follow(t, s):
    """Evaluate the rates of controllers that read signals with direct dependence on the forces."""
    measure_at_once(t, s)
    return _act_continuously(t, s)
