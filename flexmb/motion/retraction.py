"""Coordinates moved by finite increments of the speeds' motion, q o exp(increment): for methods on Lie groups."""

from flexmb.hinges import catalogue
from flexmb.jit.kernel import helper, kernel
from flexmb.spatial.rotation import exponential_coefficients, left_jacobian_times, quaternion_matrix
from flexmb.spatial.vector import dot, times


@kernel
def move(y, increment, result, c):
    """Coordinates of result = those of y moved for a unit of time at the constant speeds `increment` (nu,).

    Quaternions turn about carried axes by their exact exponential; the origin of a free hinge, whose velocity is held
    in turning axes, follows the screw motion: x + R J_l(theta) v.
    """
    for k in range(c.body.shape[0]):
        i, j = c.body[k].q_index, c.body[k].u_index
        start = catalogue.quaternion_offset(c.body[k].hinge_kind)
        if start < 0:
            for n in range(c.body[k].nv):
                result[i + n] = y[i + n] + increment[j + n]
        else:
            theta = (increment[j], increment[j + 1], increment[j + 2])
            if start == 3:
                v = (increment[j + 3], increment[j + 4], increment[j + 5])
                R = quaternion_matrix(y[i + 3], y[i + 4], y[i + 5], y[i + 6])
                path = times(R, left_jacobian_times(theta, exponential_coefficients(dot(theta, theta)), v))
                for n in range(3):
                    result[i + n] = y[i + n] + path[n]
            _turn(y, i + start, theta, result)
        for n in range(c.body[k].modes):
            i, j = c.body[k].eta_index + n, c.body[k].etad_index + n
            result[i] = y[i] + increment[j]
    for n in range(c.wheel.shape[0]):
        i, j = c.wheel[n].q_index, c.wheel[n].u_index
        result[i] = y[i] + increment[j]


@helper
def _turn(q, i, theta, result):
    """Quaternion at place i of `result` = that of q times (cos |theta|/2, sin |theta|/2 theta/|theta|)."""
    quarter = 0.25 * dot(theta, theta)
    k = exponential_coefficients(quarter)
    s, x, y, z = 1.0 - quarter * k[1], 0.5 * k[0] * theta[0], 0.5 * k[0] * theta[1], 0.5 * k[0] * theta[2]
    a, b, c, d = q[i], q[i + 1], q[i + 2], q[i + 3]
    result[i] = a * s - b * x - c * y - d * z
    result[i + 1] = a * x + b * s + c * z - d * y
    result[i + 2] = a * y - b * z + c * s + d * x
    result[i + 3] = a * z + b * y - c * x + d * s
