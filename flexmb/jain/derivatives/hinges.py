"""Hinges that are no single axis: the derivatives of their own functions by dual numbers, once for displacements and
once for speeds, without any recursion.

With V_r = H u and the acceleration A_r relative to the inboard frame, both in outboard axes, the motion J of speed n
and d along its displacement or change,

    displacement    s1 = V0 x J + dV_r    s2 = A0 x J + V0 x (V0 x J) + 2 V0 x dV_r + (dA_r + V_r x dV_r)
    speed           s1 = J                s2 = 2 V0 x J + (dA_r + V_r x J)
"""

from flexmb.hinges import catalogue
from flexmb.jain.derivatives.tables import BY_ACCELERATION, BY_RATE, SPEED_BY_ACCELERATION, SPEED_BY_RATE, TURN
from flexmb.jit.duals import rate, seeded
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.spatial.cross6 import motion_cross
from flexmb.spatial.rows import column6, store_column3, store_column6
from flexmb.spatial.spatial_vector import axpy6, shift_force, store6, sum6, times6
from flexmb.spatial.vector import cross, mat3, matmul, plus_cross, sub
from flexmb.tables.features import MODES, OUTBOARD_NODES, QUATERNIONS


@helper
def put_seed(d, row, slot, V):
    """Store a spatial vector in column `slot` of `seed`, from row `row` on."""
    store_column3(d.seed, row, slot, V[0])
    store_column3(d.seed, row + 3, slot, V[1])


@helper
def put_turn(c, d, slot, J):
    """In scenes with modes: the angular parts of s0 and s1 of a hinge speed, which are those of its motion."""
    if has(c, MODES):
        store_column3(d.seed, TURN, slot, J[0])
        store_column3(d.seed, SPEED_BY_RATE, slot, J[0])


@sweep
def several(c, w, d, k, R, r, V0, A0):
    """Motion of the outboard frame and seeds of hinge k; `moved` keeps the derivatives of its H."""
    slot = d.places[k].slot
    V_r, A_r = _by_displacement(c, w, d, k)
    _by_speed(c, w, d, k)
    relative = to_world(R, r, V_r)
    V = sum6(V0, relative)
    A = sum6(sum6(A0, motion_cross(V0, relative)), to_world(R, r, A_r))
    for n in range(c.body[k].nv):
        J = to_world(R, r, column6(w.hinge[k].map, n))
        turned = motion_cross(V0, J)
        change = to_world(R, r, column6(d.turned[0], n))
        s1 = sum6(turned, change)
        own = sum6(to_world(R, r, column6(d.turned[1], n)), motion_cross(relative, change))
        s2 = sum6(motion_cross(A0, J), motion_cross(V0, turned))
        s2 = axpy6(2.0, motion_cross(V0, change), sum6(s2, own))
        store_column6(d.seed, slot + n, J)
        put_seed(d, BY_RATE, slot + n, s1)
        put_turn(c, d, slot + n, J)
        put_seed(d, BY_ACCELERATION, slot + n, s2)
        own = sum6(to_world(R, r, column6(d.turned[2], n)), motion_cross(relative, J))
        put_seed(d, SPEED_BY_ACCELERATION, slot + n, axpy6(2.0, turned, own))
    return V, A


@helper
def outboard_rotation(c, w, d, k):
    """R_World_O of hinge k."""
    R = mat3(d.body[k].rotation, 0)
    if has(c, OUTBOARD_NODES) and c.body[k].outboard_port >= 0:
        return matmul(R, mat3(w.port[c.body[k].outboard_port].R, 0))
    return R


@helper
def force_to_world(R, r, F):
    """A force about O in body axes, in World axes about the base point; r leads from there to O."""
    return shift_force(times6(R, F), r)


@helper
def to_world(R, r, V):
    """A motion about O in body axes, in World axes about the base point; r leads from there to O."""
    angular, linear = times6(R, V)
    return angular, plus_cross(linear, r, angular)


@helper
def _by_displacement(c, w, d, k):
    """V_r and A_r in outboard axes; their derivatives by displacements to `turned` 0 and 1, those of H to `moved`."""
    e, nv = d.duals, c.body[k].nv
    _displace(c, w, d, k)
    _relative(c, w, d, k)
    for n in range(nv):
        for i in range(6):
            d.turned[0, i, n] = rate(e.body[k].velocity[i], n)
            d.turned[1, i, n] = rate(e.body[k].accel[i], n)
            for m in range(nv):
                d.moved[k, n, i, m] = rate(e.hinge[k].map[i, m], n)
    return _values(e.body[k].velocity), _values(e.body[k].accel)


@helper
def _by_speed(c, w, d, k):
    """Derivatives of A_r by speeds to `turned` 2."""
    e, i, j = d.duals, c.body[k].q_index, c.body[k].u_index
    for m in range(_coordinates(c, k)):
        e.q[i + m] = w.q[i + m]
    for n in range(c.body[k].nv):
        e.u[j + n] = w.u[j + n]
        e.u[j + n] = seeded(e.u[j + n], n)
    _relative(c, w, d, k)
    for n in range(c.body[k].nv):
        for i in range(6):
            d.turned[2, i, n] = rate(e.body[k].accel[i], n)


@helper
def _coordinates(c, k):
    """Number of coordinates of hinge k: a quaternion has one more than speeds."""
    if has(c, QUATERNIONS) and c.body[k].quaternion >= 0:
        return c.body[k].nv + 1
    return c.body[k].nv


@helper
def _displace(c, w, d, k):
    """Coordinates of the dual workspace with unit displacements along the speeds in the lanes: q + N xi."""
    e, i, j = d.duals, c.body[k].q_index, c.body[k].u_index
    for m in range(_coordinates(c, k)):
        e.q[i + m] = w.q[i + m]
    for n in range(c.body[k].nv):
        e.u[j + n] = 0.0
        e.u[j + n] = seeded(e.u[j + n], n)
    catalogue.rate(c, c.body[k].hinge_kind, e.q, i, e.u, j, e.rate)
    for m in range(_coordinates(c, k)):
        e.q[i + m] += e.rate[i + m]
    for n in range(c.body[k].nv):
        e.u[j + n] = w.u[j + n]


@helper
def _relative(c, w, d, k):
    """V_r and A_r of hinge k at the coordinates and speeds of the dual workspace, with H udot in A_r."""
    e, i, j = d.duals, c.body[k].q_index, c.body[k].u_index
    H = e.hinge[k].map
    V, A = catalogue.motion(c, c.body[k].hinge_kind, e.q, i, e.u, j, c.body[k].sequence, c.body[k].parameters, H)
    A = A[0], sub(A[1], cross(V[0], V[1]))
    store6(e.body[k].velocity, 0, V)
    store6(e.body[k].accel, 0, A)
    for n in range(c.body[k].nv):
        for i in range(6):
            e.body[k].accel[i] += w.speed[j + n].acceleration * H[i, n]


@helper
def _values(a):
    """The numbers of six duals as a motion."""
    return (a[0].real, a[1].real, a[2].real), (a[3].real, a[4].real, a[5].real)
