"""Derivatives of control laws that only floats can pass: functions of users, compiled or plain Python.

Along each direction the law is differentiated by central differences over two steps, whose combination (Richardson) has
an error of fourth order. A law of polynomials up to the fourth degree is differentiated to rounding. Where both differ
by more than `SMOOTH`, the steps are shortened, since a corner of the law may lie between their ends. So they are where
the slopes before and behind the point do not approach each other as the step does: about a corner in the middle, as
|x| has at 0, central differences agree. A law that has none of these derivatives gets NaN, which ends the run.
"""

from math import nan

from flexmb.control.tables import CALLED
from flexmb.jit.direct import nothing_at, status_at
from flexmb.jit.duals import RATES, rate, seeded
from flexmb.jit.kernel import helper, sweep
from flexmb.tables.status import OK

# Relative change of what the law reads over the first step: its fourth power is 1e-12, and 2^-53 over it 1e-13.
STEP = 2.0**-10
SHORTER = 2.0**-4  # factor on the step in the next attempt
ATTEMPTS = 3
SMOOTH = 2.0**-20  # relative difference of the two differences: of a smooth law it is the square of the step
ROUNDING = 2.0**-48  # of the law's values, which the step divides: 32 units of rounding


@helper
def called_along(s, t, i):
    """Outputs and changes of a Python law and their derivatives; returns a status code."""
    return _along(s, t, i)


@helper
def compiled_along(s, t, i):
    """The same for a compiled one."""
    _along(s, t, i)


@sweep
def _along(s, t, i):
    o, p = s.controller[i], s.plain
    status = _at(s, t, i, 0, 0.0)
    _keep(o, p, p.value)
    for j in range(o.outputs):
        s.output[o.output + j] = p.value[j]
    for j in range(o.states):
        s.change[o.state + j] = p.value[o.outputs + j]
    for lane in range(RATES):
        size = _size(s, i, lane)
        if size > 0.0 and status == OK:
            status = _differentiated(s, t, i, lane, STEP / size)
            for j in range(o.outputs):
                x = s.output[o.output + j]
                s.output[o.output + j] = x + p.fine[j] * (seeded(x, lane) - x)
            for j in range(o.states):
                x = s.change[o.state + j]
                s.change[o.state + j] = x + p.fine[o.outputs + j] * (seeded(x, lane) - x)
    if status == OK:
        status = _at(s, t, i, 0, 0.0)
    return status


@helper
def _size(s, i, lane):
    """The largest change of what the law reads along a direction, relative to its size or to one."""
    o, most = s.controller[i], 0.0
    for j in range(o.inputs):
        x = s.input[o.input + j]
        most = max(most, abs(rate(x, lane)) / max(1.0, abs(x.real)))
    for j in range(o.states):
        x = s.state[o.state + j]
        most = max(most, abs(rate(x, lane)) / max(1.0, abs(x.real)))
    for j in range(o.numbers):
        x = s.number[o.number + j]
        most = max(most, abs(rate(x, lane)) / max(1.0, abs(x.real)))
    return most


@helper
def _differentiated(s, t, i, lane, step):
    """Derivatives along a direction, to p.fine; returns a status code."""
    p, n = s.plain, s.controller[i].outputs + s.controller[i].states
    for _ in range(ATTEMPTS):
        status = _difference(s, t, i, lane, step, p.coarse, p.bend)
        if status == OK:
            status = _difference(s, t, i, lane, 0.5 * step, p.fine, p.less_bend)
        if status != OK:
            return status
        smooth = True
        for j in range(n):
            limit = SMOOTH * (abs(p.fine[j]) + abs(p.coarse[j])) + ROUNDING * abs(p.value[j]) / step
            if not abs(p.fine[j] - p.coarse[j]) <= limit:
                smooth = False
            # of a smooth law it is halved with the step, up to its fourth derivative times the third power of the step
            if not abs(p.less_bend[j] - 0.5 * p.bend[j]) <= SMOOTH * abs(p.bend[j]) + limit:
                smooth = False
            p.fine[j] += (p.fine[j] - p.coarse[j]) / 3.0
        if smooth:
            return OK
        step *= SHORTER
    for j in range(n):
        p.fine[j] = nan
    return OK


@helper
def _difference(s, t, i, lane, step, slope, bend):
    """Central differences of outputs and changes over a step along a direction, and by how much those behind the point
    exceed those before it; returns a status code."""
    o, p = s.controller[i], s.plain
    status = _at(s, t, i, lane, step)
    _keep(o, p, slope)
    if status == OK:
        status = _at(s, t, i, lane, -step)
    _keep(o, p, bend)
    for j in range(o.outputs + o.states):
        ahead, behind = slope[j] - p.value[j], p.value[j] - bend[j]
        slope[j] = (ahead + behind) / (2.0 * step)
        bend[j] = (ahead - behind) / step
    return status


@helper
def _keep(o, p, into):
    """The outputs and changes of a law, as it has just written them."""
    for j in range(o.outputs):
        into[j] = p.output[o.output + j]
    for j in range(o.states):
        into[o.outputs + j] = p.change[o.state + j]


@sweep
def _at(s, t, i, lane, step):
    """Evaluate the law where a step along a direction leads; returns a status code."""
    o, p = s.controller[i], s.plain
    for j in range(o.inputs):
        x = s.input[o.input + j]
        p.input[o.input + j] = x.real + step * rate(x, lane)
    for j in range(o.states):
        x = s.state[o.state + j]
        p.state[o.state + j] = x.real + step * rate(x, lane)
    for j in range(o.numbers):
        x = s.number[o.number + j]
        p.number[o.number + j] = x.real + step * rate(x, lane)
    if o.law == CALLED:
        return status_at(o.function, (t,))
    nothing_at(
        o.function,
        (
            t,
            p.input[o.input : o.input + o.inputs],
            p.state[o.state : o.state + o.states],
            p.number[o.number : o.number + o.numbers],
            p.output[o.output : o.output + o.outputs],
            p.change[o.state : o.state + o.states],
        ),
    )
    return OK
