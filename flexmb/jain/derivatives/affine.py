"""The force of a body of level full without turning points, and how it changes, from the integrals of its modes.

A point at r = x + phi eta has, for the motion of the body frame and with B = alpha~ + w~ w~,

    a_p = a + B r + 2 w x phi etadot + phi etaddot

so that derivatives by eta_n are sums with B phi_n, those by etadot_n with 2 w x phi_n. With the integrals
P_n = sum m phi_n r', V_n and W_n (phi etadot and phi etaddot for r), S_n = sum m phi_n, K_in = sum m phi_i phi_n', and
the vector cr(K) = sum a x b of K = sum a b',

                   force        torque                                                on mode i
    by eta_n       B S_n        S_n x a + cr((P_n + P_n')B' + 2 V_n w~' + W_n)        B : K_in
    by etadot_n    2 w x S_n    2 cr(P_n' w~')                                        2 w~ : K_in

and s1 = (x, y) acts on mode n as -2 x . cr(S_n v' + P_n w~' + V_n).
"""

from flexmb.jain.derivatives.columns import put_until
from flexmb.jain.derivatives.rigid import moved_moments
from flexmb.jain.derivatives.tables import MODE_BY_RATE, MODE_FORCE
from flexmb.jit.kernel import helper, sweep
from flexmb.jit.strips import ROW, strip, width
from flexmb.levels.affine_integrals import columns_of
from flexmb.spatial.inertia import load_inertia
from flexmb.spatial.rows import put3, strips3, total3
from flexmb.spatial.vector import add, axpy, cross, dot, scale, sub, times

ZERO9 = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@sweep
def differentiate(c, w, d, k, V, A):
    """Derivatives of the force of body k and of the rows of its modes, body axes: to `mode`, `local`, `matrix`."""
    nm, row, first, nu = c.body[k].modes, c.body[k].product, d.places[k].modes, d.speed.shape[0]
    mode, (omega, v) = d.mode[k], V
    B, spin = _centripetal(A[0], omega), _cross_matrix(scale(2.0, omega))
    flow, momentum = ZERO9, ZERO9[0]
    for n in range(0, nm, width(d)):
        blocks, at = c.product[row, n // ROW], n % ROW
        P, Q, W = columns_of(d, blocks[0], at), ZERO9, ZERO9
        for i in range(nm):
            columns = columns_of(d, blocks[1 + i], at)
            P, Q = _add(w.eta[k, i], columns, P), _add(w.etad[k, i], columns, Q)
            W = _add(w.speed[c.body[k].etad_index + i].acceleration, columns, W)
            put_until(d, d.matrix[first + i], first + n, nm - n, _contract(B, columns))
            put_until(d, d.matrix[first + i], nu + first + n, nm - n, _contract(spin, columns))
        S = strips3(d, c.mfr[k], 3, n)
        put3(d, mode, MODE_FORCE, n, add(cross(S, A[1]), _turned(B, spin, P, Q, W)))
        put3(d, mode, MODE_FORCE + 3, n, times(B, S))
        put3(d, mode, MODE_FORCE + 6, n, _moment(times(spin, P[0]), times(spin, P[1]), times(spin, P[2])))
        put3(d, mode, MODE_FORCE + 9, n, times(spin, S))
        put3(d, mode, MODE_BY_RATE, n, _by_rate(v, spin, S, P, Q))
        etad = strip(d, w.etad[k], n)
        flow, momentum = _add(etad, P, flow), axpy(etad, S, momentum)
    flow = total3(d, flow[0]), total3(d, flow[1]), total3(d, flow[2])
    _whole_body(d, k, V, flow, total3(d, momentum))


@helper
def _add(s, columns, total):
    """total + s times a matrix, both by columns."""
    return axpy(s, columns[0], total[0]), axpy(s, columns[1], total[1]), axpy(s, columns[2], total[2])


@helper
def _centripetal(alpha, omega):
    """alpha~ + w~ w~, by rows."""
    x, y, z = omega
    a, b, e = alpha
    return (
        -y * y - z * z, x * y - e, x * z + b,
        x * y + e, -x * x - z * z, y * z - a,
        x * z - b, y * z + a, -x * x - y * y,
    )  # fmt: skip


@helper
def _cross_matrix(a):
    return 0.0, -a[2], a[1], a[2], 0.0, -a[0], -a[1], a[0], 0.0


@helper
def _contract(B, columns):
    """B : sum m phi_i phi_n' from the columns of sum m phi_n phi_i'."""
    X, Y, Z = columns
    return dot((B[0], B[1], B[2]), X) + dot((B[3], B[4], B[5]), Y) + dot((B[6], B[7], B[8]), Z)


@helper
def _moment(first, second, third):
    """cr(K) of the matrix with these rows."""
    return second[2] - third[1], third[0] - first[2], first[1] - second[0]


@helper
def _row(columns, i):
    return columns[0][i], columns[1][i], columns[2][i]


@helper
def _turned(B, spin, P, Q, W):
    """cr((P + P')B' + Q spin' + W)."""
    first = add(add(times(B, add(_row(P, 0), P[0])), times(spin, _row(Q, 0))), _row(W, 0))
    second = add(add(times(B, add(_row(P, 1), P[1])), times(spin, _row(Q, 1))), _row(W, 1))
    third = add(add(times(B, add(_row(P, 2), P[2])), times(spin, _row(Q, 2))), _row(W, 2))
    return _moment(first, second, third)


@helper
def _by_rate(v, spin, S, P, Q):
    """-2 cr(S v' + P w~' + Q), with spin = 2 w~."""
    moved = _moment(times(spin, _row(P, 0)), times(spin, _row(P, 1)), times(spin, _row(P, 2)))
    flow = add(_moment(_row(Q, 0), _row(Q, 1), _row(Q, 2)), cross(S, v))
    return sub(scale(-2.0, flow), moved)


@helper
def _whole_body(d, k, V, flow, momentum):
    """2 (tr N - N') and 2 x x p to `local`, with N = sum m r v' and p = sum m v; `flow`: what modes add to N'."""
    J, coupling, mass = load_inertia(d.plain.body[k].inertia, 0)
    s = (coupling[7], coupling[2], coupling[3])  # the coupling of a rigid inertia is s~
    N = moved_moments(s, J, V)
    p = add(momentum, add(scale(mass[0], V[1]), cross(V[0], s)))
    N_t = (
        (N[0] + flow[0][0], N[3] + flow[1][0], N[6] + flow[2][0]),
        (N[1] + flow[0][1], N[4] + flow[1][1], N[7] + flow[2][1]),
        (N[2] + flow[0][2], N[5] + flow[1][2], N[8] + flow[2][2]),
    )
    trace = N_t[0][0] + N_t[1][1] + N_t[2][2]
    x = _cross_matrix(scale(-2.0, p))
    for j in range(3):
        for i in range(3):
            d.local[i, j] = (2.0 * trace if i == j else 0.0) - 2.0 * N_t[i][j]
            d.local[3 + i, j] = x[3 * i + j]
