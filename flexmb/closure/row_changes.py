"""How the rows of a closure change with the motion of B seen from A, and what their loads do that turn with A.

If A stays, a change s0 = (x, d), s1, s2 of B moves B by d and turns it by x. In components that turn with B its
velocity changes by s1, and its acceleration, that of its origin, by [s2 angular + s1 angular x w; s2 linear + 2 s1
angular x v]. A translation along the axis n of A and, with p = R_AB b x a, a rotation have the rates

    n . (v_B - v_A)         and         p . (w_B - w_A)

v_A being the velocity of the point of A where B is. The rows of a *form* are the products of a change of a row with s0,
s1 and s2. All vectors are in World axes.
"""

from typing import NamedTuple

from flexmb.closure.rows import axes
from flexmb.closure.tables import ROTATION
from flexmb.jit.kernel import helper
from flexmb.spatial.vector import add, axpy, cross, dot, scale, sub, times

ZERO = (0.0, 0.0, 0.0)


class EndMotions(NamedTuple):
    """Rotation R_WA and R_AB; velocity and acceleration [angular; of the origin of B] of A and of B."""

    R_WA: tuple
    R_AB: tuple
    V_A: tuple
    A_A: tuple
    V_B: tuple
    A_B: tuple


class Forms(NamedTuple):
    """Changes of one row: of its value by s0, its rate by s0 and s1, its acceleration by s0, s1 and s2."""

    value: tuple
    rate: tuple
    rate_by_s1: tuple
    acceleration: tuple
    by_s1: tuple
    by_s2: tuple


@helper
def forms(cc, r, ends):
    """The forms of row r. A rotation has no linear parts."""
    if cc.row[r].type == ROTATION:
        return _of_rotation(cc.row[r].axis, ends)
    return _of_translation(cc.row[r].axis, ends)


@helper
def axis_of(axis, ends):
    """Axis 0, 1 or 2 of A."""
    e = (1.0, 0.0, 0.0) if axis == 0 else (0.0, 1.0, 0.0) if axis == 1 else (0.0, 0.0, 1.0)
    return times(ends.R_WA, e)


@helper
def _of_translation(axis, ends):
    n, (w_A, _), (alpha_A, _) = axis_of(axis, ends), ends.V_A, ends.A_A
    (_, v), (_, a) = ends.V_B, ends.A_B
    n_w = cross(n, w_A)
    of_rate = cross(v, n), scale(-1.0, n_w)
    turned = sub(cross(a, n), scale(2.0, cross(v, n_w)))
    moved = sub(cross(n_w, w_A), cross(n, alpha_A))
    by_s1 = scale(2.0, cross(v, n)), scale(-2.0, n_w)
    return Forms((ZERO, n), of_rate, (ZERO, n), (turned, moved), by_s1, (ZERO, n))


@helper
def turned_axes(axis, ends):
    """The axes a of A and b of B that rotation row `axis` makes orthogonal, World axes."""
    a, b = axes(axis, ends.R_AB)
    return times(ends.R_WA, a), times(ends.R_WA, b)


@helper
def _of_rotation(axis, ends):
    """By W = w_B - w_A, b x (a x W) is what a turn x of b changes, and L and M what the changes of w_B and b do."""
    a, b = turned_axes(axis, ends)
    w_A, w_B, p = ends.V_A[0], ends.V_B[0], cross(b, a)
    W = sub(w_B, w_A)
    a_W = cross(a, W)
    alpha = sub(sub(ends.A_B[0], ends.A_A[0]), cross(w_A, W))
    b_a_W, w_p = cross(b, a_W), cross(w_B, p)
    L = add(sub(cross(cross(W, b), a), cross(p, w_A)), b_a_W)
    M = add(cross(a, alpha), cross(a_W, W))
    turned = add(add(cross(w_B, L), cross(ends.A_B[0], p)), cross(b, M))
    return Forms((p, ZERO), (add(b_a_W, w_p), ZERO), (p, ZERO), (turned, ZERO), (add(L, w_p), ZERO), (p, ZERO))


@helper
def load_of_rows(cc, cw, i, ends):
    """[torque about the origin of B; force] of the rows' loads of closure i on B, World axes."""
    tau, f = ZERO, ZERO
    for r in range(cc.closure[i].row_start, cc.closure[i].row_stop):
        if cc.row[r].type == ROTATION:
            a, b = turned_axes(cc.row[r].axis, ends)
            tau = axpy(cw.row[r].load, cross(b, a), tau)
        else:
            f = axpy(cw.row[r].load, axis_of(cc.row[r].axis, ends), f)
    return tau, f


@helper
def torque_by_turn(cc, cw, i, ends):
    """G = sum of load (a b' - a . b) (9): a turn x of B changes the rows' torque on B, in axes of A, by G'x."""
    G = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for r in range(cc.closure[i].row_start, cc.closure[i].row_stop):
        if cc.row[r].type == ROTATION:
            a, b = turned_axes(cc.row[r].axis, ends)
            load, along = cw.row[r].load, dot(a, b)
            G = (
                G[0] + load * (a[0] * b[0] - along), G[1] + load * a[0] * b[1], G[2] + load * a[0] * b[2],
                G[3] + load * a[1] * b[0], G[4] + load * (a[1] * b[1] - along), G[5] + load * a[1] * b[2],
                G[6] + load * a[2] * b[0], G[7] + load * a[2] * b[1], G[8] + load * (a[2] * b[2] - along),
            )  # fmt: skip
    return G
