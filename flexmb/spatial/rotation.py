"""Rotations: quaternions, rotation vectors, their rates. R_AB maps components in B to components in A."""

from flexmb.jit.kernel import by_number, helper
from flexmb.jit.lanes import every, select
from flexmb.spatial.scalar import atan2, sincos, sqrt
from flexmb.spatial.vector import add, cross, dot, scale

_SMALL = 0.25  # square of the angle below which series are used; see `_series` for their truncation error


@helper
def rotation_z(angle):
    """Rotation by `angle` about z."""
    s, c = sincos(angle)
    return c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0


@helper
def turned_about_z(m, c, s):
    """M R_z, by cosine and sine of the angle."""
    return (
        c * m[0] + s * m[1], c * m[1] - s * m[0], m[2],
        c * m[3] + s * m[4], c * m[4] - s * m[3], m[5],
        c * m[6] + s * m[7], c * m[7] - s * m[6], m[8],
    )  # fmt: skip


@helper
def rotation_axis(axis, angle):
    """Rotation by `angle` about coordinate axis 0, 1 or 2."""
    s, c = sincos(angle)
    if axis == 0:
        return 1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c
    if axis == 1:
        return c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c
    return c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0


@helper
def quaternion_matrix(w, x, y, z):
    """Rotation matrix of a unit quaternion (scalar first)."""
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )


@helper
def quaternion_rate(w, x, y, z, omega):
    """1/2 q (0, omega) with omega in the rotated (outboard) axes; linear in q, so the norm is an invariant."""
    a, b, c = omega
    return (
        0.5 * (-x * a - y * b - z * c),
        0.5 * (w * a + y * c - z * b),
        0.5 * (w * b + z * a - x * c),
        0.5 * (w * c + x * b - y * a),
    )


@helper
def rotation_vector(w, x, y, z):
    """Rotation vector of a unit quaternion, angle in [0, pi]."""
    s2 = x * x + y * y + z * z
    sign = select(w.real >= 0.0, 1.0, -1.0)
    small = s2.real < 1e-16
    # 2 atan(s)/s -> 2 (1 - s^2/3): the correction is below round-off here, and s has no derivative at 0
    if every(small):
        return scale(2.0 * sign, (x, y, z))
    s = sqrt(s2)
    return scale(select(small, 2.0 * sign, 2.0 * sign * atan2(s, sign * w) / s), (x, y, z))


@helper
def quaternion_of_matrix(R):
    """Unit quaternion, scalar first, of a rotation matrix, from its largest component, which avoids cancellation."""
    d = 1.0 + R[0] + R[4] + R[8]  # the rows of 4 q q' follow from R, and each of them is a multiple of q
    q = d, R[7] - R[5], R[2] - R[6], R[3] - R[1]
    d, q = _larger(d, q, 1.0 + R[0] - R[4] - R[8], (R[7] - R[5], 1.0 + R[0] - R[4] - R[8], R[1] + R[3], R[2] + R[6]))
    d, q = _larger(d, q, 1.0 - R[0] + R[4] - R[8], (R[2] - R[6], R[1] + R[3], 1.0 - R[0] + R[4] - R[8], R[5] + R[7]))
    d, q = _larger(d, q, 1.0 - R[0] - R[4] + R[8], (R[3] - R[1], R[2] + R[6], R[5] + R[7], 1.0 - R[0] - R[4] + R[8]))
    s = 0.5 / sqrt(d)
    return s * q[0], s * q[1], s * q[2], s * q[3]


@helper
def _larger(d, q, d2, q2):
    """The larger of two diagonal elements of q q', with its row."""
    second = d2.real > d.real
    return select(second, d2, d), (
        select(second, q2[0], q[0]),
        select(second, q2[1], q[1]),
        select(second, q2[2], q[2]),
        select(second, q2[3], q[3]),
    )


@helper
def _series(t2):
    """`exponential_coefficients` by series, because the closed forms suffer from cancellation at small angles.

    The first omitted term is below 1e-14 of the value for b2, b3 and below 1e-17 for the others.
    """
    # Horner: sum over k of (-t2)^k / (2k + m)!, m = 1, 2, 3
    a1 = 1.0 / 362880.0 - t2 * (1.0 / 39916800.0 - t2 * (1.0 / 6227020800.0 - t2 * (1.0 / 1307674368000.0)))
    a1 = 1.0 - t2 * (1.0 / 6.0 - t2 * (1.0 / 120.0 - t2 * (1.0 / 5040.0 - t2 * a1)))
    a2 = 1.0 / 3628800.0 - t2 * (1.0 / 479001600.0 - t2 * (1.0 / 87178291200.0 - t2 * (1.0 / 20922789888000.0)))
    a2 = 1.0 / 2.0 - t2 * (1.0 / 24.0 - t2 * (1.0 / 720.0 - t2 * (1.0 / 40320.0 - t2 * a2)))
    a3 = 1.0 / 39916800.0 - t2 * (1.0 / 6227020800.0 - t2 * (1.0 / 1307674368000.0 - t2 * (1.0 / 355687428096000.0)))
    a3 = 1.0 / 6.0 - t2 * (1.0 / 120.0 - t2 * (1.0 / 5040.0 - t2 * (1.0 / 362880.0 - t2 * a3)))
    b2 = -1.0 / 12.0 + t2 * (
        1.0 / 180.0 - t2 * (1.0 / 6720.0 - t2 * (1.0 / 453600.0 - t2 * (1.0 / 47900160.0 - t2 * (1.0 / 7264857600.0))))
    )
    b3 = -1.0 / 60.0 + t2 * (
        1.0 / 1260.0
        - t2 * (1.0 / 60480.0 - t2 * (1.0 / 4989600.0 - t2 * (1.0 / 622702080.0 - t2 * (1.0 / 108972864000.0))))
    )
    return a1, a2, a3, b2, b3


