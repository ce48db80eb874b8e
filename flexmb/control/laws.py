"""Control laws: outputs, and changes of states, from inputs and states. One helper for each kind of controller.

A change is the rate of a state; for a sampled controller it is the next value of the state.
"""

from flexmb.control.foreign_laws import called_along, compiled_along
from flexmb.control.tables import CALLED, CLAMP, COMPILED, LINEAR, LOOKUP, PID, LoopVariation
from flexmb.jit.direct import nothing_at, status_at
from flexmb.jit.kernel import by_bundle, helper, sweep
from flexmb.spatial.scalar import exp
from flexmb.tables.status import OK

# Indices of the parameters of a PID controller.
KP, KI, KD, FILTER, LOWER, UPPER, TRACKING, SETPOINT, PERIOD, PID_NUMBERS = range(10)
INTEGRAL, FILTERED, BEGUN = range(3)  # states; BEGUN, whether it has acted, only of a sampled one


@sweep
def act(t, i, s):
    """Evaluate controller i at s.input and s.state, into s.output and s.change; returns a status code."""
    law = s.controller[i].law
    if law == LINEAR:
        _linear(i, s)
    elif law == PID:
        _pid(i, s)
    elif law == CLAMP:
        _clamp(i, s)
    elif law == LOOKUP:
        _lookup(i, s)
    elif law == COMPILED:
        _compiled(s, t, i)
    elif law == CALLED:
        return _called(s, t, i)
    return OK


@helper
def _linear(i, s):
    """[change; output] = [A B; C D] [state; input]."""
    o = s.controller[i]
    columns = o.states + o.inputs
    for row in range(o.states + o.outputs):
        first, total = o.number + row * columns, 0.0
        for j in range(o.states):
            total += s.number[first + j] * s.state[o.state + j]
        for j in range(o.inputs):
            total += s.number[first + o.states + j] * s.input[o.input + j]
        if row < o.states:
            s.change[o.state + row] = total
        else:
            s.output[o.output + row - o.states] = total


@helper
def pid_error(i, s):
    """Setpoint minus input."""
    o = s.controller[i]
    setpoint = s.input[o.input + 1] if o.inputs == 2 else s.number[o.number + SETPOINT]
    return setpoint - s.input[o.input]


@helper
def _pid(i, s):
    o = s.controller[i]
    p = o.number
    e, filtered = pid_error(i, s), s.state[o.state + FILTERED]
    filter_s, period = s.number[p + FILTER], s.number[p + PERIOD]
    if o.sampled and s.state[o.state + BEGUN].real == 0.0:
        filtered = e  # no previous error exists before the first instant
    slope = (e - filtered) / filter_s if filter_s.real > 0.0 else 0.0 * e
    if filter_s.real == 0.0 and o.sampled:
        slope = (e - filtered) / period
    asked = s.number[p + KP] * e + s.state[o.state + INTEGRAL] + s.number[p + KD] * slope
    given = clamped(asked, s.number[p + LOWER], s.number[p + UPPER])
    gain = s.number[p + KI] * e + (given - asked) / s.number[p + TRACKING]
    s.output[o.output] = given
    if o.sampled:
        s.change[o.state + INTEGRAL] = s.state[o.state + INTEGRAL] + period * gain
        left = exp(-period / filter_s) if filter_s.real > 0.0 else 0.0 * filter_s
        s.change[o.state + FILTERED] = e + left * (filtered - e)
        s.change[o.state + BEGUN] = 1.0
    else:
        s.change[o.state + INTEGRAL] = gain
        s.change[o.state + FILTERED] = slope


@helper
def _clamp(i, s):
    o = s.controller[i]
    for j in range(o.outputs):
        s.output[o.output + j] = clamped(s.input[o.input + j], s.number[o.number], s.number[o.number + 1])


@helper
def clamped(x, lower, upper):
    """x, or the bound that it exceeds."""
    if x.real < lower.real:
        return lower
    return upper if x.real > upper.real else x


@helper
def _lookup(i, s):
    """Linear interpolation; the parameters are the points, then the values."""
    o = s.controller[i]
    n, p = o.numbers // 2, o.number
    x = clamped(s.input[o.input], s.number[p], s.number[p + n - 1])
    j = 0
    while j + 2 < n and x.real > s.number[p + j + 1].real:
        j += 1
    gain = s.number[p + n + j]
    if n > 1:
        share = (x - s.number[p + j]) / (s.number[p + j + 1] - s.number[p + j])
        gain += share * (s.number[p + n + j + 1] - gain)
    if o.inputs == 1:
        s.output[o.output] = gain
    for j in range(1, o.inputs):
        s.output[o.output + j - 1] = gain * s.input[o.input + j]


@helper
def _called_alone(s, t, i):
    """Call a Python function, which finds its arrays itself; returns a status code."""
    return status_at(s.controller[i].function, (t,))


@helper
def _compiled_alone(s, t, i):
    """Call a user function by its address."""
    o = s.controller[i]
    nothing_at(
        o.function,
        (
            t,
            s.input[o.input : o.input + o.inputs],
            s.state[o.state : o.state + o.states],
            s.number[o.number : o.number + o.numbers],
            s.output[o.output : o.output + o.outputs],
            s.change[o.state : o.state + o.states],
        ),
    )


_called = by_bundle(LoopVariation, called_along, _called_alone)
_compiled = by_bundle(LoopVariation, compiled_along, _compiled_alone)
