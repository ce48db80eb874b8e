"""Evaluation of sensors at y = [q, u, work] in s.y, into s.signal."""

from flexmb.control import tables as a
from flexmb.jit.direct import nothing_at, status_at
from flexmb.jit.kernel import by_bundle, helper, kernel, sweep
from flexmb.spatial.scalar import sqrt
from flexmb.spatial.vector import dot, mat3, store3, sub, times_t, vec3
from flexmb.tables.functions import evaluate

_R, _VELOCITY, _ACCELERATION = 3, 12, 18  # indices in the row of a marker


@helper
def measure_motion(t, s):
    """Evaluate all sensors that depend only on coordinates, speeds and time."""
    if s.has_markers[0]:
        see_markers(t, s)
    for i in range(s.sensor.shape[0]):
        if s.sensor[i].kind < a.AT_ONCE:
            _measure(t, i, s)


@sweep
def measure_at_once(t, s):
    """Evaluate all other sensors, where the equations of motion were just evaluated: s.dy, the mechanics' workspace."""
    first = s.y.shape[0] - 1 - s.rates.shape[0]
    for j in range(s.rates.shape[0]):
        s.rates[j] = s.dy[first + j]
    _observe(s, t)
    if s.has_markers[0]:
        see_markers(t, s)
    for i in range(s.sensor.shape[0]):
        if s.sensor[i].kind >= a.AT_ONCE:
            _measure(t, i, s)


@helper
def _observe_alone(s, t):
    """Evaluate the loads where the equations of motion were just evaluated."""
    if s.address[a.OBSERVING]:
        nothing_at(s.address[a.OBSERVING], (s.address[a.CONSTANTS], s.address[a.WORKSPACE], s.address[a.OUTPUTS]))
    if s.address[a.ASKING]:
        status_at(s.address[a.ASKING], (t,))  # an exception in Python ends the run by itself


@helper
def _observe_varied(s, t):
    nothing_at(s.address[a.OBSERVING], (s.address[a.WORKSPACE], s.address[a.OUTPUTS]))


_observe = by_bundle(a.LoopVariation, _observe_varied, _observe_alone)


@helper
def see_markers(t, s):
    """Evaluate the rows of all markers into s.markers, with the accelerations in s.rates."""
    _see(s, t)


@helper
def _see_alone(s, t):
    nothing_at(
        s.address[a.MARKERS],
        (t, s.y, s.address[a.TREE], s.address[a.TREE_WORKSPACE], s.address[a.OUTPUTS]),
    )


@helper
def _see_varied(s, t):
    nothing_at(s.address[a.MARKERS], (t, s.address[a.TREE], s.address[a.TREE_WORKSPACE], s.address[a.OUTPUTS]))


_see = by_bundle(a.LoopVariation, _see_varied, _see_alone)


@helper
def _measure(t, i, s):
    sensor = s.sensor[i]
    first, kind, place = sensor.signal, sensor.kind, sensor.place
    if kind <= a.RATE:
        for n in range(sensor.width):
            s.signal[first + n] = s.y[place + n]
    elif kind == a.TIME:
        s.signal[first] = t
    elif kind == a.PROFILE:
        f = s.course[place]
        value, rate, _ = evaluate(f.kind, f.data, f.start, f.stop, s.piece, t)
        s.signal[first] = value
        s.signal[first + 1] = rate
    elif kind == a.LOAD:
        for n in range(6):
            s.signal[first + n] = s.loads[place, n]
    elif kind == a.DRIVE_LOAD:
        s.signal[first] = s.drives[place] if place >= 0 else 0.0
    elif kind == a.DISTANCE:
        s.signal[first], s.signal[first + 1] = _distance(s.markers[place], s.markers[sensor.axes])
    elif kind == a.ORIENTATION:
        _store_quaternion(s.markers[place], s.signal, first)
    else:
        _store_vector(kind, sensor.axes, s.markers[place], s, first)


@helper
def _distance(row_a, row_b):
    """Distance of two markers, and its rate; where they coincide, the rate is the relative speed."""
    along, moving = sub(vec3(row_b, 0), vec3(row_a, 0)), sub(vec3(row_b, _VELOCITY + 3), vec3(row_a, _VELOCITY + 3))
    length = sqrt(dot(along, along))
    return length, dot(along, moving) / length if length.real > 0.0 else sqrt(dot(moving, moving))


@helper
def _store_vector(kind, axes, row, s, first):
    """Store a vector of a marker, in World axes or its own."""
    v = vec3(row, 0)
    if kind == a.ANGULAR_VELOCITY:
        v = vec3(row, _VELOCITY)
    elif kind == a.VELOCITY:
        v = vec3(row, _VELOCITY + 3)
    elif kind == a.ANGULAR_ACCELERATION:
        v = vec3(row, _ACCELERATION)
    elif kind == a.ACCELERATION:
        v = vec3(row, _ACCELERATION + 3)
    elif kind == a.SPECIFIC_FORCE:
        v = sub(vec3(row, _ACCELERATION + 3), vec3(s.gravity, 0))
    if axes == a.OWN:
        v = times_t(mat3(row, _R), v)
    store3(s.signal, first, v)


@helper
def _store_quaternion(row, signal, first):
    """Store the quaternion of R_World_marker, found by its largest component, with a nonnegative scalar part."""
    xx, xy, xz = row[_R], row[_R + 1], row[_R + 2]
    yx, yy, yz = row[_R + 3], row[_R + 4], row[_R + 5]
    zx, zy, zz = row[_R + 6], row[_R + 7], row[_R + 8]
    trace = xx + yy + zz
    if trace.real >= xx.real and trace.real >= yy.real and trace.real >= zz.real:
        d = 2.0 * sqrt(1.0 + trace)
        w, x, y, z = 0.25 * d, (zy - yz) / d, (xz - zx) / d, (yx - xy) / d
    elif xx.real >= yy.real and xx.real >= zz.real:
        d = 2.0 * sqrt(1.0 + xx - yy - zz)
        w, x, y, z = (zy - yz) / d, 0.25 * d, (xy + yx) / d, (xz + zx) / d
    elif yy.real >= zz.real:
        d = 2.0 * sqrt(1.0 - xx + yy - zz)
        w, x, y, z = (xz - zx) / d, (xy + yx) / d, 0.25 * d, (yz + zy) / d
    else:
        d = 2.0 * sqrt(1.0 - xx - yy + zz)
        w, x, y, z = (yx - xy) / d, (xz + zx) / d, (yz + zy) / d, 0.25 * d
    sign = -1.0 if w.real < 0.0 else 1.0
    signal[first] = sign * w
    signal[first + 1] = sign * x
    signal[first + 2] = sign * y
    signal[first + 3] = sign * z


@kernel
def sensors_by_time(t, s, out):
    """out (S,): how the signals of sensors change with time while the state is held, into zeros."""
    for i in range(s.sensor.shape[0]):
        sensor = s.sensor[i]
        if sensor.kind == a.TIME:
            out[sensor.signal] = 1.0
        elif sensor.kind == a.PROFILE:
            f = s.course[sensor.place]
            _, rate, acceleration = evaluate(f.kind, f.data, f.start, f.stop, s.piece, t)
            out[sensor.signal] = rate
            out[sensor.signal + 1] = acceleration
