"""Bushings: linear stiffness and damping (6,6) between two frames, for any rotation below half a turn.

The displacement of B relative to A is xi = [theta; x], theta = log(R_A'R_B) and x = R_A'(p_B - p_A), in axes of A. The
angular velocity of B relative to A is w_rel = J theta', J the left Jacobian of the exponential. The rate of xi is

    theta' = J^-1 w_rel        x' = R_A'(v_B - v_A) - w_A x x

The generalised loads g = K xi + D xi' have the power g . xi'; hence the load on B about B is -[J'^-1 g_theta; g_x]. The
elastic part is exactly the derivative of the energy 1/2 xi . K xi at any rotation. At half a turn theta jumps, and the
energy with it: a run ends ten degrees before.
"""

from math import cos, radians

from flexmb.connectors.law import FrameLaw
from flexmb.jit.kernel import helper
from flexmb.jit.lanes import every, kept
from flexmb.scene.connectors import BetweenNodes, Bushing
from flexmb.spatial.rotation import (
    inverse_jacobian_coefficient,
    inverse_left_jacobian_times,
    inverse_right_jacobian_times,
    quaternion_of_matrix,
    rotation_vector,
)
from flexmb.spatial.spatial_vector import dot6, scale6, store6, sum6, times6
from flexmb.spatial.vector import cross, dot, matmul, store3, sub, times_t, transpose

STIFFNESS, DAMPING = 0, 36  # where they begin among the parameters
LEAST_UPRIGHT = cos(0.5 * radians(170.0)) ** 2  # the quaternion's scalar part is the cosine of half the angle


@helper
def load_of_bushing(c, w, i, A, B):
    """Write load, energy and power of connector i to w.connector[i].

    A and B are (position, rotation, velocity) of the two frames, World axes.
    """
    R_A, arm, row = A[1], sub(B[0], A[0]), c.connector[i].row
    q = quaternion_of_matrix(matmul(transpose(R_A), B[1]))
    theta, x = rotation_vector(q[0], q[1], q[2], q[3]), times_t(R_A, arm)
    b = inverse_jacobian_coefficient(dot(theta, theta))
    turning = inverse_left_jacobian_times(theta, b, times_t(R_A, sub(B[2][0], A[2][0])))
    moving = sub(times_t(R_A, sub(B[2][1], A[2][1])), cross(times_t(R_A, A[2][0]), x))
    elastic = _product(c.frame_law[row].parameters, STIFFNESS, (theta, x))
    damping = _product(c.frame_law[row].parameters, DAMPING, (turning, moving))
    g = sum6(elastic, damping)
    # the transpose of the inverse left Jacobian is the inverse right one
    upright = q[0] * q[0]
    w.connector[i].upright = upright
    torque = inverse_right_jacobian_times(theta, b, g[0])
    # Lanes cannot stop one copy alone: a copy beyond the limit goes on with a load of NaN.
    load = (kept(upright.real > LEAST_UPRIGHT, torque[0]), torque[1], torque[2]), g[1]
    store6(w.connector[i].load, 0, scale6(-1.0, times6(R_A, load)))
    store3(w.connector[i].arm, 0, arm)
    w.connector[i].energy = 0.5 * dot6(elastic, (theta, x))
    w.connector[i].power = -dot6(damping, (turning, moving))


@helper
def overturned(c, w):
    """A connector with parameters (a bushing) that is turned beyond its range, or -1.

    In lanes, one that is so in all copies; the copies in which it is so alone have loads NaN and end by that.
    """
    for i in range(c.connector.shape[0]):
        if c.connector[i].row >= 0 and every(w.connector[i].upright.real <= LEAST_UPRIGHT):
            return i
    return -1


@helper
def _product(p, start, V):
    """m V of the matrix m (6,6) whose rows begin at p[start]."""
    return (
        (_row(p, start, V), _row(p, start + 6, V), _row(p, start + 12, V)),
        (_row(p, start + 18, V), _row(p, start + 24, V), _row(p, start + 30, V)),
    )


@helper
def _row(p, k, V):
    return (
        p[k] * V[0][0] + p[k + 1] * V[0][1] + p[k + 2] * V[0][2]
        + p[k + 3] * V[1][0] + p[k + 4] * V[1][1] + p[k + 5] * V[1][2]
    )  # fmt: skip


def parameters(connector: BetweenNodes) -> tuple[float, ...] | None:
    """The rows of the stiffness, then those of the damping."""
    if not isinstance(connector, Bushing):
        return None
    return tuple(value for matrix in (connector.stiffness, connector.damping) for row in matrix for value in row)


LAW = FrameLaw("bushing", load_of_bushing, parameters)
