"""A block of columns of M x = -T for bodies of all kinds, with hinges, modes and wheels: four strips."""

from flexmb.jain.derivatives.blocks import (
    along,
    block,
    block6,
    less,
    minus_sum,
    no_block6,
    plus,
    plus6,
    put_block,
    put_block6,
    scaled,
    shift_forces,
    shift_motions,
    sum_block6,
)
from flexmb.jain.derivatives.solve_modes import (
    answer_modes,
    answer_wheels,
    load_modes,
    moved_by_modes,
    release_modes,
    release_wheels,
)
from flexmb.jain.derivatives.tables import BLOCK
from flexmb.jain.hinge_solve import SINGLE
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.strips import width
from flexmb.spatial.rows import column6
from flexmb.spatial.spatial_vector import vec6
from flexmb.spatial.vector import vec3
from flexmb.tables.features import MODES, SEVERAL, WHEELS


@helper
def size(d):
    """Number of columns of a block."""
    return BLOCK * width(d)


@helper
def solve_block(c, w, d, at, bodies):
    """The columns from `at` on, in the rows of the first bodies of the order."""
    nothing = no_block6(d, d.passed[0, 0])
    for i in range(d.fork.shape[0]):
        put_block6(d, d.passed[d.fork[i]], nothing)
    z = nothing
    for i in range(d.stretch.shape[0] - 1, -1, -1):
        start, stop = d.stretch[i].start, min(d.stretch[i].stop, bodies)
        if start < stop:
            if d.stretch[i].ends or stop == bodies:
                z = nothing
            if d.stretch[i].forks and stop == d.stretch[i].stop:
                z = sum_block6(z, block6(d, d.passed[d.order[stop - 1]]))
            for j in range(stop - 1, start - 1, -1):
                z = _inward(c, w, d, d.order[j], at, z)
            z = _force_inboard(c, d, d.order[start], z)
    A = nothing
    for i in range(d.stretch.shape[0]):
        start, stop = d.stretch[i].start, min(d.stretch[i].stop, bodies)
        if start < stop:
            A = _acceleration_inboard(c, d, d.order[start], A)
            for j in range(start, stop):
                A = _outward(c, w, d, d.order[j], at, A)
            if d.stretch[i].forks:
                put_block6(d, d.passed[d.order[stop - 1]], A)


@helper
def is_single(w, k):
    """Whether hinge k was eliminated by its single free axis, in scenes where not all were."""
    return w.body[k].free_count == SINGLE


@helper
def _force_inboard(c, d, k, z):
    """z about the base point of the body on which body k sits, the first of its stretch."""
    p = c.body[k].parent
    if d.places[k].new_point and p >= 0:
        z = shift_forces(z, vec3(d.body[k].step, 0))
    if d.places[k].branches:
        put_block6(d, d.passed[p], sum_block6(z, block6(d, d.passed[p])))
    return z


@helper
def _acceleration_inboard(c, d, k, A):
    """A of the body on which body k sits, about its own base point; A comes from the stretch before."""
    p = c.body[k].parent
    if p < 0:
        return no_block6(d, d.passed[0, 0])
    if d.places[k].branches:
        A = block6(d, d.passed[p])
    if d.places[k].new_point:
        A = shift_motions(A, vec3(d.body[k].step, 0))
    return A


@helper
def _inward(c, w, d, k, at, z):
    """y = -T - J . z of a block of columns, and z + G y to the parent, as `hinge_solve.innovate`.

    z comes from the body before, unless body k does not carry it; that of other bodies that it carries is in `passed`.
    """
    if has(c, WHEELS):
        z = release_wheels(c, w, d, k, at, z)
    if has(c, MODES):
        z = release_modes(c, w, d, k, at, z)
    first, slot = d.places[k].hinge, d.places[k].slot
    if has(c, SEVERAL) and not is_single(w, k):
        z = _innovate(c, w, d, k, at, z)
    else:
        y = along(column6(d.seed, slot), z)
        y = minus_sum(block(d, d.matrix[first], at), y)
        put_block(d, d.matrix[first], at, y)
        z = plus6(vec6(d.gain[first], 0), y, z)
    if has(c, MODES) and c.body[k].parent >= 0:
        load_modes(c, d, k, at, z)
    return z


@helper
def _innovate(c, w, d, k, at, z):
    """`_inward` for a hinge with any number of free speeds; returns z^+."""
    first, slot, free = d.places[k].hinge, d.places[k].slot, w.body[k].free_count
    for a in range(free):
        n = w.hinge[k].free_speed[a]
        y = minus_sum(block(d, d.matrix[first + n], at), along(column6(d.seed, slot + n), z))
        for b in range(a):
            y = plus(-w.hinge[k].factor[a, b], block(d, d.matrix[first + w.hinge[k].free_speed[b]], at), y)
        put_block(d, d.matrix[first + n], at, scaled(d.factor[first + n], y))
    for a in range(free):
        place = first + w.hinge[k].free_speed[a]
        z = plus6(vec6(d.gain[place], 0), block(d, d.matrix[place], at), z)
    return z


@helper
def _outward(c, w, d, k, at, A):
    """x = y / D - G . A of the same columns, and A + J x of the body, as `hinge_solve.solve`; A is the parent's."""
    if has(c, MODES) and c.body[k].parent >= 0:
        A = moved_by_modes(c, d, k, at, A)
    first, slot = d.places[k].hinge, d.places[k].slot
    if has(c, SEVERAL) and not is_single(w, k):
        A = _solve(c, w, d, k, at, A)
    else:
        x = along(vec6(d.gain[first], 0), A)
        x = less(scaled(d.factor[first], block(d, d.matrix[first], at)), x)
        put_block(d, d.matrix[first], at, x)
        A = plus6(column6(d.seed, slot), x, A)
    if has(c, MODES):
        answer_modes(c, w, d, k, at, A)
    if has(c, WHEELS):
        answer_wheels(c, w, d, k, at, A)
    return A


@helper
def _solve(c, w, d, k, at, A):
    """`_outward` for a hinge with any number of free speeds; returns the body's A."""
    first, slot, free = d.places[k].hinge, d.places[k].slot, w.body[k].free_count
    for a in range(free - 1, -1, -1):
        place = first + w.hinge[k].free_speed[a]
        x = less(block(d, d.matrix[place], at), along(vec6(d.gain[place], 0), A))
        for b in range(a + 1, free):
            x = plus(-w.hinge[k].factor[b, a], block(d, d.matrix[first + w.hinge[k].free_speed[b]], at), x)
        put_block(d, d.matrix[place], at, scaled(d.factor[place], x))
    for a in range(free):
        n = w.hinge[k].free_speed[a]
        A = plus6(column6(d.seed, slot + n), block(d, d.matrix[first + n], at), A)
    for n in range(c.body[k].nv):
        if c.speed[c.body[k].u_index + n].prescribed >= 0:
            x = block(d, d.matrix[first + n], at)
            put_block(d, d.matrix[first + n], at, scaled(0.0, x))
    return A
