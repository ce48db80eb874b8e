"""Rows of the matrices in strips: for the sources inboard of a row, run by run, and for those that its body carries."""

from flexmb.jain.derivatives.tables import BY_ACCELERATION, BY_RATE, SPEED_BY_ACCELERATION, SPEED_BY_RATE, TURN
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.strips import after, part, put, strip, width
from flexmb.spatial.rows import strips3
from flexmb.spatial.spatial_vector import dot6, shift_force, store6, vec6
from flexmb.spatial.vector import dot, vec3
from flexmb.tables.features import CONNECTORS, LOADS, MODES


@helper
def inboard_columns(c, d, place, path, answer, masses):
    """Row `place` for all sources of a path: l2 . s2 + l1 . s1 + l0 . s0, and l2 . J for the mass matrix.

    `path`: the last run and the end of its slots; `answer`: l2, l1 and l0.
    """
    run, end = path
    l2, l1, l0 = answer
    nu = d.speed.shape[0]
    row = d.matrix[place]
    while run >= 0:
        offset = d.run[run].offset
        n = d.run[run].start
        while n < end:
            J = strips3(d, d.seed, 0, n), strips3(d, d.seed, 3, n)
            turn = strips3(d, d.seed, TURN, n) if has(c, MODES) else J[0]
            speed = strips3(d, d.seed, SPEED_BY_RATE, n) if has(c, MODES) else J[0]
            s2 = strips3(d, d.seed, BY_ACCELERATION, n), strips3(d, d.seed, BY_ACCELERATION + 3, n)
            x = dot6(l2, s2) + dot(l1, strips3(d, d.seed, BY_RATE, n))
            if has(c, LOADS) or has(c, CONNECTORS):
                x += dot(l0, turn)
            put_until(d, row, n + offset, end - n, x)
            s2 = strips3(d, d.seed, SPEED_BY_ACCELERATION, n), strips3(d, d.seed, SPEED_BY_ACCELERATION + 3, n)
            put_until(d, row, nu + n + offset, end - n, dot6(l2, s2) + dot(l1, speed))
            if masses:
                put_until(d, row, 2 * nu + n + offset, end - n, dot6(l2, J))
            n += width(d)
        end = d.run[run].stop
        if d.run[run].new_point:
            l2 = at_inboard_point(l2, vec3(d.body[d.run[run].body].step, 0))
        run = d.run[run].inboard


@helper
def inboard_columns_of_modes(c, d, k, nm, masses):
    """The same for the rows of all modes of body k at once, whose l2, l1 and l0 are in `mode`: each strip of sources is
    read once for all of them."""
    first, run, end, nu = d.places[k].modes, d.places[k].run, d.places[k].end, d.speed.shape[0]
    for i in range(nm):
        for row in range(12):
            d.answer[i, row] = d.mode[k, row, i]
    while run >= 0:
        offset = d.run[run].offset
        n = d.run[run].start
        while n < end:
            J = strips3(d, d.seed, 0, n), strips3(d, d.seed, 3, n)
            turn, speed = strips3(d, d.seed, TURN, n), strips3(d, d.seed, SPEED_BY_RATE, n)
            s1, s2 = strips3(d, d.seed, BY_RATE, n), six_strips(d, BY_ACCELERATION, n)
            s2_speed = six_strips(d, SPEED_BY_ACCELERATION, n)
            for i in range(nm):
                row, l2, l1 = d.matrix[first + i], vec6(d.answer[i], 0), vec3(d.answer[i], 6)
                x = dot6(l2, s2) + dot(l1, s1)
                if has(c, LOADS) or has(c, CONNECTORS):
                    x += dot(vec3(d.answer[i], 9), turn)
                put_until(d, row, n + offset, end - n, x)
                put_until(d, row, nu + n + offset, end - n, dot6(l2, s2_speed) + dot(l1, speed))
                if masses:
                    put_until(d, row, 2 * nu + n + offset, end - n, dot6(l2, J))
            n += width(d)
        end = d.run[run].stop
        if d.run[run].new_point:
            step = vec3(d.body[d.run[run].body].step, 0)
            for i in range(nm):
                store6(d.answer[i], 0, at_inboard_point(vec6(d.answer[i], 0), step))
        run = d.run[run].inboard


@helper
def six_strips(d, row, n):
    return strips3(d, d.seed, row, n), strips3(d, d.seed, row + 3, n)


@helper
def at_inboard_point(l2, step):
    """l2, which is a force, about the base point inboard, at -step. l1 and l0 are angular and the same there."""
    return shift_force(l2, step)


@helper
def own_columns(d, J, place, start, stop, masses):
    """Row `place` for the sources start .. stop that its body carries: J . X."""
    nu = d.speed.shape[0]
    row = d.matrix[place]
    n = start
    while n < stop:
        put_until(d, row, n, stop - n, dot6(J, (strips3(d, d.force, 0, n), strips3(d, d.force, 3, n))))
        put_until(d, row, nu + n, stop - n, dot6(J, (strips3(d, d.force, 6, n), strips3(d, d.force, 9, n))))
        if masses:
            put_until(d, row, 2 * nu + n, stop - n, dot6(J, (strips3(d, d.force, 12, n), strips3(d, d.force, 15, n))))
        n += width(d)


@helper
def put_until(d, row, n, count, x):
    """Write the first `count` elements of a strip to row[n]; what follows there stays.

    Elements beyond are chosen, never subtracted: those of x may be infinite or NaN, left by a state that overflowed.
    """
    if count < width(d):
        present = after(d, strip(d, row, n), 0, count - 1)
        put(d, row, n, x)
        x = part(d, row, n, 0, count) + present
    put(d, row, n, x)


@helper
def zero(d, row):
    """A strip of zeros, of the type of those of a row."""
    return after(d, strip(d, row, 0), 0, width(d))