@helper
def _closed(t2):
    """`exponential_coefficients` in closed form."""
    t = sqrt(t2)
    s, c = sincos(t)
    a1 = s / t
    a2 = (1.0 - c) / t2
    a3 = (t - s) / (t2 * t)
    return a1, a2, a3, (s / t - 2.0 * a2) / t2, ((1.0 - c) / t2 - 3.0 * a3) / t2


@helper
def _one_form(t2):
    if t2.real < _SMALL:
        return _series(t2)
    return _closed(t2)


@helper
def _both_forms(t2):
    """Of lanes, each with the form that its angle asks for."""
    small = t2 < _SMALL
    near = _series(t2)
    if every(small):
        return near
    far = _closed(t2)
    return (
        select(small, near[0], far[0]),
        select(small, near[1], far[1]),
        select(small, near[2], far[2]),
        select(small, near[3], far[3]),
        select(small, near[4], far[4]),
    )


# a1 = sin t/t, a2 = (1 - cos t)/t^2, a3 = (t - sin t)/t^3, and b2 = a2'/t, b3 = a3'/t, from t^2
exponential_coefficients = by_number(_one_form, _both_forms)


@helper
def exponential(theta, k):
    """R = exp(skew(theta)) with k = exponential_coefficients(theta . theta)."""
    return in_powers(theta, k[0], k[1])


@helper
def left_jacobian(theta, k):
    """J_l(theta): R' = skew(J_l thetadot) R."""
    return in_powers(theta, k[1], k[2])


@helper
def in_powers(theta, a, b):
    """1 + a skew(theta) + b skew(theta)^2."""
    x, y, z = theta
    return (
        1.0 - b * (y * y + z * z),
        b * x * y - a * z,
        b * x * z + a * y,
        b * x * y + a * z,
        1.0 - b * (x * x + z * z),
        b * y * z - a * x,
        b * x * z - a * y,
        b * y * z + a * x,
        1.0 - b * (x * x + y * y),
    )


@helper
def left_jacobian_times(theta, k, v):
    """J_l(theta) v = v + a2 theta x v + a3 theta x (theta x v)."""
    c = cross(theta, v)
    return add(add(v, scale(k[1], c)), scale(k[2], cross(theta, c)))


@helper
def _near(t2):
    """1/12 + t^2/720 + ..., terms |B_2n|/(2n)! t^(2n-2): the first left out is below 1e-17 for t^2 < 1."""
    b = 43867.0 / 5109094217170944000.0 + t2 * (174611.0 / 802857662698291200000.0)
    b = 1.0 / 74724249600.0 + t2 * (3617.0 / 10670622842880000.0 + t2 * b)
    b = 1.0 / 47900160.0 + t2 * (691.0 / 1307674368000.0 + t2 * b)
    return 1.0 / 12.0 + t2 * (1.0 / 720.0 + t2 * (1.0 / 30240.0 + t2 * (1.0 / 1209600.0 + t2 * b)))


@helper
def _far(t2):
    t = sqrt(t2)
    s, c = sincos(t)
    return (1.0 - 0.5 * t * s / (1.0 - c)) / t2


@helper
def _one_angle(t2):
    if t2.real < 1.0:
        return _near(t2)
    return _far(t2)


@helper
def _angles(t2):
    """Of lanes, each with the form that its angle asks for."""
    small = t2 < 1.0
    near = _near(t2)
    if every(small):
        return near
    return select(small, near, _far(t2))


# b = (1 - (t/2) cot(t/2))/t^2 from t^2: J_l^-1 = 1 - 1/2 skew(theta) + b skew(theta)^2, regular below a whole turn
inverse_jacobian_coefficient = by_number(_one_angle, _angles)


@helper
def inverse_left_jacobian_times(theta, b, v):
    """J_l(theta)^-1 v, b = inverse_jacobian_coefficient(theta . theta)."""
    x = cross(theta, v)
    return add(add(v, scale(-0.5, x)), scale(b, cross(theta, x)))


@helper
def inverse_right_jacobian_times(theta, b, v):
    """J_r(theta)^-1 v, which is the transpose of J_l^-1 times v."""
    x = cross(theta, v)
    return add(add(v, scale(0.5, x)), scale(b, cross(theta, x)))


@helper
def left_jacobian_rate(theta, k, rate):
    """d/dt(J_l(theta)) thetadot at given thetadot: the part of the angular acceleration without thetaddot."""
    c = cross(theta, rate)
    p = dot(theta, rate)
    return add(add(scale(k[3] * p, c), scale(k[4] * p, cross(theta, c))), scale(k[2], cross(rate, c)))
